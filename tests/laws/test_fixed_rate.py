"""Fixed-rate mode: event frames at 1e6 k / rate us, rounded, at most one event per pixel and event frame."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from against.clips import clean, feed, noisy, play, start

from vid2ev.physics.fixed_rate import EventFrames, FixedRate
from vid2ev.physics.shutter import opening_ns
from vid2ev.sensors.dvs import DvsSpec
from vid2ev.stream import Events

SHAPE = (12, 17)
START_NS = 5_000_123_999


def clip() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    t_ns = START_NS + np.concatenate([[0], np.cumsum(rng.integers(300_000, 9_000_000, 50))])
    return t_ns, 10 ** rng.uniform(-2.5, 0.5, (51, *SHAPE)).astype(np.float32)


def frame_times(rate_hz: float, until_us: int) -> np.ndarray:
    return START_NS // 1000 + np.array([exact_us(k, rate_hz) for k in range(int(until_us * rate_hz * 1e-6) + 3)])


def exact_us(k: int, rate_hz: float) -> int:
    """The microsecond nearest to tick k of the rate as it is written, the later of two that are equally near."""
    return math.floor(k * 10**6 / Fraction(repr(float(rate_hz))) + Fraction(1, 2))


roundings = pytest.mark.parametrize("rounding", ["nearest", "causal"])


def in_event_frames(free: Events, grid: np.ndarray, rounding: str) -> tuple[dict, set]:
    """(event frame, pixel) -> polarity of the first event there, and the keys that 1 us of rounding may change."""
    pixels = SHAPE[0] * SHAPE[1]
    after = np.searchsorted(grid, free.t)
    low, high = free.t - grid[after - 1], grid[after] - free.t
    if rounding == "nearest":
        index, border = np.where(low <= high, after - 1, after), np.abs(low - high) / 2
    else:
        index, border = after, np.minimum(low, high)
    key = index * pixels + free.y.astype(np.int64) * SHAPE[1] + free.x
    first: dict[int, int] = {}
    for k, p in zip(key.tolist(), free.p.tolist(), strict=True):
        first.setdefault(k, p)
    unsure = key[border <= 1]
    return first, set(np.concatenate([unsure - pixels, unsure, unsure + pixels]).tolist())


@pytest.mark.parametrize("rate_hz", [29.97, 30.0, 997.0, 3000.0, 100_000.0])
@roundings
def test_events_are_the_first_crossing_of_each_event_frame(rate_hz, rounding):
    """The free-running events, moved to their event frame; the first of a pixel and frame stays."""
    t_ns, light = clip()
    keys = {"photoreceptor_tau_us": 300, "follower_tau_us": 100}
    fixed = play(clean(frame_rate_hz=rate_hz, rounding=rounding, **keys), t_ns, light)
    grid = frame_times(rate_hz, int(t_ns[-1] - START_NS) // 1000)
    assert np.isin(fixed.t, grid).all()
    place = fixed.y.astype(np.int64) * SHAPE[1] + fixed.x
    assert (np.diff(fixed.t * light[0].size + place) > 0).all(), "out of order, or two of a pixel in one frame"

    want, unsure = in_event_frames(play(clean(**keys), t_ns, light), grid, rounding)
    key = np.searchsorted(grid, fixed.t) * light[0].size + place
    got = dict(zip(key.tolist(), fixed.p.tolist(), strict=True))
    assert {k: p for k, p in got.items() if k not in unsure} == {k: p for k, p in want.items() if k not in unsure}
    assert len(got.keys() - unsure) > 1_000


@pytest.mark.parametrize("rate_hz", [29.97, 1000.0, 3000.0, 400_000.0])
@roundings
def test_each_microsecond_has_its_event_frame(rate_hz, rounding):
    """The nearest one, the earlier of two that are equally near; or the next that is not before it."""
    frames = EventFrames(FixedRate(frame_rate_hz=rate_hz, rounding=rounding), 1, 1)
    frames.origin_us = START_NS // 1000
    t_us = frames.origin_us + np.arange(100_000)
    grid = frame_times(rate_hz, 100_000)
    after = np.searchsorted(grid, t_us)
    before = np.maximum(after - 1, 0)
    nearest = np.where(t_us - grid[before] <= grid[after] - t_us, before, after)
    assert np.array_equal(frames.frame_of(t_us), nearest if rounding == "nearest" else after)


# (those of many digits do not fit into products of int64)
@pytest.mark.parametrize("rate_hz", [29.97, 0.007, 999_999.9, 24 / 1.001, 30 / 1.001, 1e-9, 1e5 / 3])
@roundings
def test_event_frames_are_on_an_exact_clock_however_late(rate_hz, rounding):
    frames = EventFrames(FixedRate(frame_rate_hz=rate_hz, rounding=rounding), 1, 1)
    frames.origin_us = 0
    most = int(min(3e9, 2e6 * rate_hz * 1e6))
    k = np.unique(np.random.default_rng(1).integers(0, max(most, 2), 200))
    at_us = np.array([exact_us(each, rate_hz) for each in k.tolist()])
    assert np.array_equal(frames.instant_us(k), at_us)
    assert np.array_equal(frames.frame_of(at_us), k)
    later = np.where(rounding == "causal", k + 1, k)
    assert rate_hz > 3e5 or np.array_equal(frames.frame_of(at_us + 1), later)


@pytest.mark.parametrize("rate_hz", [400_000.0, 29.97, 6e5, 24 / 1.001])
def test_event_frames_and_exposures_go_by_one_clock(rate_hz):
    frames = EventFrames(FixedRate(frame_rate_hz=rate_hz), 1, 1)
    frames.origin_us = 0
    k = np.append(np.arange(200), 10**9 + np.arange(3000))
    apart_ns = np.array([opening_ns(each, rate_hz) for each in k.tolist()]) - 1000 * frames.instant_us(k)
    assert np.abs(apart_ns).max() <= 500


def test_halves_go_upwards():
    frames = EventFrames(FixedRate(frame_rate_hz=400_000), 1, 1)
    frames.origin_us = 0
    assert frames.instant_us(np.arange(5)).tolist() == [0, 3, 5, 8, 10]


@roundings
def test_an_event_frame_ahead_is_held_back(rounding):
    """Whatever the cut into frames of light, the stream is ordered; `flush` gives the last events once."""
    t_ns, light = clip()
    dvs = start(clean(frame_rate_hz=40, rounding=rounding), light)
    parts = []
    for k in range(len(t_ns)):
        sent = feed(dvs, t_ns[k : k + 1], light[k : k + 1])
        assert not len(sent) or sent.t.max() * 1000 <= t_ns[k]
        parts.append(sent)
    rest = dvs.flush()
    assert len(rest) > 0
    assert len(dvs.flush()) == 0
    sent = Events.concatenate([*parts, rest])
    assert (np.diff(sent.t) >= 0).all()
    assert dvs.counts["on"] + dvs.counts["off"] == len(sent)


@roundings
def test_causal_never_precedes_its_cause(rounding):
    """One crossing at 12.4 ms of a 100 Hz camera: the nearest frame is at 10 ms, the next at 20 ms."""
    t_ns = [0, 12_000_000, 13_000_000, 40_000_000]
    light = np.exp(np.array([0.0, 0.0, 0.25, 0.25])).astype(np.float32)[:, None, None]
    spec = clean(threshold_on=0.1, threshold_off=0.1, dark_level=1e-9, frame_rate_hz=100, rounding=rounding)
    assert play(spec, t_ns, light).t.tolist() == [10_000 if rounding == "nearest" else 20_000]


def test_free_running_holds_nothing_back():
    t_ns, light = clip()
    dvs = start(DvsSpec(), light)
    feed(dvs, t_ns, light)
    assert len(dvs.flush()) == 0


@pytest.mark.long
def test_a_static_scene_with_noise_still_sends_one_event_per_frame_at_most():
    """Hot pixels at 50 kHz in a 1 kHz camera: each sends in every event frame, once."""
    t_ns = np.arange(0, 100_000_001, 10_000_000)
    spec = noisy(frame_rate_hz=1000, hot_probability=1.0, hot_rate_hz=50_000)
    sent = play(spec, t_ns, np.full((len(t_ns), 3, 3), 0.2, np.float32))
    times = sent.t[(sent.x == 1) & (sent.y == 1)]
    assert (times % 1000 == 0).all() and (np.diff(times) == 1000).all()
    assert len(times) in (100, 101)
