"""Leak behind a low-pass of light, of pixels that are blind after an event: one after the other, by a search on a grid.

The search knows the filter's response and nothing of the walk: what is seen is the log of it, and what the leak adds.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from against.clips import feed, sensor, start
from against.reference import Pixel, Response, log_light

PIXELS, FRAMES, GRID = 16, 9, 1001
TAUS_US, THRESHOLD, GAP_US = (300.0, 100.0), 0.1, 1000
ROUNDING_NAT = 3e-6
LEAKS_HZ = [53.0, 4700.0]  # in a gap 0.005 nats, less than what light does, and 0.5
BLIND_US = [80.0, 1000.0, 2500.0]  # to the very end of a gap, and beyond others


def clip() -> np.ndarray:
    """Light [FRAMES, PIXELS] that wanders, with black and with flashes."""
    rng = np.random.default_rng(7)
    light = np.exp(np.cumsum(rng.normal(0, 0.6, (FRAMES, PIXELS)), axis=0)) * 10 ** rng.uniform(-3, 0, PIXELS)
    light[3:5, :4], light[2, 4:8], light[:, 8] = 0.0, 1e4, 0.3
    return light.astype(np.float32)


def signal_of(pixel: Pixel, light: np.ndarray, leak_nat_per_us: float) -> Callable[[np.ndarray], np.ndarray]:
    """What the comparator sees [nat] at some instants [us]."""
    parts, y1, y2 = [], float(light[0]), float(light[0])
    for u0, u1 in zip(light[:-1].astype(np.float64), light[1:].astype(np.float64), strict=True):
        parts.append(Response(u0, u1, float(GAP_US), y1, y2, *TAUS_US))
        y1, y2 = float(parts[-1].first(GAP_US)), float(parts[-1].value(GAP_US))

    def seen(t_us: np.ndarray) -> np.ndarray:
        t_us = np.atleast_1d(t_us)
        part = np.clip(np.ceil(t_us / GAP_US).astype(int) - 1, 0, len(parts) - 1)
        lit = np.empty(len(t_us))
        for k in np.unique(part):
            here = part == k
            lit[here] = parts[k].value(t_us[here] - k * GAP_US)
        return log_light(pixel, np.maximum(lit, 0.0)) + leak_nat_per_us * t_us

    return seen


def expected(seen: Callable, blind_us: float, track: bool) -> list[tuple[float, int, float]]:
    """(time [us], polarity, doubt [us]) of the events."""
    end = (FRAMES - 1) * GAP_US
    grid = np.unique(np.concatenate([np.linspace(0, end, GRID * (FRAMES - 1)), np.geomspace(1e-6, end, GRID)]))
    heights, found, now, doubt_nat = seen(grid), [], 0.0, 0.0
    memory, ready = float(seen(0.0)[0]), -1.0
    while True:
        ahead = grid > now
        times, signal = grid[ahead], heights[ahead]
        hit = np.flatnonzero((signal >= memory + THRESHOLD) | (signal <= memory - THRESHOLD))
        if hit.size == 0:
            return found
        up = bool(signal[hit[0]] > memory)
        level = memory + (THRESHOLD if up else -THRESHOLD)
        early, late = times[hit[0] - 1] if hit[0] > 0 else now, times[hit[0]]
        for _ in range(40):
            middle = 0.5 * (early + late)
            above = (seen(middle)[0] >= level) == up
            early, late = (early, middle) if above else (middle, late)
        slope = abs(seen(late + 0.01)[0] - seen(max(late - 0.01, 0.0))[0]) / 0.02
        memory, now, doubt_us = level, late, (ROUNDING_NAT + doubt_nat) / max(slope, 1e-12)
        if late < ready:
            continue
        found.append((late, int(up), doubt_us))
        ready = np.floor(1000.0 * late) / 1000.0 + blind_us  # (a state has the last event in whole nanoseconds)
        if track:
            if ready >= end:
                return found
            now, memory = ready, float(seen(ready)[0])
            doubt_nat = abs(seen(ready + 0.01)[0] - memory) / 0.01 * (doubt_us + 0.001)


@pytest.mark.parametrize("log_curve", ["offset", pytest.param("toe", marks=pytest.mark.long)])
@pytest.mark.parametrize("leak_hz", LEAKS_HZ)
@pytest.mark.parametrize("blind_us", BLIND_US)
@pytest.mark.parametrize("refractory", ["track", pytest.param("quantised", marks=pytest.mark.long)])
def test_every_event_comes_when_it_is_due(refractory, blind_us, leak_hz, log_curve):
    light, pixel = clip(), Pixel(THRESHOLD, THRESHOLD, *TAUS_US, log_curve=log_curve)
    spec = sensor(pixel, leak_rate_hz=leak_hz, refractory_us=blind_us, refractory=refractory)
    dvs = start(spec, light[:, None, :])
    sent, total = feed(dvs, [k * GAP_US * 1000 for k in range(FRAMES)], light[:, None, :]), 0
    for i in range(PIXELS):
        seen = signal_of(pixel, light[:, i], leak_hz * THRESHOLD * 1e-6)
        due, mine = expected(seen, blind_us, refractory == "track"), sent.select(sent.x == i)
        assert mine.p.tolist() == [up for _, up, _ in due], i
        late = np.abs(mine.t - np.array([t_us for t_us, _, _ in due]))
        assert (late <= 1.0 + np.array([doubt for _, _, doubt in due])).all(), (i, late.max())
        total += len(due)
    assert total > 20


def test_a_blind_time_that_ends_with_a_frame_to_the_nanosecond_ends_as_one_before_it():
    """The memory jumps to the signal there, and what comes later is what comes of that."""
    light, t_ns = clip()[:, None, 9:10], [k * GAP_US * 1000 for k in range(FRAMES)]
    pixel, sent = Pixel(THRESHOLD, THRESHOLD, *TAUS_US), []

    def seeing(blind_ns: int) -> tuple:
        blind = {"refractory_us": blind_ns / 1000, "refractory": "track", "leak_rate_hz": LEAKS_HZ[0]}
        dvs = start(sensor(pixel, **blind), light)
        return feed(dvs, t_ns, light), dvs

    _, dvs = seeing(10**9)  # (one event)
    last_ns = int(dvs.state()["t_last"][0])
    for shorter_ns in (0, 1):
        sent.append(seeing(t_ns[4] - last_ns - shorter_ns)[0])
    assert 0 < last_ns < t_ns[4] and len(sent[0]) > 1
    assert sent[0].p.tolist() == sent[1].p.tolist()
    np.testing.assert_allclose(sent[0].t, sent[1].t, atol=1.0)


def test_work_is_bounded_whatever_the_contrast():
    """Of a flash of 33 decades with a threshold of 1e-4 and a blind time of 1 ns, what is beyond `max_crossings` of an
    interval is one crossing, which takes the memory to the signal."""
    light = np.array([0, 1e30, 1e30], np.float32)[:, None, None] * np.ones((1, 1, 3), np.float32)
    blind, pixel = {"refractory_us": 0.001, "refractory": "track"}, Pixel(1e-4, 1e-4, *TAUS_US)
    dvs = start(sensor(pixel, leak_rate_hz=LEAKS_HZ[0], **blind), light)
    sent = feed(dvs, [0, 1_000_000, 2_000_000], light)
    assert dvs.counts["capped"] == 3 * 2 and len(sent) == 3 * 2 * (dvs.spec.max_crossings + 1)
    end = signal_of(pixel, light[:, 0, 0], LEAKS_HZ[0] * 1e-4 * 1e-6)(np.array([2000.0]))
    np.testing.assert_allclose(dvs.state()["memory"], end[0], atol=1e-4)
