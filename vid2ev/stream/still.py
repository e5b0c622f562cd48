"""Stillness: which pixels of a frame are, to the bit, those of the frame before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

STRIP = 256  # pixels, row by row
NOT_SAID = np.uint8(2)
BRIGHTEST = 1e30  # light that sensors take as it is; what is below 0 or not finite they mend, and count


class Still(NamedTuple):
    """What whoever makes frames knows of one beside the one before it, so that nobody has to look.

    before   the light of that frame, the very array: to anybody who did not see it this says nothing
    strips   bool [ceil(H W / 256)]: runs of 256 pixels, row by row, that have not changed and are light as it should
             be, from 0 to 1e30; of others nothing is known
    """

    before: np.ndarray
    strips: np.ndarray


def told_of(stills: Sequence[Still | None], lasts: Sequence[object]) -> np.ndarray:
    """uint8 [frames, strips]: what is said of each frame to whoever saw its one of `lasts` before; NOT_SAID where that
    is nothing, of no strips at all if it is nothing of any frame."""
    told = [
        None if still is None or still.before is not last else still.strips.view(np.uint8)
        for still, last in zip(stills, lasts, strict=True)
    ]
    strips = next((len(each) for each in told if each is not None), 0)
    return np.array([np.full(strips, NOT_SAID) if each is None else each for each in told])


def nothing_told(frames: int) -> np.ndarray:
    """`told_of` frames of which nobody knows anything."""
    return np.empty((frames, 0), np.uint8)


def strip_count(width: int, height: int) -> int:
    """How many strips a picture has."""
    return -(-width * height // STRIP)
