"""Lanes of which the log of light drifts: between the turns that are found, by vector code or not, they go one way."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.lanes import BASE, C1, C2, DRIFT, LAST, LOWER, NEXT, RISE, S1, UPPER, Y0, A
from vid2ev.kernels.layout import Interval
from vid2ev.kernels.response import prepare_responses
from vid2ev.kernels.work import Work, new_work
from vid2ev.physics.log_curve import Curve
from vid2ev.physics.photoreceptor import response_terms
from vid2ev.sensors.compiled import flags_of, interval_of, numbers_of
from vid2ev.sensors.presets import load_sensor

LANES = 500
SENSORS = {
    "two poles": (),
    "one pole": ("follower_tau_us=0",),
    "none": ("photoreceptor_tau_us=0", "follower_tau_us=0"),
    "a knee": ("log_curve=toe",),
    "a first pole as fast as the light": ("bandwidth=light",),
}


@compiled
def prepared(work, count, b, flags, num, iv):
    """The loaded lanes on their first pieces."""
    prepare_responses(work, count, b, flags, num, iv)


def loaded(rng: np.random.Generator, poles: int, light_bandwidth: bool, iv: Interval) -> Work:
    """A work with lanes of random light [0.001, 3], its rise and its lags."""
    work = new_work()
    rates = 10 ** rng.uniform(-2, 2, LANES) if light_bandwidth else np.full(LANES, iv.a)
    light = 10 ** rng.uniform(-3, 0.5, LANES)
    rise = np.where(rng.random(LANES) < 0.3, 0.0, light * rng.uniform(-0.9, 2, LANES))
    e1, e2 = light * rng.uniform(-0.8, 0.8, (2, LANES)) * 10 ** rng.uniform(-6, 0, LANES)
    c1, c2 = np.vectorize(response_terms)(rise, e1, e2, rates, iv.b, poles == 2) if poles else (0.0, 0.0)
    start = light - (0.0, e1, e2)[poles]
    last = start + rise + c1 * np.expm1(-rates) + c2 * np.expm1(-iv.b)
    for plane, values in ((Y0, light), (RISE, rise), (C1, e1), (C2, e2), (A, rates), (LAST, last)):
        work.lanes[plane : plane + LANES] = values
    work.lanes[UPPER : UPPER + LANES], work.lanes[LOWER : LOWER + LANES] = -np.inf, np.inf
    return work


@pytest.mark.parametrize("settings", SENSORS.values(), ids=SENSORS.keys())
def test_signals_go_one_way_from_turn_to_turn(settings):
    spec = load_sensor("paper", ("leak_rate_hz=1", *settings))
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    assert len(flags.drift) == 1
    rng, turned = np.random.default_rng(2), 0
    s = np.unique(np.concatenate([np.linspace(0, 1, 300), np.geomspace(1e-6, 1, 300)]))
    for dt_us in (10, 200, 2000, 40_000, 400_000):  # (the last drifts by more than vector code is asked for)
        iv = interval_of(flags, num, 0, dt_us * 1000, 0, 0, False)
        b = iv.b if len(flags.poles) == 2 else 0.0
        work = loaded(rng, len(flags.poles), len(flags.light_bandwidth) > 0, iv)
        prepared(work, LANES, b, flags, num, iv)
        for j in range(LANES):
            first, second = work.lanes[S1 + j], work.lanes[NEXT + j]
            heights = height(work, j, s, b, num.curve)
            for piece in (s <= first, (s >= first) & (s <= second)):
                ways = np.diff(heights[piece])
                assert (ways >= -1e-6).all() or (ways <= 1e-6).all(), (dt_us, j, first, second)
            turned += first < 1.0
    assert turned > (0 if len(flags.poles) == 0 else 100)  # (light that falls as the leak rises, within 4 ms)


def height(work: Work, j: int, s: np.ndarray, b: float, curve: Curve) -> np.ndarray:
    """The signal of lane j [nat] at s."""
    y0, rise, c1, c2, a, base, drift = (work.lanes[plane + j] for plane in (Y0, RISE, C1, C2, A, BASE, DRIFT))
    light = np.maximum(y0 + rise * s + c1 * np.expm1(-a * s) + c2 * np.expm1(-b * s), 0.0)
    logs = np.log(np.maximum(light, curve.knee) + curve.dark)
    return np.where(light < curve.knee, light * curve.slope + curve.black, logs) + base + drift * s
