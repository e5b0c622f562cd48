"""Clocks that break simulators: late starts, tiny and huge steps, time that stands still or runs back."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import EVERYTHING, clean, feed, noisy, play, sensor, start
from against.judge import judge_clip
from against.reference import Pixel

from vid2ev.errors import UsageError
from vid2ev.sensors.dvs import DvsSpec
from vid2ev.stream import Events

HOUR_NS = 3_600_000_000_000
TRACKING = clean(photoreceptor_tau_us=300, follower_tau_us=100, filter="after", refractory_us=100, refractory="track")
orders = pytest.mark.parametrize("order", ["before", "after"])


def clip(frames: int = 20, shape=(6, 9)) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    return np.cumsum(rng.integers(100_000, 40_000_000, frames)), 10 ** rng.uniform(-2, 0.5, (frames, *shape))


@pytest.mark.parametrize("late_ns", [3 * HOUR_NS, 30 * 24 * HOUR_NS, 292 * 365 * 24 * HOUR_NS])
@pytest.mark.parametrize("spec", [DvsSpec(), clean(), pytest.param(TRACKING, marks=pytest.mark.long)])
def test_a_clip_that_starts_late_has_the_same_events_later(spec, late_ns):
    """First frame at 3 h, 30 days, 292 years (int64's end): bit for bit those of a clip at 0, shifted."""
    t_ns, light = clip()
    late_ns -= int(late_ns + t_ns[-1] > 2**63 - 1) * 1_000_000_000_000
    early, late = play(spec, t_ns, light), play(spec, t_ns + late_ns, light)
    assert len(early) > 1_000
    assert np.array_equal(early.t + late_ns // 1000, late.t)
    assert np.array_equal(early.x, late.x) and np.array_equal(early.p, late.p)


def test_a_late_start_leaks_no_more_than_an_early_one():
    t_ns = 3 * HOUR_NS + np.arange(0, 2_000_000_001, 50_000_000)
    sent = play(noisy(leak_rate_hz=4), t_ns, np.full((len(t_ns), 2, 2), 0.2))
    assert len(sent) in range(4 * 7, 4 * 8 + 1)
    assert sent.t[0] == pytest.approx(3 * HOUR_NS // 1000 + 250_000, abs=2)


def test_a_clip_before_zero():
    """Time is an int64: a clip may start before the clock's zero."""
    t_ns, light = clip()
    early, late = play(clean(), t_ns - 500_000_000_000, light), play(clean(), t_ns, light)
    assert np.array_equal(early.t + 500_000_000, late.t)


@orders
@pytest.mark.parametrize("taus", [(0.0, 0.0), (300.0, 100.0), (0.003, 0.001)])
def test_steps_of_a_nanosecond(order, taus):
    """A jump spread over 400 frames 1 ns apart, then rest: the events of the jump, in order, none lost."""
    t_ns = np.concatenate([np.arange(400), [1_000, 10_000, 5_000_000, 20_000_000]])
    level = np.concatenate([np.linspace(0.05, 0.9, 400), np.full(4, 0.9)])
    light = np.stack([level, level[::-1], np.full(404, 0.3)], axis=1)[:, None, :].astype(np.float32)
    pixel = Pixel(0.1, 0.1, *taus, filter=order)
    sent = play(sensor(pixel), t_ns, light)
    assert (np.diff(sent.t) >= 0).all()
    assert judge_clip(pixel, t_ns, light, sent).events > 40


def test_an_interval_without_a_microsecond_still_orders_its_events():
    """Frames 1 ns apart around a microsecond: whatever the rounding, time does not run back between steps, and no event
    is as early as the frame before it."""
    dvs = start(clean(threshold_on=0.01, threshold_off=0.01), np.empty((1, 1)))
    times, last = [], -(10**9)
    for k in range(3_000):
        sent = dvs.step(np.full((1, 1), 0.1 + 1e-3 * (k % 50), np.float32), 997_000_000 + k)
        assert not len(sent) or (sent.t[0] >= last and sent.t[0] * 1000 > 997_000_000 + k - 1)
        times += sent.t.tolist()
        last = times[-1] if times else last
    assert len(times) > 1_000
    assert min(times) >= 997_000 and max(times) <= 997_003


def test_no_event_is_of_the_microsecond_in_which_its_interval_begins():
    """(t0, t1], also where a crossing is nearer to t0 than to the next microsecond; an event is nowhere twice."""
    t_ns, levels = np.arange(60) * 10_000, np.where(np.arange(60) % 2, 10.0, 0.01)
    dvs = start(clean(threshold_on=0.01, threshold_off=0.01, filter="after"), np.empty((1, 1)))
    for t, level in zip(t_ns.tolist(), levels, strict=True):
        sent = dvs.step(np.full((1, 1), level, np.float32), t)
        assert t == 0 or (len(sent) > 500 and sent.t[0] * 1000 > t - 10_000 and sent.t[-1] * 1000 <= t)


@orders
@pytest.mark.parametrize("taus", [(0.0, 0.0), (300.0, 100.0), (2e9, 1e9), (1e12, 1e12)])
def test_steps_of_an_hour(order, taus):
    t_ns = np.arange(6) * HOUR_NS
    light = np.array([[0.1, 0.9], [0.5, 0.3], [0.02, 0.31], [0.9, 0.9], [0.1, 0.8], [0.7, 0.1]])
    light = light[:, None, :].astype(np.float32)
    pixel = Pixel(0.1, 0.1, *taus, filter=order)
    verdict = judge_clip(pixel, t_ns, light, play(sensor(pixel), t_ns, light))
    assert verdict.events >= (0 if max(taus) > 1e10 else 40)


def test_nanoseconds_and_hours_in_one_clip():
    rng = np.random.default_rng(3)
    t_ns = np.cumsum(np.where(rng.random(60) < 0.5, 1, rng.integers(1, HOUR_NS, 60)))
    light = rng.uniform(0.05, 1, (60, 1, 3)).astype(np.float32)
    for taus in ((300.0, 100.0), (1e6, 1e6), (0.0, 50.0)):
        pixel = Pixel(0.2, 0.2, *taus)
        assert judge_clip(pixel, t_ns, light, play(sensor(pixel), t_ns, light)).events > 300


@pytest.mark.parametrize("back_ns", [0, 1, 5_000_000, 10**18])
def test_time_that_repeats_or_runs_back_is_refused_and_changes_nothing(back_ns):
    t_ns, light = clip()
    spec = EVERYTHING
    dvs = start(spec, light)
    parts = [feed(dvs, t_ns[:10], light[:10])]
    with pytest.raises(UsageError, match="later") as refusal:
        dvs.step(light[10].astype(np.float32), int(t_ns[9]) - back_ns)
    assert str(int(t_ns[9])) in str(refusal.value)
    parts.append(feed(dvs, t_ns[10:], light[10:]))
    want = play(spec, t_ns, light)
    assert np.array_equal(Events.concatenate(parts).t, want.t)


@pytest.mark.long
def test_leak_at_a_million_frames_per_second():
    """Steps of 1 us, each 1/1000 of the time to a leak event: all 20 come, each at its microsecond."""
    t_ns = np.arange(20_500) * 1_000
    frame = np.full((1, 1), 0.4, np.float32)
    sent = play(noisy(leak_rate_hz=1000, threshold_on=0.2), t_ns, np.broadcast_to(frame, (20_500, 1, 1)))
    assert np.abs(sent.t - np.arange(1, 21) * 1000).max() <= 1


def test_a_slow_ramp_in_a_million_steps_loses_nothing():
    """0.5 nat in 30 000 steps far below float32's resolution of the level: five events, each at its time."""
    n = 30_000
    t_ns = np.arange(n + 1) * 10_000
    light = np.exp(np.linspace(-5, -4.45, n + 1))[:, None, None]
    for taus in ((0.0, 0.0), (300.0, 100.0)):
        sent = play(sensor(Pixel(0.1, 0.1, *taus, filter="after", dark_level=1e-12)), t_ns, light)
        slope = 0.55 / (n * 10)  # nat/us
        assert np.abs(sent.t - (np.arange(1, 6) * 0.1 / slope + sum(taus))).max() < 1.5 + 2e-6 / slope
