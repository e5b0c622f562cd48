"""Voxel grids: signed events in B bins of time, each event shared by the two bins around it.

    V(b, y, x) = sum_i s_i max(0, 1 - |b - t*_i|),   t*_i = (B - 1) (t_i - t_0) / (t_1 - t_0),   b = 0 ... B - 1

s_i is +1 for ON and -1 for OFF; float32 [B, height, width].  With `polarity` the events are counted apart, all with +1:
[2, B, height, width].  t_0 and t_1 are the edges of the slice; where they are the same, and for B = 1, all is in bin 0.
`normalised`: values other than 0 are shifted and scaled to mean 0 and standard deviation 1 (only scaled where all are
alike), those that are 0 stay 0, as in E2VID's code.

The formula is that of Zhu et al. (2019), "Unsupervised event-based learning of optical flow, depth, and egomotion",
CVPR, for events at whole pixels, and of Rebecq et al. (2019), "High speed and high dynamic range video with an event
camera" (E2VID).  Their t_0 and t_1 are the first and the last event.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.pictures.colours import GROUND, OFF, ON, in_8_bits, strength
from vid2ev.stream.events import Events, check_within

MOST_BINS = 1000
STEPS = 16  # of a picture's values per event
BRIGHTEST = 15 * STEPS
LINES = 70  # gray between the bins


class Voxel:
    """The voxel grid of a slice; seen as its bins, positive amber, negative blue."""

    dtype: np.dtype[Any] = np.dtype(np.float32)

    def __init__(self, size: tuple[int, int], bins: int = 5, *, polarity: bool = False, normalised: bool = False):
        self.size, self.bins, self.normalised = size, bins, normalised
        grid = (bins, size[1], size[0])
        self.shape: tuple[int, ...] = (2, *grid) if polarity else grid
        columns = math.isqrt(bins - 1) + 1
        self.tiles = columns, -(-bins // columns)
        self._grid = np.zeros((2 if polarity else 1, *grid), self.dtype)

    def add(self, events: Events, start_us: int, stop_us: int, worth: np.ndarray | None = None) -> None:
        """Add events between two instants [us]; those outside count as at the nearer one.

        worth   what each counts for, float32 [N], in place of 1
        """
        check_within(events, self.size)
        _add(events.t, events.x, events.y, events.p, worth, start_us, stop_us - start_us, self._grid)

    def take(self, stop_us: int = 0) -> np.ndarray:
        """The grid of the events since the last call."""
        taken, self._grid = self._grid, np.zeros_like(self._grid)
        return _normalised(taken.reshape(self.shape)) if self.normalised else taken.reshape(self.shape)

    def picture(self, array: np.ndarray) -> np.ndarray:
        """The bins from left to right, in rows from top to bottom; ON minus OFF where they are apart."""
        signed = array if array.ndim == 3 else array[1] - array[0]
        level = np.clip(np.rint(signed * STEPS), -BRIGHTEST, BRIGHTEST).astype(np.int16) + BRIGHTEST
        columns, rows = self.tiles
        across, down = self.size[0] + 1, self.size[1] + 1
        picture = np.full((rows * down - 1, columns * across - 1, 3), LINES, np.uint8)
        for k in range(columns * rows):
            top, left = k // columns * down, k % columns * across
            tile = COLOURS[level[k]] if k < self.bins else COLOURS[BRIGHTEST]
            picture[top : top + down - 1, left : left + across - 1] = tile
        return picture


def _normalised(grid: np.ndarray) -> np.ndarray:
    there = grid != 0
    values = grid[there].astype(np.float64)
    if len(values):
        spread = values.std()
        grid[there] = (values - values.mean()) / spread if spread > 0 else np.sign(values)
    return grid


@cached
def _add(t, x, y, p, worth, start_us, span_us, grid):  # type: ignore[no-untyped-def]
    apart, last = grid.shape[0] == 2, grid.shape[1] - 1
    for i in range(len(t)):
        # (the product is a whole number, so that of an event right at a bin nothing is left for the next one)
        at = min(max(float(t[i] - start_us) * last / span_us if span_us > 0 else 0.0, 0.0), float(last))
        bin_ = min(int(at), max(last - 1, 0))
        share = np.float32(at - bin_)
        sign = np.float32(1 if apart or p[i] else -1)
        sign *= np.float32(1) if worth is None else worth[i]
        channel = min(p[i], 1) if apart else 0
        grid[channel, bin_, y[i], x[i]] += sign * (np.float32(1) - share)
        if last:
            grid[channel, bin_ + 1, y[i], x[i]] += sign * share


def _colours() -> np.ndarray:
    level = np.arange(-BRIGHTEST, BRIGHTEST + 1)[:, None] / STEPS
    return in_8_bits(GROUND + strength(np.abs(level)) * (np.where(level > 0, ON, OFF) - GROUND))


COLOURS = _colours()
