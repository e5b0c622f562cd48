"""Which strips of a sensor sleep, between one step and the next: the records that `vid2ev.kernels.sleep` works on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vid2ev.kernels.layout import BLOCK, STRIP, Interval
from vid2ev.kernels.naps import AGAIN, AWAKE, COLUMNS, HISTORY, Naps
from vid2ev.stream.still import nothing_told


class Sleep:
    """The sleep of the strips of `pixels` pixels; where it is not `wanted`, nothing is kept."""

    def __init__(self, pixels: int, wanted: bool):
        self._intervals, self._strips = 0, -(-pixels // STRIP)
        strips = self._strips if wanted else 0
        self.naps = Naps(
            wanted=wanted,
            told=nothing_told(1),
            state=np.full(strips, AWAKE, np.uint8),
            since=np.full(strips, -1, np.int64),
            until=np.zeros(strips, np.float64),
            calm=np.zeros(strips, np.uint8),
            unasked=np.zeros(strips, np.uint8),
            patience=np.zeros(strips, np.uint8),
            slept=np.zeros(-(-pixels // BLOCK), np.int64),
            history=np.zeros((HISTORY, COLUMNS)),
            tick=0,
        )

    def begin(self, intervals: Sequence[Interval], told: np.ndarray) -> None:
        """AT_ONCE intervals at most, and which strips are told to keep their light in each (`stream.still.told_of`)."""
        self.naps = self.naps._replace(told=told if self.naps.wanted else nothing_told(len(intervals)))
        history = self.naps.history
        for tick, interval in enumerate(intervals, self.naps.tick):
            weights = (interval.x1, interval.x2, interval.g, interval.a, interval.b)
            again = weights == tuple(history[(tick - 1) % HISTORY, :AGAIN].tolist())
            history[tick % HISTORY] = *weights, again

    def end(self, intervals: int) -> None:
        """So many are over, and count."""
        self.naps = self.naps._replace(tick=self.naps.tick + intervals)
        self._intervals += intervals

    def forget(self) -> None:
        """Another state: all are awake, with nothing to make up for."""
        self.naps.since[...], self.naps.unasked[...], self.naps.patience[...] = -1, 0, 0
        self.naps.state[...] = AWAKE

    def late(self, strips: np.ndarray) -> np.ndarray:
        """Those of these strips that have intervals to make up for."""
        return strips[self.naps.since[strips] >= 0] if self.naps.wanted else strips[:0]

    @property
    def count(self) -> tuple[int, int]:
        """(intervals that strips have slept, intervals of all strips)"""
        return int(self.naps.slept.sum()), self._intervals * self._strips
