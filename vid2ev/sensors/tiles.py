"""Work on tiles of blocks at the same time, cut so that all tiles take as long."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

from vid2ev.errors import UsageError
from vid2ev.interrupts import found_again
from vid2ev.requests import is_whole

R = TypeVar("R")


class Part(NamedTuple):
    """Part `number`, from 0, of the `parts` into which the blocks of a sensor are cut, equal but for one block."""

    number: int = 0
    parts: int = 1

    def within(self, blocks: int) -> tuple[int, int]:
        """The first of its blocks, and the one after its last."""
        return blocks * self.number // self.parts, blocks * (self.number + 1) // self.parts


WHOLE = Part()


class Tiles:
    """`count` runs of consecutive blocks: at most one for each of `threads`, the first of which is the caller's own.

    How the blocks are cut changes nothing but the time it takes.  Of a `part`, its blocks are all there are.
    """

    def __init__(self, blocks: int, threads: int, part: Part = WHOLE):
        known = isinstance(part, Part) and is_whole(part.parts, 1, blocks) and is_whole(part.number, 0, part.parts - 1)
        if not known:
            raise UsageError(
                f"part {part!r}: expected Part(number, parts), a number from 0 on, of {blocks} parts at most;"
                " leave it out for all pixels"
            )
        first, last = part.within(blocks)
        self.count = min(threads, last - first)
        self._cuts = [first + (last - first) * k // self.count for k in range(self.count + 1)]
        self._pool = ThreadPoolExecutor(self.count - 1) if self.count > 1 else None

    def holds(self, block: int) -> bool:
        """Whether a block is among these."""
        return self._cuts[0] <= block < self._cuts[-1]

    def each(self, work: Callable[[int], R]) -> list[R]:
        """[work(0), work(1), ... work(count - 1)], at the same time."""
        with found_again():
            if self._pool is None:
                return [work(0)]
            others = [self._pool.submit(work, k) for k in range(1, self.count)]
            return [work(0), *(other.result() for other in others)]

    def each_blocks(self, work: Callable[[int, int, int], R]) -> list[R]:
        """[work(k, first block, the block after the last) for each tile k], at the same time; then cut anew."""
        seconds = [0.0] * self.count

        def timed(k: int) -> R:
            began = time.perf_counter()
            result = work(k, self._cuts[k], self._cuts[k + 1])
            seconds[k] = time.perf_counter() - began
            return result

        results = self.each(timed)
        self._cuts = balanced(self._cuts, seconds)
        return results


def balanced(cuts: list[int], seconds: list[float]) -> list[int]:
    """Cuts half-way to where tiles would have taken as long as each other, if time were even within each tile.

    Half-way, because what disturbed one frame need not disturb the next.
    """
    count, share = len(seconds), sum(seconds) / len(seconds)
    ideal, k, before = [float(cuts[0])], 0, 0.0
    for part in range(1, count):
        while k < count - 1 and before + seconds[k] < part * share:
            before += seconds[k]
            k += 1
        inside = (part * share - before) / seconds[k] if seconds[k] > 0 else 0.0
        ideal.append(cuts[k] + inside * (cuts[k + 1] - cuts[k]))
    ideal.append(float(cuts[-1]))
    fresh = [round((old + new) / 2) for old, new in zip(cuts, ideal, strict=True)]
    for part in range(1, count):  # no tile is empty
        fresh[part] = min(max(fresh[part], fresh[part - 1] + 1), cuts[-1] - (count - part))
    return fresh
