"""The comparator's input of a pixel: it goes one way from knot to knot, and reaches levels where it is said to."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.path import KNOTS, Path, knots_of, reach, value
from vid2ev.physics.log_curve import Curve, curve_of
from vid2ev.physics.photoreceptor import response_terms

CURVES = [curve_of(name, 0.001) for name in ("offset", "toe", "v2e")]


@compiled
def walked(path, s):
    """Knots of a path, its values at s, and where it reaches the middle of each piece."""
    knots, met = np.full(KNOTS, 2.0), np.full(KNOTS, np.nan)
    knots_of(path, knots)
    start = 0.0
    for k in range(KNOTS):
        begin, end = value(path, start), value(path, knots[k])
        met[k] = reach(path, 0.5 * (begin + end), start, knots[k], begin, end, end > begin)
        start = knots[k]
        if start >= 1.0:
            break
    values = np.empty(s.size)
    for k in range(s.size):
        values[k] = value(path, s[k])
    return knots, values, met


@compiled
def left_at_once(path, level, start, begin, up):
    """Where a path that is at `begin` from `start` on reaches a level."""
    return reach(path, level, start, 1.0, begin, begin, up)


def path_of_light(light: float, rise: float, lags: tuple[float, float], rates: tuple[float, float], drift: float,
                  curve: Curve, base: float = 0.0) -> Path:  # fmt: skip
    """A path of light behind two poles, the lags of which are these shares of the light."""
    e1, e2 = (share * light for share in lags)
    du = rise * light
    c1, c2 = response_terms(du, e1, e2, *rates, True)
    end = light - e2 + du + c1 * np.expm1(-rates[0]) + c2 * np.expm1(-rates[1])
    return Path(light - e2, end, du, c1, c2, *rates, True, base, drift, curve)


@pytest.mark.parametrize(
    ("curve", "before_the_log"),
    [*((curve, True) for curve in CURVES), (CURVES[0], False)],
    ids=["offset", "toe", "v2e", "after the log"],
)
def test_between_two_knots_a_signal_goes_one_way(curve, before_the_log):
    rng = np.random.default_rng(1)
    for _ in range(4000):
        rate = 10 ** rng.uniform(-2, 3)
        rates = rng.permutation([rate, rate * rng.uniform(1.05, 20)])
        lags, drift = rng.uniform(-0.9, 0.9, 2), 10 ** rng.uniform(-3, 1)
        light, rise, base = 10 ** rng.uniform(-3, 0.5), rng.uniform(-1, 3), rng.normal()
        goes_one_way(path_of_light(light, rise, lags, rates, drift, curve, base)._replace(light=before_the_log))


def goes_one_way(path: Path) -> None:
    """Look at it closely."""
    s = np.unique(np.concatenate([np.linspace(0, 1, 400), np.geomspace(1e-6, 1, 400)]))
    knots, values, met = walked(path, s)
    knots = knots[: np.argmax(knots >= 1.0) + 1]
    assert knots[-1] == 1.0 and (np.diff(knots) >= 0).all()
    y = path.y0 + path.rise * s + path.c1 * np.expm1(-path.a * s) + path.c2 * np.expm1(-path.b * s)
    nats = level_of(np.maximum(y, 0.0), path.curve) if path.light else y
    np.testing.assert_allclose(values, nats + path.base + path.drift * s, rtol=1e-9, atol=1e-9)
    start, noise = 0.0, 1e-11 * (1 + np.abs(values).max())
    for knot, reached in zip(knots, met, strict=False):
        inside = values[(s >= start) & (s <= knot)]
        ways = np.diff(inside)
        assert (ways >= -noise).all() or (ways <= noise).all()
        begin, end, there = walked(path, np.array([start, knot, reached]))[1]
        assert there == pytest.approx((begin + end) / 2, abs=1e-11)
        start = knot


def level_of(light: np.ndarray, curve: Curve) -> np.ndarray:
    """What a curve makes of light [nat]."""
    logs = np.log(np.maximum(light, curve.knee) + curve.dark)
    return np.where(light < curve.knee, light * curve.slope + curve.black, logs)


@pytest.mark.parametrize("light", [True, False])
def test_a_signal_ends_where_the_next_interval_starts_from(light):
    """The state of the filter is rounded there, and the response is not."""
    path = path_of_light(0.5, 1.0, (0.1, 0.2), (3.0, 10.0), 0.3, CURVES[0], 0.2)._replace(end=0.75, light=light)
    end = walked(path, np.array([1.0]))[1][0]
    assert end == pytest.approx((np.log(0.751) if light else 0.75) + 0.5)


@pytest.mark.parametrize("curve", CURVES, ids=["offset", "toe", "v2e"])
def test_less_than_no_light_is_none(curve):
    """As rounding may leave it after a flash of many decades."""
    path = path_of_light(0.0, 0.0, (0.0, 0.0), (3.0, 10.0), 0.0, curve)
    assert walked(path._replace(y0=-0.1), np.array([0.5]))[1][0] == walked(path, np.array([0.5]))[1][0]


@pytest.mark.parametrize("beyond", [0.0, 1e-12])
@pytest.mark.parametrize("up", [True, False])
def test_a_level_that_a_signal_starts_at_is_reached_there(up, beyond):
    """Also by one that stays, as where noise has just brought a memory one threshold away from steady light, or
    rounding a little further."""
    still = path_of_light(0.5, 0.0, (0.0, 0.0), (3.0, 10.0), 0.0, CURVES[0])
    begin = walked(still, np.array([0.0]))[1][0]
    for start in (0.0, 0.25):
        assert left_at_once(still, begin - beyond if up else begin + beyond, start, begin, up) == start


def test_a_leak_that_outruns_the_fall_of_light_turns_the_signal_twice():
    path = path_of_light(97.8, -1.0, (0.0, -0.009), (1e6, 600.0), 2.46, CURVES[0])
    knots, values, _ = walked(path, np.linspace(0, 1, 100_001))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(values)))) / 1e5
    np.testing.assert_allclose(knots[: len(turns)], turns, atol=3e-5)
    assert len(turns) == 2 and knots[2] == 1.0
