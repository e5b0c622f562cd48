"""Counts: how many events of each polarity a pixel sent.

    counts[p, y, x] = min(N_p(x, y), 65535)        uint16 [2, height, width]: OFF, ON

The histogram of Maqueda et al. (2018), "Event-based vision meets deep learning on steering prediction for self-driving
cars", CVPR, before its normalisation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.pictures.colours import MOST, event_colours, in_8_bits
from vid2ev.stream.events import Events, check_within

COLOURS = in_8_bits(event_colours())


class Counts:
    """Counts of the events of a slice; seen in the colours of the preview."""

    tiles = (1, 1)
    dtype: np.dtype[Any] = np.dtype(np.uint16)

    def __init__(self, size: tuple[int, int]):
        self.size = size
        self.shape: tuple[int, ...] = (2, size[1], size[0])
        self._counts = np.zeros(self.shape, self.dtype)

    def add(self, events: Events, start_us: int = 0, stop_us: int = 0) -> None:
        """Count events, whatever their time."""
        check_within(events, self.size)
        _count(events.x, events.y, events.p, self._counts)

    def take(self, stop_us: int = 0) -> np.ndarray:
        """The counts since the last call."""
        taken, self._counts = self._counts, np.zeros(self.shape, self.dtype)
        return taken

    def picture(self, array: np.ndarray) -> np.ndarray:
        """ON amber, OFF blue; up to 15 of each can be told apart."""
        off, on = np.minimum(array, MOST)
        return COLOURS[off, on]


@cached
def _count(x, y, p, counts):  # type: ignore[no-untyped-def]
    for i in range(len(x)):
        polarity, row, column = min(p[i], 1), y[i], x[i]
        if counts[polarity, row, column] < 65535:
            counts[polarity, row, column] += 1
