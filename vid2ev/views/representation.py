"""Representations: what the events of a slice become, an array of one shape for a sensor and a way to see it.

A representation takes in the pieces of a slice and then gives its array.  Wherever polarities are apart, index 0 is OFF
and 1 is ON, as in `Events.p`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events
from vid2ev.views.slices import Piece, Slicing


class Representation(Protocol):
    """Made for a sensor of a size (width, height)."""

    shape: tuple[int, ...]  # of the array of a slice; the last two are height and width
    dtype: np.dtype[Any]
    tiles: tuple[int, int]  # columns and rows of pictures of the sensor in `picture`, a pixel apart

    def add(self, events: Events, start_us: int, stop_us: int) -> None:
        """Take in events of the slice (start_us, stop_us].  Raises ValueError for pixels outside of the sensor."""

    def take(self, stop_us: int) -> np.ndarray:
        """The array of the slice that ends here; the next slice begins."""

    def picture(self, array: np.ndarray) -> np.ndarray:
        """How an array looks: R'G'B' uint8 [height, width, 3]."""


Kind = Callable[[tuple[int, int]], Representation]


@dataclass(frozen=True, slots=True)
class Slice:
    """What is known of a slice: (start_us, stop_us] and the number of its events."""

    start_us: int
    stop_us: int
    events: int


def represent(
    recording: Recording, slicing: Slicing, representation: Representation
) -> Iterator[tuple[Slice, np.ndarray]]:
    """The slices of a recording, each with its array; raises as the slicing and the recording's blocks do."""
    count = 0
    for piece in slicing.pieces(recording):
        representation.add(piece.events, piece.start_us, piece.stop_us)
        count += len(piece.events)
        if piece.last:
            yield _slice(piece, count), representation.take(piece.stop_us)
            count = 0


def slices_of(recording: Recording, slicing: Slicing) -> Iterator[Slice]:
    """The slices of a recording without their arrays."""
    count = 0
    for piece in slicing.pieces(recording):
        count += len(piece.events)
        if piece.last:
            yield _slice(piece, count)
            count = 0


def _slice(piece: Piece, count: int) -> Slice:
    return Slice(piece.start_us, piece.stop_us, count)
