"""Event files that are read from the front to the back: but for `hdf5`, which looks parts up, they have no index."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import BLOCK, Picture, regrouped, within
from vid2ev.stream.events import Events

PIECE = 1 << 20  # bytes read at a time
ROOM = 32  # events that the word of most events can hold
LATE_US = 10_000_000  # more than cameras send late, and less than most silences of 71.6 minutes less so much


class Sequential:
    """What such files have in common; a format says in `_decoded` how its events are found."""

    size: tuple[int, int] | None = None
    start_us, says_start = 0, False
    labelled = False
    has_frames = False

    def __init__(self, path: Path):
        self.path = path
        self.warnings: list[str] = []

    def describe(self) -> dict[str, Any]:
        """Nothing else."""
        return {}

    def events(self, start_us: int | None = None, stop_us: int | None = None, block: int = BLOCK) -> Iterator[Events]:
        """The events with start_us <= t < stop_us; all of the file is read."""
        return regrouped(within(self._decoded(), start_us, stop_us), block)

    def frames(self) -> Iterator[Picture]:
        """None."""
        return iter(())

    def _decoded(self) -> Iterator[Events]:
        """The events, as many at a time as is convenient."""
        raise NotImplementedError

    def _leave_out(self, count: int, what: str) -> None:
        """Warn that something is not among the events; once, however often the file is read."""
        text = f"{count} {what} left out"
        if count and text not in self.warnings:
            self.warnings.append(text)

    def _inside(self, events: Events) -> tuple[Events, int]:
        """The events within the sensor, and the number of the others."""
        if self.size is None:
            return events, 0
        kept = (events.x < self.size[0]) & (events.y < self.size[1])
        outside = len(events) - int(np.count_nonzero(kept))
        return (events.select(kept) if outside else events), outside

    def _all_inside(self, blocks: Iterator[Events]) -> Iterator[Events]:
        """Those of all blocks within the sensor; the others are left out."""
        outside = 0
        for block in blocks:
            events, left = self._inside(block)
            outside += left
            yield events
        self._leave_out(outside, f"{self._outside} are")

    @property
    def _outside(self) -> str:
        """Events that are of no pixel of the sensor."""
        return f"events outside of the {self.size[0]}x{self.size[1]} sensor" if self.size else "events of no pixel"


class Unwrapped:
    """A clock of 32 bits, followed beyond its end: from a time to one that is 2**31 us less, it has wrapped.

    An event of up to LATE_US before that which comes after it is late, and not of a turn of the clock later.
    """

    def __init__(self) -> None:
        self._last, self._turns = 0, 0

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """int64 times that follow those of the calls before."""
        t = t.astype(np.int64)
        steps = np.diff(t, prepend=self._last)
        turns = (steps < -(1 << 31)).astype(np.int64) - (steps > (1 << 32) - LATE_US)
        starts = self._turns + (np.cumsum(turns) if turns.any() else np.zeros(1, np.int64))
        starts -= np.minimum(np.minimum.accumulate(starts), 0)  # (before the first turn there is silence, and no other)
        if len(t):
            self._last, self._turns = int(t[-1]), int(starts[-1])
        return t + (starts << 32)


@contextmanager
def reading(path: Path) -> Iterator[BinaryIO]:
    """A file, open; what the disk does not give becomes a DataError."""
    try:
        with open(path, "rb") as file:
            yield file
    except DataError:
        raise
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror or error}; get another copy") from error


def pieces(file: BinaryIO, dtype: Any, size: int = PIECE) -> Iterator[np.ndarray]:
    """The rest of a file as arrays of about `size` bytes; an item that is cut off at the end is left out."""
    count = max(size // np.dtype(dtype).itemsize, 1)
    while len(piece := np.fromfile(file, dtype, count)):
        yield piece


def decoded(words: Iterable[np.ndarray], decode: Callable, size: tuple[int, int]) -> Iterator[Events]:
    """The events in pieces of words, by a compiled function of (words, width, height, t, x, y, p) that fills the
    last four, and returns how many words it has used and how many events it has found."""
    for piece in words:
        at = 0
        while at < len(piece):
            count = len(piece) - at + ROOM
            t, x, y, p = (np.empty(count, dtype) for dtype in (np.int64, np.uint16, np.uint16, np.uint8))
            used, found = decode(piece[at:], *size, t, x, y, p)
            at += used
            if found:
                yield Events(t[:found], x[:found], y[:found], p[:found])
