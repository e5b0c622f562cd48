"""The rows of a frame camera on a CPU: light before and after, sums of exposures, and what is read out of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vid2ev.kernels.exposures import ReadOut, add_rows, read_rows, take_rows
from vid2ev.sensors.cis_readout import Frozen
from vid2ev.sensors.tiles import Tiles


class Rows:
    """Rows of a shape [H, n], `threads` of them worked on at a time.

    colour    negative light is a colour that lacks a primary, and no mistake
    linear    exposures have their light
    before, after   float32, the frames of light between which time is
    mended    how many values were no light
    """

    def __init__(
        self, shape: tuple[int, int], numbers: ReadOut, frozen: Frozen, threads: int, *, colour: bool, linear: bool
    ):
        self.shape, self.frozen, self.mended = shape, frozen, 0
        self._numbers, self._colour, self._linear = numbers, colour, linear
        self._tiles = Tiles(shape[0], threads)
        self.before, self.after = np.zeros(shape, np.float32), np.zeros(shape, np.float32)

    def sums(self) -> np.ndarray:
        """Zeros, float64."""
        return np.zeros(self.shape)

    def put(self, array: np.ndarray) -> np.ndarray:
        """A copy of an array, where the rows are."""
        return array.copy()

    def get(self, rows: np.ndarray) -> np.ndarray:
        """A copy of rows, as an array of numpy."""
        return rows.copy()

    def take(self, light: np.ndarray) -> None:
        """Light [H, n] becomes the frame `after`, mended."""
        self.mended += sum(self._each(lambda a, b: take_rows(light[a:b], self.after[a:b], self._colour)))

    def pass_on(self) -> None:
        """The frame `after` is the one `before` from now on."""
        self.before, self.after = self.after, self.before

    def add(self, total: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """total += before x the frame before + after x the frame after, weights float64 [H]."""
        self._each(lambda a, b: add_rows(total[a:b], self.before[a:b], before[a:b], self.after[a:b], after[a:b]))

    def read(self, total: np.ndarray, index: int) -> tuple[np.ndarray, np.ndarray | None]:
        """Codes uint16 of the sums of the exposure number `index`, and its light float32 with `linear`; the sums are
        zeros then."""
        codes, n = np.empty(self.shape, np.uint16), self.shape[1]
        light = np.empty(self.shape if self._linear else (0, 0), np.float32)

        def read(a: int, b: int) -> None:
            words, noise = np.empty((4, n), np.uint32), np.zeros((2, n))
            planes, numbers = self.frozen.rows(a, b), self._numbers
            read_rows(total[a:b], *planes, a * n, index, numbers, words, noise, codes[a:b], light[a:b])

        self._each(read)
        total.fill(0.0)
        return codes, light if self._linear else None

    def _each(self, work: Callable[[int, int], Any]) -> list[Any]:
        return self._tiles.each_blocks(lambda _, first, last: work(first, last))
