"""Rates are what they are called, and do not depend on how densely the light is sampled.

Bounds are five standard errors of the law's own statistics: the draws are fixed by the seed, so a test passes
always or never, and a right sensor fails one in a million choices of the seed.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from against.clips import feed, hold, noisy, per_pixel, play, start, uneven

from vid2ev.physics.log_curve import curve_of
from vid2ev.stream import Events

pytestmark = pytest.mark.long

SHAPE = (64, 64)
PIXELS = SHAPE[0] * SHAPE[1]
SLOW_NS, FAST_NS = 10_000_000, 100_000  # 100 Hz and 10 kHz frames


def at_rest(spec, light, seconds: float, every_ns: int, shape=SHAPE, **options) -> Events:
    """Events of a static scene, frames `every_ns` apart."""
    t_ns = np.arange(0, round(seconds * 1e9) + 1, every_ns)
    return play(spec, *hold(light, t_ns, shape), **options)


def same_within_1_us(a: Events, b: Events) -> None:
    """The same events of each pixel, in the same order, each within 1 us."""
    width = max(int(a.x.max()), int(b.x.max())) + 1
    keys = [np.argsort(sent.y.astype(np.int64) * width + sent.x, kind="stable") for sent in (a, b)]
    a, b = a.select(keys[0]), b.select(keys[1])
    assert len(a) == len(b)
    assert np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y) and np.array_equal(a.p, b.p)
    assert np.abs(a.t - b.t).max() <= 1


def poisson(count: int, expected: float) -> None:
    assert abs(count - expected) < 5 * math.sqrt(expected), f"{count} events, expected {expected}"


# Leak


@pytest.mark.parametrize("every_ns", [SLOW_NS, FAST_NS, 1_000_000_000])
def test_leak_rate(every_ns):
    """A pixel at rest sends ON events `1/leak_rate_hz` apart; the random phase makes the mean exact."""
    sent = at_rest(noisy(leak_rate_hz=7.3, random_phase=True), 0.4, 1, every_ns)
    assert (sent.p == 1).all()
    assert abs(len(sent) - 7.3 * PIXELS) < 5 * math.sqrt(PIXELS / 4)
    mine = (sent.x == 5) & (sent.y == 5)
    assert np.diff(sent.t[mine]) == pytest.approx(1e6 / 7.3, abs=1.1)


def test_leak_does_not_depend_on_the_sampling_nor_on_the_light():
    spec = noisy(leak_rate_hz=7.3, random_phase=True)
    slow = at_rest(spec, 0.4, 1, SLOW_NS)
    same_within_1_us(slow, at_rest(spec, 0.4, 1, FAST_NS))
    same_within_1_us(slow, at_rest(spec, 0.003, 1, SLOW_NS))


def test_leak_over_hours_does_not_drift():
    """0.1 Hz for 5 h in frames of 1 min: 1800 events per pixel, the last at its microsecond."""
    sent = at_rest(noisy(leak_rate_hz=0.1, threshold_on=0.2), 0.4, 18_001, 60_000_000_000, (1, 2))
    times = sent.t[sent.x == 0]
    assert len(times) == 1800
    assert np.abs(times - np.arange(1, 1801) * 10_000_000).max() <= 1 + 2e-6 / (0.1 * 0.2 * 1e-6)


@pytest.mark.parametrize("log_curve", ["toe", "v2e"])
def test_leak_adds_to_what_the_comparator_sees_below_the_knee(log_curve):
    """The light rises along a line, and so do the level of a linear curve and the leak: a threshold every 20 ms."""
    curve = curve_of(log_curve, 1e-3)
    spec = noisy(threshold_on=0.2, leak_rate_hz=40, log_curve=log_curve)
    dvs, slope = start(spec, np.empty((1, 1))), 0.2 * 10 / curve.slope  # 10 thresholds a second
    sent = [dvs.step(np.full((1, 1), 0.001 + slope * 0.03 * k), 30_000_000 * k) for k in range(10)]
    t_us = np.concatenate([events.t for events in sent])
    np.testing.assert_allclose(t_us, 20_000 * np.arange(1, 14), atol=2)


# Shot noise


@pytest.mark.parametrize(("light", "share"), [(0.0, 1.0), (0.5, 0.625), (1.0, 0.25), (40.0, 0.25)])
@pytest.mark.parametrize("every_ns", [SLOW_NS, FAST_NS])
def test_shot_rate_falls_with_light(light, share, every_ns):
    """`shot_rate_hz` in the dark, a quarter at white and beyond, linear between; ON and OFF half each."""
    sent = at_rest(noisy(shot_rate_hz=40), light, 0.5, every_ns)
    expected = 40 * share * 0.5 * PIXELS
    poisson(len(sent), expected)
    assert abs(np.count_nonzero(sent.p) - len(sent) / 2) < 2.5 * math.sqrt(len(sent))


def test_shot_events_of_a_static_scene_do_not_depend_on_the_sampling():
    spec = noisy(shot_rate_hz=40)
    slow = at_rest(spec, 0.3, 0.5, SLOW_NS)
    for every_ns in (FAST_NS, 312_500, 1_000_000, 250_000_000):
        same_within_1_us(slow, at_rest(spec, 0.3, 0.5, every_ns))


def test_shot_events_are_a_poisson_process():
    """Counts per pixel have the variance of Poisson, waits are exponential, no instant is preferred."""
    sent = at_rest(noisy(shot_rate_hz=50), 0.0, 1, SLOW_NS)
    counts = per_pixel(sent, SHAPE)
    assert counts.var() / 50 == pytest.approx(1, abs=5 * math.sqrt(2 / PIXELS))
    at = sent.y.astype(np.int64) * SHAPE[1] + sent.x
    order = np.argsort(at, kind="stable")
    wait = np.diff(sent.t[order])[np.diff(at[order]) == 0] / 20_000
    # Pairs of neighbours within the second: R (1 - e^-q) of them, less those that its end cuts off.
    for q in (0.1, 0.5, 1.0):
        seen = np.count_nonzero(wait < q)
        expected = PIXELS * (50 * -math.expm1(-q) - (1 - (1 + q) * math.exp(-q)))
        poisson(seen, expected)
    for period_us in (1000, 10_000):
        phase = np.bincount(sent.t % period_us * 10 // period_us, minlength=10)
        assert (np.abs(phase - len(sent) / 10) < 5 * math.sqrt(len(sent) / 10)).all()


def test_shot_noise_follows_light_that_changes_within_an_interval():
    """Light from 0 to 1 in one interval of 1 s: the rate falls along it, from 40 Hz to 10 Hz."""
    light = np.stack([np.zeros(SHAPE), np.ones(SHAPE)]).astype(np.float32)
    spec = noisy(shot_rate_hz=40, threshold_on=90, threshold_off=90)
    sent = play(spec, [0, 1_000_000_000], light)
    for k in range(4):
        share = np.count_nonzero((sent.t > k * 250_000) & (sent.t <= (k + 1) * 250_000))
        poisson(share, 40 * PIXELS / 4 * (1 - 0.75 * (k + 0.5) / 4))


# Hot and cold pixels


@pytest.mark.parametrize("every_ns", [SLOW_NS, FAST_NS])
def test_hot_pixels(every_ns):
    spec = noisy(hot_probability=0.05, hot_rate_hz=200)
    sent = at_rest(spec, 0.3, 0.5, every_ns)
    counts = per_pixel(sent, SHAPE)
    hot = np.count_nonzero(counts)
    assert abs(hot - 0.05 * PIXELS) < 5 * math.sqrt(0.05 * 0.95 * PIXELS)
    poisson(len(sent), 200 * 0.5 * hot)
    assert (sent.p == 1).all()
    assert counts[counts > 0].var() / 100 == pytest.approx(1, abs=5 * math.sqrt(2 / hot))


def test_hot_events_do_not_depend_on_the_sampling_nor_on_the_light():
    spec = noisy(hot_probability=0.05, hot_rate_hz=200)
    slow = at_rest(spec, 0.3, 0.5, SLOW_NS)
    same_within_1_us(slow, at_rest(spec, 0.3, 0.5, FAST_NS))
    same_within_1_us(slow, at_rest(spec, 0.0, 0.5, 1_000_000))


def test_cold_pixels_never_fire():
    light = np.stack([np.full(SHAPE, level, np.float32) for level in (0.01, 3, 0.01, 3)])
    sent = play(noisy(cold_probability=0.05, shot_rate_hz=1000, leak_rate_hz=50), np.arange(4) * 50_000_000, light)
    cold = np.count_nonzero(per_pixel(sent, SHAPE) == 0)
    assert abs(cold - 0.05 * PIXELS) < 5 * math.sqrt(0.05 * 0.95 * PIXELS)


# Thresholds: mismatch, random phase, crossing noise


def log_ramp(nats: float, seconds: float, every_ns: int, shape=SHAPE) -> tuple[np.ndarray, np.ndarray]:
    """Light whose log rises evenly by `nats`, around light 1 (dark_level is to be tiny)."""
    t_ns = np.arange(0, round(seconds * 1e9) + 1, every_ns)
    level = np.exp(nats * (t_ns / t_ns[-1] - 0.5)).astype(np.float32)
    return t_ns, np.broadcast_to(level[:, None, None], (len(t_ns), *shape))


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("every_ns", [SLOW_NS, FAST_NS])
def test_mismatch_is_the_spread_of_the_thresholds(way, every_ns):
    """The threshold of each pixel, from the time of its last crossing on a ramp of 20 nat."""
    spec = uneven(threshold_on=0.2, threshold_off=0.2, mismatch=0.03)
    t_ns, light = log_ramp(20, 0.2, every_ns, (64, 64))
    sent = play(spec, t_ns, light[::way])
    assert (sent.p == (way > 0)).all()
    counts = per_pixel(sent, SHAPE)
    last = np.zeros(SHAPE)
    np.maximum.at(last, (sent.y, sent.x), sent.t)
    threshold = last / 0.2e6 * 20 / counts
    assert threshold.mean() == pytest.approx(0.2, abs=5 * 0.03 / math.sqrt(PIXELS))
    assert threshold.std() == pytest.approx(0.03, rel=5 / math.sqrt(2 * PIXELS) + 0.002)
    # Frozen: the crossings of a pixel are evenly spaced.
    mine = (sent.x == 3) & (sent.y == 7)
    assert np.diff(sent.t[mine]) == pytest.approx(threshold[7, 3] * 1e4, abs=2)


@pytest.mark.parametrize("phase_on", [False, True])
def test_random_phase_is_uniform(phase_on):
    """On a ramp the first crossing comes anywhere within the first threshold, or for all at its end."""
    spec = uneven(threshold_on=0.2, random_phase=phase_on)
    t_ns, light = log_ramp(0.41, 0.41, 10_000_000)
    sent = play(spec, t_ns, light)
    first = np.full(SHAPE, 10**9)
    np.minimum.at(first, (sent.y, sent.x), sent.t)
    if not phase_on:
        assert np.abs(first - 200_000).max() <= 3
        return
    share = np.sort(first.ravel()) / 200_000
    assert share[-1] <= 1 + 2e-5
    assert np.abs(share - (np.arange(PIXELS) + 0.5) / PIXELS).max() < 2.2 / math.sqrt(PIXELS)  # Kolmogorov, 1e-4


def test_crossing_noise_is_fresh_at_every_crossing():
    """Steps between the crossings of a ramp: mean the threshold, spread the noise, no memory."""
    spec = uneven(threshold_on=0.2, crossing_noise=0.04)
    sent = play(spec, *log_ramp(10, 1, 50_000_000))
    at = sent.y.astype(np.int64) * SHAPE[1] + sent.x
    order = np.argsort(at, kind="stable")
    keep = np.diff(at[order], prepend=-1) != 0
    step = np.diff(sent.t[order], prepend=0)
    step[keep] = sent.t[order][keep]
    step = step * 1e-5  # nat
    rank = np.arange(len(step)) - np.maximum.accumulate(np.where(keep, np.arange(len(step)), 0))
    early = step[rank < 40].reshape(PIXELS, 40)  # by then no pixel has come to the ramp's end
    assert early.mean() == pytest.approx(0.2, abs=5 * 0.04 / math.sqrt(early.size))
    assert early.std() == pytest.approx(0.04, rel=5 / math.sqrt(2 * early.size) + 1e-3)
    centred = early - 0.2
    for lag in (1, 2, 3):
        memory = (centred[:, lag:] * centred[:, :-lag]).mean() / 0.04**2
        assert abs(memory) < 5 / math.sqrt(early.size)
    kurtosis = (centred**4).mean() / 0.04**4
    assert kurtosis == pytest.approx(3, abs=5 * math.sqrt(24 / early.size) + 0.02)


def test_crossing_noise_does_not_depend_on_the_sampling():
    """The same ramp at 100 Hz and at 10 kHz: the same events, to 1 us and the float32 rounding of the light."""
    spec = uneven(threshold_on=0.2, crossing_noise=0.04, random_phase=True)
    slow = play(spec, *log_ramp(10, 1, SLOW_NS, (16, 16)))
    fast = play(spec, *log_ramp(10, 1, FAST_NS, (16, 16)))
    same_within_1_us(slow, fast)


def test_crossing_noise_makes_no_events_at_rest():
    assert len(at_rest(uneven(crossing_noise=0.2, random_phase=True), 0.3, 1, SLOW_NS)) == 0


# All together


def test_rates_add_up_with_everything_on():
    """Leak, shot and hot events together, at both samplings: each keeps its rate."""
    totals = []
    for every_ns in (SLOW_NS, FAST_NS):
        spec = noisy(leak_rate_hz=5, shot_rate_hz=20, hot_probability=0.02, hot_rate_hz=300, random_phase=True)
        dvs = start(spec, np.empty(SHAPE), labels=True)
        t_ns, light = hold(0.2, np.arange(0, 500_000_001, every_ns), SHAPE)
        sent = feed(dvs, t_ns, light)
        totals.append(np.bincount(sent.label, minlength=4))
    assert totals[0][0] == totals[1][0]
    assert totals[0][3] == totals[1][3]
    poisson(totals[0][1], 20 * 0.85 * 0.5 * PIXELS * 0.98)
    assert totals[1][1] == pytest.approx(totals[0][1], rel=1e-3)
    assert totals[1][2] == pytest.approx(totals[0][2], rel=1e-3)


@pytest.mark.parametrize("rate_hz", [1e-100, 1e-20, 1e-16, 1e-12])
def test_a_rate_of_next_to_nothing_is_none(rate_hz):
    """However far off its next event is."""
    quiet = noisy(random_phase=True, hot_probability=0.5)
    faint = noisy(
        random_phase=True, leak_rate_hz=rate_hz, shot_rate_hz=rate_hz, hot_probability=0.5, hot_rate_hz=rate_hz
    )
    t_ns = np.arange(0, 50_000_001, 10_000_000)
    frames = np.random.default_rng(4).random((len(t_ns), *SHAPE)).astype(np.float32) + 0.1
    same_within_1_us(play(quiet, t_ns, frames), play(faint, t_ns, frames))
