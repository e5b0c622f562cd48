"""Pieces of responses, of which the log may drift: from turn to turn, found by vector code or not, they go one way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.ladder import END
from vid2ev.kernels.lanes import BASE, C1, C2, DRIFT, F1, LAST, LOWER, RISE, S1, UPPER, Y0, A
from vid2ev.kernels.layout import Interval
from vid2ev.kernels.path import KNOTS
from vid2ev.kernels.response import next_piece, prepare_responses
from vid2ev.kernels.work import Work, new_work
from vid2ev.physics.log_curve import Curve
from vid2ev.physics.photoreceptor import response_terms
from vid2ev.sensors.compiled import flags_of, interval_of, numbers_of
from vid2ev.sensors.presets import load_sensor

LANES = 500
LOADED = Y0, RISE, C1, C2, A, LAST, UPPER, LOWER
SENSORS = {
    "two poles": (),
    "one pole": ("follower_tau_us=0",),
    "none": ("photoreceptor_tau_us=0", "follower_tau_us=0"),
    "a knee": ("log_curve=toe",),
    "a first pole as fast as the light": ("bandwidth=light",),
    "after the log": ("filter=after",),
    "two poles, no leak": ("leak_rate_hz=0",),
    "one pole, no leak": ("leak_rate_hz=0", "follower_tau_us=0"),
    "a first pole as fast as the light, no leak": ("leak_rate_hz=0", "bandwidth=light"),
}


@compiled
def pieces_of(work, count, ends, b, flags, num, iv):
    """The end of each piece of the lanes, the response there and what is seen of it, into ends [count, ..., 3]."""
    prepare_responses(work, count, b, flags, num, iv)
    for j in range(count):
        for k in range(ends.shape[1]):
            ends[j, k, 0], ends[j, k, 1], ends[j, k, 2] = work.lanes[S1 + j], work.lanes[F1 + j], work.lanes[END + j]
            if work.lanes[S1 + j] >= 1.0:
                break
            next_piece(work.lanes, j, work.knots, b, flags, num)


def loaded(rng: np.random.Generator, poles: int, rates: np.ndarray, iv: Interval, curve: Curve) -> Work:
    """A work with lanes of random light [0.001, 3], its rise and its lags, and no numbers anywhere else.

    Some light falls about as fast as what is added to its log rises.
    """
    work = new_work()
    for plane in (work.lanes, work.levels, work.when, work.steps, work.jobs, work.guesses, work.turns, work.knots):
        plane[:] = np.nan
    light = 10 ** rng.uniform(-3, 0.5, LANES)
    rise = np.where(rng.random(LANES) < 0.3, 0.0, light * rng.uniform(-0.9, 2, LANES))
    e1, e2 = light * rng.uniform(-0.8, 0.8, (2, LANES)) * 10 ** rng.uniform(-6, 0, LANES)
    follows, drift = rng.random(LANES) < 0.3, iv.leak1 - iv.leak0
    per_nat = np.where(light < curve.knee, curve.floor, light + curve.dark)
    little = np.minimum(abs(drift) * per_nat, 0.5 * light)
    rise = np.where(follows, -np.sign(drift) * little * rng.uniform(0.5, 1.5, LANES), rise)
    e1, e2 = np.where(rng.random(LANES) < 0.1, 0.0, (e1, e2))  # (from rest)
    e1, e2 = np.where(follows, little * rng.uniform(-1, 1, (2, LANES)), (e1, e2))
    c1, c2 = np.vectorize(response_terms)(rise, e1, e2, rates, iv.b, poles == 2) if poles else (0.0, 0.0)
    start = light - (0.0, e1, e2)[poles]
    last = (start + rise + c1 * np.expm1(-rates) + c2 * np.expm1(-iv.b)) * (1 + 1e-8)  # (a state is rounded)
    last[:3] = -1e-8  # (after a flash of many decades to less than nothing)
    for plane, values in zip(LOADED[:6], (light, rise, e1, e2, rates, last), strict=True):
        work.lanes[plane : plane + LANES] = values
    work.lanes[UPPER : UPPER + LANES], work.lanes[LOWER : LOWER + LANES] = -np.inf, np.inf
    return work


@pytest.mark.parametrize("settings", SENSORS.values(), ids=SENSORS.keys())
def test_signals_go_one_way_from_turn_to_turn(settings):
    spec = load_sensor("paper", ("leak_rate_hz=1", *settings))
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    poles, drifts = len(flags.poles), len(flags.drift) > 0
    rng, turned = np.random.default_rng(2), 0
    s = np.unique(np.concatenate([np.linspace(0, 1, 300), np.geomspace(1e-6, 1, 300)]))
    for dt_us in (10, 200, 2000, 40_000, 400_000):  # (the last drifts by more than vector code is asked for)
        for falls in (False, True) if drifts else (False,):  # (as noise may)
            iv = interval_of(flags, num, 0, dt_us * 1000, 0, 0, False)
            iv = iv._replace(leak0=iv.leak1, leak1=iv.leak0) if falls else iv
            rates = 10 ** rng.uniform(-2, 2, LANES) if flags.light_bandwidth else np.full(LANES, iv.a)
            b = iv.b if poles == 2 else 0.0
            work, ends = loaded(rng, poles, rates, iv, num.curve), np.ones((LANES, KNOTS, 3))
            pieces_of(work, LANES, ends, b, flags, num, iv)
            for j in range(LANES):
                start, count = 0.0, int(np.argmax(ends[j, :, 0] >= 1.0)) + 1
                y = response_of(work, j, s, b)
                heights = nats_of(work, j, y, s, num.curve, bool(flags.log_input))
                for end, there, seen in ends[j, :count]:
                    inside = heights[(s >= start) & (s <= end)]
                    if inside.size > 0:
                        falls_by = (np.maximum.accumulate(inside) - inside).max()
                        rises_by = (inside - np.minimum.accumulate(inside)).max()
                        assert min(falls_by, rises_by) < (1e-6 if drifts else 1e-12), (dt_us, falls, j, start, end)
                    assert end > start
                    y = work.lanes[LAST + j] if end == 1.0 else response_of(work, j, end, b)
                    assert there == pytest.approx(y, rel=1e-9, abs=1e-12)
                    assert seen == pytest.approx(nats_of(work, j, y, end, num.curve, bool(flags.log_input)), abs=1e-9)
                    start = end
                assert start == 1.0
                turned += count > 1
    assert turned > (0 if poles == 0 else 100)  # (light that falls as the leak rises, within 4 ms)


@pytest.mark.parametrize("settings", [(), ("follower_tau_us=0",), ("bandwidth=light",)], ids=["two", "one", "by light"])
def test_a_level_that_is_reached_between_two_ends_has_an_end_beyond_it(settings):
    """Turns are looked for only where they may matter: near levels."""
    spec = load_sensor("paper", ("leak_rate_hz=0", *settings))
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    poles, rng, s = len(flags.poles), np.random.default_rng(2), np.linspace(0, 1, 2000)
    met = unsplit = 0
    for dt_us in (50, 200, 1000, 5000):
        iv = interval_of(flags, num, 0, dt_us * 1000, 0, 0, False)
        b, rates = iv.b if poles == 2 else 0.0, np.full(LANES, iv.a)
        rates = rates * 10 ** rng.uniform(-1, 1, LANES) if flags.light_bandwidth else rates
        work, ends = loaded(rng, poles, rates, iv, num.curve), np.ones((LANES, KNOTS, 3))
        first = work.lanes[Y0 : Y0 + LANES] - (0.0, work.lanes[C1 : C1 + LANES], work.lanes[C2 : C2 + LANES])[poles]
        last, away = work.lanes[LAST : LAST + LANES], 10 ** rng.uniform(-6, -1, (2, LANES)) * first
        upper, lower = np.maximum(first, last) + away[0], np.minimum(first, last) - away[1]
        work.lanes[UPPER : UPPER + LANES], work.lanes[LOWER : LOWER + LANES] = upper, lower
        pieces_of(work, LANES, ends, b, flags, num, iv)
        for j in range(3, LANES):
            y = response_of(work, j, s, b)
            count = int(np.argmax(ends[j, :, 0] >= 1.0)) + 1
            reached = [y.max() > upper[j] + 1e-7 * first[j], y.min() < lower[j] - 1e-7 * first[j]]
            there = np.array([first[j], *ends[j, :count, 1]])
            assert not reached[0] or there.max() >= upper[j]
            assert not reached[1] or there.min() <= lower[j]
            met, unsplit = met + any(reached), unsplit + (count == 1)
    assert met > 100 and unsplit > 500


def test_turns_of_a_lane_do_not_depend_on_who_else_is_there():
    spec = load_sensor("paper", ("leak_rate_hz=1",))
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    rng, iv = np.random.default_rng(1), interval_of(flags, num, 0, 200_000, 0, 0, False)
    work = loaded(rng, 2, np.full(LANES, iv.a), iv, num.curve)
    planes = [work.lanes[plane : plane + LANES].copy() for plane in LOADED]

    def ends_of(lanes: np.ndarray) -> np.ndarray:
        for plane, values in zip(LOADED, planes, strict=True):
            work.lanes[plane : plane + len(lanes)] = values[lanes]
        ends = np.ones((len(lanes), KNOTS, 3))
        pieces_of(work, len(lanes), ends, iv.b, flags, num, iv)
        return ends

    alone = [ends_of(np.array([j]))[0] for j in range(LANES)]
    turning = np.array([j for j in range(LANES) if alone[j][0, 0] < 1.0])
    for one, others in zip(turning, rng.permutation(turning), strict=True):
        assert np.array_equal(ends_of(np.array([one] + 63 * [others]))[0], alone[one])
    assert len(turning) > 100


def response_of(work: Work, j: int, s: Any, b: float) -> Any:
    """The response of lane j at s."""
    y0, rise, c1, c2, a = (work.lanes[plane + j] for plane in (Y0, RISE, C1, C2, A))
    return y0 + rise * s + c1 * np.expm1(-a * s) + c2 * np.expm1(-b * s)


def nats_of(work: Work, j: int, y: Any, s: Any, curve: Curve, log: bool) -> Any:
    """The signal [nat] of a response of lane j that is y at s."""
    if log:
        return y
    light = np.maximum(y, 0.0)
    logs = np.log(np.maximum(light, curve.knee) + curve.dark)
    nats = np.where(light < curve.knee, light * curve.slope + curve.black, logs)
    return nats + np.nan_to_num(work.lanes[BASE + j] + work.lanes[DRIFT + j] * s)
