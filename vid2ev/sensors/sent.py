"""What a walk has sent in some frames: keys of events, to be put in order or to be taken as they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from vid2ev.kernels.layout import Interval
from vid2ev.kernels.order import order_keys, unpack, unpack_frames
from vid2ev.stream.events import Events

WORTH_THREADS = 1 << 15  # events that take longer to put in order than threads take to wake


@dataclass(frozen=True)
class Sent:
    """Keys of events of some frames (`kernels.crossing`), in parts of pixels; those of a pixel are in order of time."""

    parts: list[np.ndarray]  # uint64, frame after frame
    ends: np.ndarray  # int64 [parts, frames], how many of a part there are after each frame
    intervals: list[Interval]
    width: int
    labels: bool

    def ordered(self, frame: int, each: Callable) -> Events:
        """The events of a frame; `each` does a work for all numbers of parts, at the same time."""
        begins = self.ends[:, frame - 1] if frame else np.zeros(len(self.parts), np.int64)
        parts = [part[a:b] for part, a, b in zip(self.parts, begins, self.ends[:, frame], strict=True)]
        ends = np.cumsum([0, *map(len, parts)])
        n, count, interval = int(ends[-1]), len(parts), self.intervals[frame]
        if n == 0:
            return Events.empty(self.labels)
        keys = np.empty(n, np.uint64)
        t, x, y, p, label = self._room(n)
        work = each if n > WORTH_THREADS else lambda part: [part(k) for k in range(count)]
        work(lambda k: order_keys(parts[k], interval.last_us, keys[ends[k] : ends[k + 1]]))
        work(lambda k: unpack(keys, ends, k, count, self.width, interval.first_us, t, x, y, p, label))
        return Events(t, x, y, p, label if self.labels else None)

    def unordered(self) -> Iterator[Events]:
        """The events of all frames, part by part; in order of time are those of a pixel alone."""
        first_us = np.array([interval.first_us for interval in self.intervals], np.int64)
        for keys, ends in zip(self.parts, self.ends, strict=True):
            t, x, y, p, label = self._room(len(keys))
            unpack_frames(keys, ends, first_us, self.width, t, x, y, p, label)
            yield Events(t, x, y, p, label if self.labels else None)

    def _room(self, n: int) -> tuple[np.ndarray, ...]:
        u16, u8 = np.uint16, np.uint8
        return np.empty(n, np.int64), np.empty(n, u16), np.empty(n, u16), np.empty(n, u8), np.empty(n * self.labels, u8)
