"""Recordings to be written and read: as they are common, and as they are not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vid2ev.formats.event_file import BLOCK, Format, Recording
from vid2ev.stream.events import Events

SECOND = 10**6
HOUR = 3600 * SECOND


def events_of(t: np.ndarray, size: tuple[int, int], seed: int = 0) -> Events:
    """Events at those times, anywhere on the sensor."""
    random = np.random.default_rng(seed)
    t = np.asarray(t, np.int64)
    x, y = (random.integers(0, side, len(t)).astype(np.uint16) for side in size)
    p, label = (random.integers(0, n, len(t)).astype(np.uint8) for n in (2, 4))
    return Events(t, x, y, p, label)


def recording_of(
    events: Events, size: tuple[int, int], start_us: int = 0, duration_us: int | None = None, block: int = BLOCK
) -> Recording:
    """All of them as a recording, in blocks."""
    last = int(events.t[-1]) - start_us if len(events) else 0

    def blocks():
        return (events.stretch(at, min(at + block, len(events))) for at in range(0, len(events), block))

    duration_us = last if duration_us is None else duration_us
    return Recording(size, start_us, duration_us, len(events), blocks, events.label is not None)


def dense() -> Recording:
    """A hundred events in a microsecond, rows full of them: what a readout at a fixed rate makes."""
    size, random = (640, 480), np.random.default_rng(1)
    t = np.repeat(np.arange(400) * 50, 250)
    y = np.sort(random.integers(0, 3, (400, 250)), axis=1).ravel() * 100 + 7
    x = random.integers(0, 640, len(t))
    order = np.lexsort((x, y, t))
    x, y = x[order].astype(np.uint16), y[order].astype(np.uint16)
    p = (random.random(len(t)) < 0.9).astype(np.uint8)
    return recording_of(Events(t, x, y, p, p), size, block=4099)


def sparse() -> Recording:
    """Twenty seconds of silence between two bursts, some before the first, a day after the start of the clock."""
    start = 24 * HOUR
    t = np.concatenate([np.arange(1000), 20 * SECOND + np.arange(0, 9000, 3)]) + 3 * SECOND + start
    return recording_of(events_of(t, (346, 260), 2), (346, 260), start, 25 * SECOND)


def long() -> Recording:
    """Six hours with few events, beyond the end of every clock: 16.8 s, 71.6 min, 4.8 h."""
    edges = np.array([1 << 24, 1 << 32, 1 << 33, 1 << 34])[:, None] + np.arange(-2, 3)
    t = np.sort(np.concatenate([[0], edges.ravel(), np.random.default_rng(3).integers(0, 6 * HOUR, 300)]))
    return recording_of(events_of(t, (100, 100), 3), (100, 100), block=50)


def empty() -> Recording:
    """Nothing happens for a second."""
    return recording_of(Events.empty(labelled=True), (320, 240), 5, SECOND)


def corner(size: tuple[int, int]) -> Recording:
    """One event, at the last pixel of the largest sensor."""
    x, y = (np.array([side - 1], np.uint16) for side in size)
    return recording_of(Events(np.array([77]), x, y, np.array([1], np.uint8), np.array([3], np.uint8)), size)


def recordings_for(kind: Format) -> dict[str, Recording]:
    """Those that a format can hold."""
    made: dict[str, Callable[[], Recording]] = {"dense": dense, "sparse": sparse, "long": long, "empty": empty}
    found = {name: make() for name, make in made.items()}
    found["corner"] = corner(kind.largest or (1 << 16, 1 << 16))
    return {name: one for name, one in found.items() if one.duration_us <= (kind.longest_us or one.duration_us)}


def all_events(recording: Recording) -> Events:
    """Those of a recording."""
    return Events.concatenate(recording.blocks())


def assert_same(one: Events, other: Events) -> None:
    """All columns and their types."""
    for name in ("t", "x", "y", "p"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
        assert getattr(one, name).dtype == getattr(other, name).dtype, name


def written(kind: Format, recording: Recording, folder: Path) -> Path:
    """A file of that format."""
    assert kind.write is not None
    path = folder / f"events{kind.suffix}"
    kind.write(path, recording)
    return path
