"""When levels are reached: the signal is there at the time that is said, whoever else is in the batch."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.crossing import UP
from vid2ev.kernels.ladder import END, REACHED
from vid2ev.kernels.lanes import BASE, C1, C2, DRIFT, F0, F1, RISE, S0, S1, Y0, A
from vid2ev.kernels.roots import batch_times, finish, gather_jobs, lane_times, to_signals
from vid2ev.kernels.work import Work, new_work
from vid2ev.physics.log_curve import Curve
from vid2ev.physics.photoreceptor import response_terms
from vid2ev.sensors.compiled import flags_of, numbers_of
from vid2ev.sensors.presets import load_sensor

LANES = 500
SENSORS = {
    "two poles": (),
    "one pole": ("follower_tau_us=0",),
    "none": ("photoreceptor_tau_us=0", "follower_tau_us=0"),
    "after the log": ("filter=after",),
    "a knee": ("log_curve=toe",),
    "a leak": ("leak_rate_hz=1",),
    "a leak and a knee": ("leak_rate_hz=1", "log_curve=v2e"),
}


@compiled
def batched(work, size, count, lanes, b, flags, num):
    """Times of crossings at `levels` of the lanes `who`, in batches of this size."""
    for k in range(0, count, size):
        some, levels, when, who = min(size, count - k), work.levels[k:], work.when[k:], work.who[k:]
        batch_times(levels, when, work.steps, work.jobs, work.guesses, who, some, lanes, b, flags, num)


@compiled
def in_place(work, alive, count, lanes, b, flags, num):
    """Times of one crossing of each lane that is reached, in the place of the lane."""
    lane_times(work.levels, work.when, work.steps, work.guesses, work.live, alive, count, lanes, b, flags, num)


@compiled
def searched(work, count, lanes, b, flags, num):
    """The same of those that vector code has not settled."""
    to_signals(work.levels, count, flags, num)
    gather_jobs(work.jobs, work.who, count, lanes, flags)
    for k in range(count):
        middle = 0.5 * (lanes[S0 + work.who[k]] + lanes[S1 + work.who[k]])
        work.when[k] = finish(work.levels, work.jobs, middle, k, b, flags.poles, flags.drift, num, 0)


def loaded(rng: np.random.Generator, poles: int, drifts: bool, log_input: bool, b: float, curve: Curve) -> Work:
    """A work with lanes on a piece in which they go one way, and a level of each that is reached in it."""
    work, j = new_work(), 0
    while j < LANES:
        a = 10 ** rng.uniform(-2, 3)
        light = rng.normal() if log_input else 10 ** rng.uniform(-3, 0.5)
        rise = light * rng.uniform(-0.9, 2) * (rng.random() < 0.7)
        e1, e2 = light * rng.uniform(-0.8, 0.8, 2) * 10 ** rng.uniform(-6, 0)
        c1, c2 = response_terms(rise, e1, e2, a, b, poles == 2) if poles else (0.0, 0.0)
        base, drift = (rng.normal(), 10 ** rng.uniform(-4, 1)) if drifts else (0.0, 0.0)
        terms = light - (0.0, e1, e2)[poles], rise, c1, c2, a
        s = np.unique(np.concatenate([np.linspace(0, 1, 400), np.geomspace(1e-6, 1, 400)]))
        y, seen = heights(terms, s, b, base, drift, log_input, curve)
        ways = np.flatnonzero(np.diff(np.sign(np.diff(seen)))) + 1  # turning points
        cuts = np.array([0, *ways, s.size - 1])
        k = rng.integers(len(cuts) - 1)
        first, last = cuts[k] + (k > 0), cuts[k + 1] - (k < len(cuts) - 2)
        if (y.min() < 0 and not log_input) or last - first < 5 or abs(seen[last] - seen[first]) < 1e-4:
            continue
        met = s[first] + (s[last] - s[first]) * rng.random()
        for plane, value in zip((Y0, RISE, C1, C2, A), terms, strict=True):
            work.lanes[plane + j] = value
        piece = (S0, s[first]), (F0, y[first]), (S1, s[last]), (F1, y[last]), (END, seen[last])
        for plane, value in (*piece, (BASE, base), (DRIFT, drift), (UP, seen[last] > seen[first])):
            work.lanes[plane + j] = value
        work.levels[j] = heights(terms, met, b, base, drift, log_input, curve)[1]
        j += 1
    return work


def heights(terms, s, b: float, base: float, drift: float, log_input: bool, curve: Curve):
    """The response of these terms at s, and the signal [nat]."""
    y0, rise, c1, c2, a = terms
    y = y0 + rise * s + c1 * np.expm1(-a * s) + c2 * np.expm1(-b * s)
    logs = np.log(np.maximum(y, curve.knee) + curve.dark) if not log_input else y
    nats = np.where(y < curve.knee, y * curve.slope + curve.black, logs) if not log_input else y
    return y, nats + base + drift * s


@pytest.mark.parametrize("settings", SENSORS.values(), ids=SENSORS.keys())
def test_a_signal_is_at_its_level_at_the_time_that_is_said(settings):
    spec = load_sensor("paper", settings)
    flags, num = flags_of(spec, False), numbers_of(spec, 1, 0)
    rng, poles, log_input = np.random.default_rng(3), len(flags.poles), len(flags.log_input) > 0
    for b in (1e-2, 0.7, 4.0, 200.0) if poles == 2 else (0.0,):
        work = loaded(rng, poles, len(flags.drift) > 0, log_input, b, num.curve)
        lanes, levels = work.lanes, work.levels[:LANES].copy()

        def missed(when, lanes=lanes, levels=levels, b=b):
            planes = [lanes[plane : plane + LANES] for plane in (Y0, RISE, C1, C2, A)]
            base, drift = lanes[BASE : BASE + LANES], lanes[DRIFT : DRIFT + LANES]
            return np.abs(heights(planes, when, b, base, drift, log_input, num.curve)[1] - levels)

        who, times = rng.permutation(LANES), {}
        for size in (LANES, 7, 1):
            work.who[:LANES], work.levels[:LANES] = who, levels[who]
            batched(work, size, LANES, lanes, b, flags, num)
            times[size] = work.when[np.argsort(who)]
        when = times[LANES]
        assert ((when >= lanes[S0 : S0 + LANES]) & (when <= lanes[S1 : S1 + LANES])).all()
        assert missed(when).max() < 3e-9
        assert np.array_equal(times[7], when) and np.array_equal(times[1], when)
        lanes[REACHED : REACHED + LANES] = rng.random(LANES) < 0.8
        reached = np.flatnonzero(lanes[REACHED : REACHED + LANES])
        work.live[: len(reached)], work.levels[:LANES] = reached, levels
        in_place(work, len(reached), LANES, lanes, b, flags, num)
        assert np.array_equal(work.when[: len(reached)], when[reached])
        work.who[:LANES], work.levels[:LANES] = who, levels[who]
        searched(work, LANES, lanes, b, flags, num)
        assert missed(work.when[np.argsort(who)]).max() < 3e-9
        ups = np.where(lanes[UP : UP + LANES] > 0, 1e-9, -1e-9)  # the end that levels go by may be rounded
        work.who[:LANES], work.levels[:LANES] = np.arange(LANES), lanes[END : END + LANES] + ups
        batched(work, LANES, LANES, lanes, b, flags, num)
        assert np.array_equal(work.when[:LANES], lanes[S1 : S1 + LANES])
