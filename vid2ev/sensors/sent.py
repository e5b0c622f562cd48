"""What a walk has sent in some frames: keys of events, to be put in order or to be taken as they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vid2ev.kernels.layout import Interval
from vid2ev.kernels.order import order_keys, unpack, unpack_frames
from vid2ev.stream.events import Events

Each = Callable[[Callable[[int], None]], Any]

WORTH_THREADS = 1 << 15  # events that take longer to put in order than threads take to wake


class Keys(NamedTuple):
    """Keys of events of some pixels (`kernels.crossing`), group after group of them, each frame after frame."""

    keys: np.ndarray  # uint64; there may be more, which mean nothing
    ends: np.ndarray  # int64 [groups, frames], how many there are after each frame of each group

    def runs(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """Where those of a frame begin and end in each group."""
        begins = self.ends.ravel()[frame - 1 :: self.ends.shape[1]] if frame else np.append(0, self.ends[:-1, -1])
        return begins[: len(self.ends)].copy(), self.ends[:, frame].copy()


@dataclass(frozen=True)
class Sent:
    """What is sent in some frames, in parts of pixels; keys of one pixel are in order of time."""

    parts: list[Keys]
    intervals: list[Interval]
    width: int
    labels: bool

    def ordered(self, each: Each) -> list[Events]:
        """The events of each frame; `each` does a work for all numbers of parts, at the same time: frame beside frame,
        or, where there are too few for that, each frame by all."""
        count, frames = len(self.parts), len(self.intervals)
        counts = sum(np.diff(part.ends.ravel(), prepend=0).reshape(part.ends.shape).sum(axis=0) for part in self.parts)
        most = int(np.max(counts))
        if frames < count or np.sum(counts) <= WORTH_THREADS:
            keys = np.empty(most, np.uint64)
            return [self._ordered(k, keys, each if counts[k] > WORTH_THREADS else self._alone) for k in range(frames)]
        made, waiting = [Events.empty()] * frames, iter(range(frames))

        def some(_: int) -> None:
            keys = np.empty(most, np.uint64)
            for k in waiting:  # (of all: each takes one that none has taken)
                made[k] = self._ordered(k, keys, self._alone)

        each(some)
        return made

    def _alone(self, work: Callable[[int], None]) -> None:
        """`each`, one after the other."""
        for k in range(len(self.parts)):
            work(k)

    def _ordered(self, frame: int, keys: np.ndarray, work: Each) -> Events:
        """The events of a frame, for which there is room in `keys`."""
        runs = [part.runs(frame) for part in self.parts]
        ends = np.cumsum([0, *(int((stops - begins).sum()) for begins, stops in runs)])
        n, count, interval = int(ends[-1]), len(runs), self.intervals[frame]
        if n == 0:
            return Events.empty(self.labels)
        t, x, y, p, label = self._room(n)
        work(lambda k: order_keys(self.parts[k].keys, *runs[k], interval.last_us, keys[ends[k] : ends[k + 1]]))
        work(lambda k: unpack(keys, ends, k, count, self.width, interval.first_us, t, x, y, p, label))
        return Events(t, x, y, p, label if self.labels else None)

    def unordered(self) -> Iterator[Events]:
        """The events of all frames, part by part; in order of time are those of a pixel alone."""
        first_us = np.array([interval.first_us for interval in self.intervals], np.int64)
        for keys, ends in self.parts:
            t, x, y, p, label = self._room(int(ends[-1, -1]))
            since_us = np.tile(first_us, len(ends))
            unpack_frames(keys[: len(t)], ends.ravel(), since_us, self.width, t, x, y, p, label)
            yield Events(t, x, y, p, label if self.labels else None)

    def _room(self, n: int) -> tuple[np.ndarray, ...]:
        u16, u8 = np.uint16, np.uint8
        return np.empty(n, np.int64), np.empty(n, u16), np.empty(n, u16), np.empty(n, u8), np.empty(n * self.labels, u8)
