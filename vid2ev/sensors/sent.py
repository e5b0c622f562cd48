"""What a walk has sent in some frames: keys of events, to be put in order or to be taken as they are."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import accumulate, chain, pairwise
from operator import sub
from typing import Any, NamedTuple

import numpy as np

from vid2ev.kernels.order import (
    LAST_OF_PASS,
    count_keys,
    lay_out,
    put_keys,
    sizes_of,
    take_keys,
    unpack,
    unpack_frames,
)
from vid2ev.stream.events import Events

Each = Callable[[Callable[[int], None]], Any]

# Events that take longer to put in order than threads take to wake: once, for frames beside each other, or three times
WORTH_WAKING, WORTH_WAKING_THRICE = 1 << 16, 1 << 18
IN_CACHE = 1 << 16  # events whose keys stay in a cache between the steps of putting them in order
FEW = 4  # microseconds for each event, or more, where to count events for each microsecond takes longer than without


class Keys(NamedTuple):
    """Keys of events of some pixels (`kernels.crossing`), group after group of them, each frame after frame."""

    keys: np.ndarray  # uint64; there may be more, which mean nothing
    ends: np.ndarray  # int64 [groups, frames], how many there are after each frame of each group


@dataclass(frozen=True)
class Sent:
    """What is sent in some frames, in parts of pixels; keys of one pixel are in order of time."""

    parts: list[Keys]
    first_us: np.ndarray  # int64 [frames], from which the times of keys count
    last_us: np.ndarray  # int64 [frames], counted so, the last that a key may have
    width: int
    labels: bool

    def ordered(self, each: Each) -> list[Events]:
        """The events of each frame; `each` does a work for all numbers of parts, at the same time: runs of frames
        beside each other, or, where there are too few for that, each frame by all."""
        parts, frames = len(self.parts), len(self.first_us)
        sizes = np.zeros(frames, np.int64)
        for _, ends in self.parts:
            sizes_of(ends, sizes)
        starts = [0, *accumulate(sizes.tolist())]
        most = max(map(sub, starts[1:], starts))
        if starts[-1] <= WORTH_WAKING or (frames < parts and most <= WORTH_WAKING_THRICE):
            return self._ordered(starts, 0, frames, np.empty(starts[-1], np.uint64))
        if frames < parts:
            room = np.empty(most, np.uint64)
            alone = (self._ordered(starts, k, k + 1, room[: sizes[k]], each) for k in range(frames))
            return list(chain.from_iterable(alone))
        cuts = even_cuts(starts, parts * -(-starts[-1] // (parts * IN_CACHE)))
        made: dict[int, list[Events]] = {}
        waiting = iter(pairwise(cuts))

        def some(_: int) -> None:
            keys = np.empty(IN_CACHE + most, np.uint64)
            for first, last in waiting:  # (of all: each takes a run that none has taken)
                made[first] = self._ordered(starts, first, last, keys[: starts[last] - starts[first]])

        each(some)
        return list(chain.from_iterable(made[first] for first in cuts[:-1]))

    def _ordered(
        self, starts: list[int], first: int, last: int, keys: np.ndarray, each: Each | None = None
    ) -> list[Events]:
        """The events of frames first ... last - 1, in whose `keys` there is room for theirs; `starts` [frames + 1] of
        all keys are where those of a frame begin.  If `each` is given, by all threads."""
        if len(keys) == 0:
            return [Events.empty(self.labels)] * (last - first)
        first_us, last_us = self.first_us[first:last], self.last_us[first:last]
        microseconds = min(max(last_us.tolist()), LAST_OF_PASS) + 1
        few = not each and len(keys) * FEW <= microseconds * (last - first)
        rows = len(self.parts) if each and microseconds <= LAST_OF_PASS else 1
        stops = np.array(starts[first + 1 : last + 1]) - starts[first]
        if few:
            self._take(first, last, keys, np.array(starts[first:last]) - starts[first])
        else:
            self._count(first, last, keys, stops, microseconds, rows, each)
        t, x, y, p, label = self._room(len(keys))
        of_rows = each if each and rows > 1 else in_turn(1)
        of_rows(lambda k: unpack(keys, few, stops, first_us, last_us, k, rows, self.width, t, x, y, p, label))
        events = Events(t, x, y, p, label if self.labels else None)
        return [events.stretch(*frame) for frame in pairwise((0, *stops.tolist()))]

    def _take(self, first: int, last: int, keys: np.ndarray, filled: np.ndarray) -> None:
        """Keys of frames, each from where it is filled to [frames]."""
        for part in self.parts:
            take_keys(*part, first, last, filled, keys)

    def _count(
        self, first: int, last: int, keys: np.ndarray, stops: np.ndarray, microseconds: int, rows: int,
        each: Each | None,
    ) -> None:  # fmt: skip
        """Keys of frames, which end at stops [frames], in order of the microseconds, as far as one pass can tell."""
        parts = len(self.parts)
        of_parts = each if each and rows > 1 else in_turn(parts)
        places = np.zeros((rows, last - first, microseconds), np.int64)
        of_parts(lambda k: count_keys(*self.parts[k], first, last, places[k % rows]))
        lay_out(places, stops)
        of_parts(lambda k: put_keys(*self.parts[k], first, last, places[k % rows], keys))

    def unordered(self) -> Iterator[Events]:
        """The events of all frames, part by part; in order of time are those of a pixel alone."""
        for keys, ends in self.parts:
            t, x, y, p, label = self._room(int(ends[-1, -1]))
            since_us = np.tile(self.first_us, len(ends))
            unpack_frames(keys[: len(t)], ends.ravel(), since_us, self.width, t, x, y, p, label)
            yield Events(t, x, y, p, label if self.labels else None)

    def _room(self, n: int) -> tuple[np.ndarray, ...]:
        u16, u8 = np.uint16, np.uint8
        return np.empty(n, np.int64), np.empty(n, u16), np.empty(n, u16), np.empty(n, u8), np.empty(n * self.labels, u8)


def in_turn(count: int) -> Each:
    """`each` of so many, one after the other."""

    def each(work: Callable[[int], None]) -> None:
        for k in range(count):
            work(k)

    return each


def even_cuts(starts: list[int], runs: int) -> list[int]:
    """Where to cut frames that begin at ascending `starts` [frames + 1], so that each of the runs has about as much."""
    cuts, frames = [0], len(starts) - 1
    for k in range(1, runs):
        cut = bisect_left(starts, starts[-1] * k // runs)
        if cuts[-1] < cut < frames:
            cuts.append(cut)
    return [*cuts, frames]
