"""Frames that go through the walk together show it in nothing: events, state and counts are the same bits."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import vid2ev.sensors.sent as events_sent
from vid2ev import load_sensor
from vid2ev.kernels.layout import BLOCK
from vid2ev.sensors.dvs import AT_ONCE_PX, MOST, Dvs
from vid2ev.sensors.pixels import GROUP
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still
from vid2ev.upsample.stillness import still_strips

SIZE = (310, 217)  # more blocks than one group has, the last of which is not full
SENSORS = {
    "ideal": load_sensor("ideal"),
    "paper": load_sensor("paper"),
    "v2e-noisy": load_sensor("v2e-noisy", ["leak_rate_hz=3"]),  # (whose leak is taken into the memories now and then)
}


def frames_of(seed: int, told: bool) -> list[Frame]:
    """Light of which some rows flicker at times, one part steps, and the rest is still; with a cut.

    Of most frames it is said what is still, if `told`; of some nothing.
    """
    rng = np.random.default_rng(seed)
    lights, light = [], rng.random(SIZE[::-1]).astype(np.float32)
    for k in range(70):
        light = light.copy()
        if k % 23 > 12:
            light[:60] *= np.exp(rng.normal(0, 0.2, (60, 1))).astype(np.float32)
        elif k % 23 > 10:
            light[100:120, 50:90] *= 1.1
        lights.append(light)
    t_ns = np.cumsum(rng.integers(1, 8_000_000, len(lights)))
    stills = [
        Still(old, still_strips(old, new)) if told and rng.random() < 0.8 else None for old, new in pairwise(lights)
    ]
    return [
        Frame(light, int(t), still=still, cut=k == 41)
        for k, (light, t, still) in enumerate(zip(lights, t_ns, [None, *stills], strict=True))
    ]


def assert_same_state(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_array_equal(value, other[name], err_msg=name)


@pytest.mark.parametrize("spec", SENSORS.values(), ids=SENSORS)
@settings(max_examples=8)
@example(seed=510510, told=False, skip=False, threads=1, some=[2])  # (a crossing that took one more step for others)
@given(
    seed=st.integers(0, 2**32),
    told=st.booleans(),
    skip=st.booleans(),
    threads=st.sampled_from([1, 2]),
    some=st.lists(st.integers(1, 40), min_size=1),
)
def test_together_or_one_by_one(spec, seed, told, skip, threads, some):
    assert SIZE[0] * SIZE[1] > BLOCK * GROUP
    frames = frames_of(seed, told)
    alone, together = Dvs(spec, SIZE, seed, skip=skip), Dvs(spec, SIZE, seed, skip=skip, threads=threads)
    expected, sent = [alone.see(frame) for frame in frames], []
    while len(sent) < len(frames):
        sent += together.see_all(frames[len(sent) : len(sent) + some[len(sent) % len(some)]])
    assert sum(map(len, expected)) > 1000
    for ours, theirs in zip(sent, expected, strict=True):
        for name in "txyp":
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert_same_state(alone.state(), together.state())
    assert alone.slept == together.slept and (alone.slept[0] > 0) == skip


def test_how_many_are_best_together_depends_on_their_size():
    assert Dvs(SENSORS["ideal"], (64, 48)).at_once == MOST
    assert Dvs(SENSORS["ideal"], (AT_ONCE_PX // 1024 // 3, 1024)).at_once == 3
    assert Dvs(SENSORS["ideal"], (8192, 2048)).at_once == 1


def test_codes_and_light_do_not_go_together():
    """Each frame is taken for what it is."""
    codes, light = np.full((2, 3), 128, np.uint8), np.full((2, 3), 128 / 255, np.float32)
    dvs = Dvs(SENSORS["ideal"], (3, 2), transfer="linear")
    sent = dvs.see_all([Frame(codes, 0), Frame(light, 1000), Frame(codes, 2000), Frame(codes * 0 + 255, 3000)])
    assert [len(events) > 0 for events in sent] == [False, False, False, True]


@pytest.mark.parametrize("count", [1, 2, 3, 7])
@pytest.mark.parametrize("waking", [1, 1000, 1 << 30])
def test_more_or_fewer_frames_at_a_time_than_threads(count: int, waking: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads put events in order together, or some frames each, or one does all: according to what it takes to wake
    them."""
    monkeypatch.setattr(events_sent, "WORTH_WAKING", waking)
    monkeypatch.setattr(events_sent, "WORTH_WAKING_THRICE", 4 * waking)
    rng, t_ns = np.random.default_rng(count), [3_000_000 * k for k in range(count + 1)]
    light = np.exp(rng.normal(0, 1, (count + 1, *SIZE[::-1]))).astype(np.float32)
    if count > 1:
        light[count // 2] = light[count // 2 - 1]  # (nothing happens there)
    sensors = [Dvs(SENSORS["ideal"], SIZE, threads=threads, labels=True) for threads in (1, 2, 5)]
    for dvs in sensors:
        dvs.step(light[0], t_ns[0])
    alone, *others = (dvs.steps(light[1:], t_ns[1:]) for dvs in sensors)
    assert sum(map(len, alone)) > 100_000
    for other in others:
        for one, two in zip(alone, other, strict=True):
            for name in ("t", "x", "y", "p", "label"):
                np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)
