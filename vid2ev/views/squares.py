"""Squares of pixels that fill with events, for slices by area."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.stream.events import Events, check_within


class Squares:
    """The squares of `side` x `side` pixels of a sensor of `size` (width, height), those at the right and lower edge
    cut off; a slice is full when one of them has `most` events."""

    def __init__(self, size: tuple[int, int], side: int, most: int):
        width, height = size
        self.most, self._size = most, size
        self._column = np.arange(width) // side
        self._row = np.arange(height) // side * (self._column[-1] + 1)
        self._counts = np.zeros(self._row[-1] + self._column[-1] + 1, np.int64)

    def fills(self, events: Events, first: int) -> int:
        """The index of the event, from `first` on, that fills the slice; -1 if none does.

        Raises ValueError for events outside of the sensor.
        """
        if first == 0:
            check_within(events, self._size)
        at = int(_fills(events.x, events.y, first, self._column, self._row, self._counts, self.most))
        if at >= 0:
            self._counts[:] = 0
        return at


@cached
def _fills(x, y, first, column, row, counts, most):  # type: ignore[no-untyped-def]
    for i in range(first, len(x)):
        square = row[y[i]] + column[x[i]]
        counts[square] += 1
        if counts[square] >= most:
            return i
    return -1
