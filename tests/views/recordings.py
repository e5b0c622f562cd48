"""Recordings to cut and to show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events

SIZE = (20, 14)


def events_at(t: Sequence[int] | np.ndarray, size: tuple[int, int] = SIZE, seed: int = 0) -> Events:
    """Events at these times, anywhere."""
    random = np.random.default_rng(seed)
    t = np.asarray(t, np.int64)
    x, y = (random.integers(0, side, len(t)).astype(np.uint16) for side in size)
    return Events(t, x, y, random.integers(0, 2, len(t)).astype(np.uint8))


def recording_of(
    events: Events,
    start_us: int = 0,
    stop_us: int | None = None,
    size: tuple[int, int] = SIZE,
    block: int = 7,
    frame_us: Sequence[int] | None = None,
) -> Recording:
    """A recording whose events come in blocks, some of them empty."""
    last_us = int(events.t[-1]) if len(events) else start_us

    def blocks() -> Iterator[Events]:
        for at in range(0, len(events), block):
            yield events.select(np.arange(at, min(at + block, len(events))))
            yield Events.empty()

    instants = None if frame_us is None else np.array(frame_us, np.int64)
    duration_us = (last_us if stop_us is None else stop_us) - start_us
    return Recording(size, start_us, duration_us, len(events), blocks, frame_us=instants)
