"""Grids of all clips of a batch on a GPU: sums of whole numbers, the same in whatever order they are made.

They are what `vid2ev.views.grid` makes of each clip; here the edges and windows are those of all clips.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vid2ev.sensors.card_events import CardSent
from vid2ev.views.grid import edges_of, windows_of

ONE = 1 << 30  # an event in fixed point: a share of it is off by 2**-31 at most


class NetCountsOnCard:
    """`NetCounts` of some clips: [clips, n, height, width], with `polarity` [clips, n, 2, height, width].

    What is beyond the type is at its end by the sum of an interval, not event by event.
    """

    def __init__(
        self,
        memory: Any,
        clips: int,
        size: tuple[int, int],
        edges_us: Sequence[int] | np.ndarray,
        *,
        dtype: Any = np.int8,
        polarity: bool = False,
    ):
        self.memory, self.dtype, self._apart = memory, dtype, polarity
        edges = edges_of(edges_us)
        self._edges, self._n, self._pixels = memory.put(edges), len(edges) - 1, size[0] * size[1]
        self.shape = (clips, self._n, *((2,) if polarity else ()), size[1], size[0])
        self._sums = memory.zeros(int(np.prod(self.shape)), np.int32)

    def add(self, sent: CardSent) -> None:
        """Count events."""
        k, cast = self.memory.searchsorted(self._edges, sent.t) - 1, self.memory.cast
        plane, value = sent.clip * self._n + k, 2 * sent.p - 1
        if self._apart:
            plane, value = 2 * plane + sent.p, sent.p * 0 + 1
        inside = (k >= 0) & (k < self._n)
        self.memory.add_at(self._sums, (plane * self._pixels + sent.pixel)[inside], cast(value[inside], np.int32))

    def take(self) -> Any:
        """The planes of the events since the last call."""
        ends = np.iinfo(self.dtype)
        taken = self.memory.cast(self._sums.clip(ends.min, ends.max), self.dtype).reshape(self.shape)
        self._sums[:] = 0
        return taken


class VoxelsOnCard:
    """Voxel grids (`vid2ev.views.voxel`) of some windows (start, stop] of some clips: [clips, windows, bins, height,
    width], with `polarity` [clips, windows, 2, bins, height, width]; float32.

    N events in a voxel are within N / 2**31 of their sum, rounded to float32 once.
    """

    def __init__(
        self,
        memory: Any,
        clips: int,
        size: tuple[int, int],
        windows_us: Sequence[Sequence[int]] | np.ndarray,
        bins: int = 5,
        *,
        polarity: bool = False,
    ):
        self.memory, self._apart, self.bins = memory, polarity, bins
        self._windows, self._pixels = windows_of(windows_us).tolist(), size[0] * size[1]
        self.shape = (clips, len(self._windows), *((2,) if polarity else ()), bins, size[1], size[0])
        self._sums = memory.zeros(int(np.prod(self.shape)), np.int64)

    def add(self, sent: CardSent) -> None:
        """Take in events, those that are in a window."""
        for k, (start, stop) in enumerate(self._windows):
            inside = (sent.t > start) & (sent.t <= stop)
            clip, t, pixel, p = (part[inside] for part in (sent.clip, sent.t, sent.pixel, sent.p))
            self._add(clip * len(self._windows) + k, t - start, stop - start, pixel, p)

    def _add(self, grid: Any, since_us: Any, long_us: int, pixel: Any, p: Any) -> None:
        last, cast = self.bins - 1, self.memory.cast
        scale = last / long_us if long_us > 0 else 0.0
        at = (cast(since_us, np.float64) * scale).clip(0.0, float(last))
        bin_ = cast(at, np.int64).clip(0, max(last - 1, 0))
        share = cast(cast(cast(at - bin_, np.float32), np.float64) * ONE + 0.5, np.int64)
        plane, sign = (2 * grid + p, p * 0 + 1) if self._apart else (grid, 2 * p - 1)
        place = (plane * self.bins + bin_) * self._pixels + pixel
        self.memory.add_at(self._sums, place, sign * (ONE - share))
        if last:
            self.memory.add_at(self._sums, place + self._pixels, sign * share)

    def take(self) -> Any:
        """The grids of the events since the last call."""
        taken = self.memory.cast(self.memory.cast(self._sums, np.float64) * (1.0 / ONE), np.float32)
        self._sums[:] = 0
        return taken.reshape(self.shape)
