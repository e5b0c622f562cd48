"""Recordings that strain a container of events: dense, silent for long, hours long, empty."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import recordings

from vid2ev.formats.event_file import Picture, Recording
from vid2ev.stream.events import Events

SIZE = (320, 240)
EVENT_FILES = Path(__file__).parents[2] / "../shared/data/events"
START_US = 1_700_000_000_123_456
HOUR_US = 3600 * 10**6


def events_at(t: np.ndarray, seed: int = 0) -> Events:
    random = np.random.default_rng(seed)
    t = np.asarray(t, np.int64)
    x, y = (random.integers(0, side, len(t)).astype(np.uint16) for side in SIZE)
    return Events(t, x, y, random.integers(0, 2, len(t)).astype(np.uint8))


def times_us() -> dict[str, np.ndarray]:
    """Times since the start, by what is hard about them."""
    random = np.random.default_rng(1)
    burst = np.sort(random.integers(0, 100_000, 3_000))
    return {
        "dense": np.sort(random.integers(0, 100_000, 200_000)),
        "sparse": np.concatenate([burst, 20_000_000 + burst]),
        "long": np.sort(random.integers(0, 3 * HOUR_US, 20_000)),
        "one": np.array([0]),
        "at once": np.full(40_000, 77),
        "empty": np.empty(0, np.int64),
    }


def recording_of(events: Events, start_us: int = START_US, pictures: list[Picture] | None = None) -> Recording:
    frames = None if pictures is None else lambda: iter(pictures)
    return replace(recordings.recording_of(events, SIZE, start_us), frames=frames)


def pictures_at(t: np.ndarray, *shape: int) -> list[Picture]:
    random = np.random.default_rng(2)
    return [Picture(int(at), random.integers(0, 256, shape).astype(np.uint8)) for at in t]


def assert_same_pictures(found: list[Picture], expected: list[Picture]) -> None:
    assert [picture.t_us for picture in found] == [picture.t_us for picture in expected]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.pixels, other.pixels)
