"""Which blocks of a sensor sleep, between one step and the next: the records that `vid2ev.kernels.sleep` works on."""

from __future__ import annotations

import numpy as np

from vid2ev.kernels.layout import BLOCK, Interval
from vid2ev.kernels.sleep import AWAKE, HISTORY, WEIGHTS, Naps

BITS = {1: np.uint8, 2: np.uint16, 4: np.uint32, 8: np.uint64}


class Sleep:
    """The sleep of the blocks of `pixels` pixels; where it is not `wanted`, nothing is kept."""

    def __init__(self, pixels: int, wanted: bool):
        blocks = -(-pixels // BLOCK) if wanted else 0
        nothing = np.empty(0, np.uint32)
        self._intervals, self._blocks = 0, -(-pixels // BLOCK)
        self.naps = Naps(
            wanted=wanted,
            now=nothing,
            before=nothing,
            known=np.zeros(blocks, np.uint8),
            changes=np.zeros(blocks, np.uint8),
            wait=np.zeros(blocks, np.uint8),
            mended=np.zeros(blocks, np.uint8),
            state=np.full(blocks, AWAKE, np.uint8),
            behind=np.zeros(blocks, np.int64),
            until=np.zeros(blocks, np.float64),
            calm=np.zeros(blocks, np.uint8),
            slept=np.zeros(blocks, np.int64),
            history=np.zeros((HISTORY, WEIGHTS)),
            tick=0,
        )

    def begin(self, light: np.ndarray, interval: Interval) -> None:
        """An interval, at whose end is `light` [n]."""
        now = light.view(BITS[light.dtype.itemsize])
        if not self.naps.wanted:
            self.naps = self.naps._replace(now=now, before=now)
            return
        if self.naps.before.dtype != now.dtype or self.naps.before.size != now.size:
            self.naps.known[...] = 0
            self.naps = self.naps._replace(before=np.empty(now.size, now.dtype))
        self.naps = self.naps._replace(now=now)
        self.naps.history[self.naps.tick % HISTORY] = interval.x1, interval.x2, interval.g, interval.a, interval.b

    def end(self) -> None:
        """The interval is over: its light may be changed, and it counts."""
        nothing = self.naps.now[:0]
        self.naps = self.naps._replace(now=nothing, tick=self.naps.tick + 1)
        self._intervals += 1

    def forget(self) -> None:
        """Another state: all are awake, and nothing is known of the light that led to it."""
        self.naps.known[...] = 0
        self.naps.wait[...] = 0
        self.naps.behind[...] = 0
        self.wake()

    def wake(self) -> None:
        """Nobody sleeps on without having been looked at."""
        self.naps.state[...] = AWAKE

    def late(self, blocks: np.ndarray) -> np.ndarray:
        """Those of these blocks that have intervals to make up for."""
        return blocks[self.naps.behind[blocks] > 0] if self.naps.wanted else blocks[:0]

    @property
    def count(self) -> tuple[int, int]:
        """(intervals that blocks have slept, intervals of all blocks)"""
        return int(self.naps.slept.sum()), self._intervals * self._blocks
