"""Stillness: which pixels of a frame are, to the bit, those of the frame before."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

STRIP = 256  # pixels, row by row
BRIGHTEST = 1e30  # light that sensors take as it is; what is below 0 or not finite they mend, and count


class Still(NamedTuple):
    """What whoever makes frames knows of one beside the one before it, so that nobody has to look.

    before   the light of that frame, the very array: to anybody who did not see it this says nothing
    strips   bool [ceil(H W / 256)]: runs of 256 pixels, row by row, that have not changed and are light as it should
             be, from 0 to 1e30; of others nothing is known
    """

    before: np.ndarray
    strips: np.ndarray


def strip_count(width: int, height: int) -> int:
    """How many strips a picture has."""
    return -(-width * height // STRIP)


def still_strips(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The strips in which two arrays of light, [H, W] or [H, W, 3], are the same, as of `Still`."""
    height, width = before.shape[:2]
    same = np.empty(strip_count(width, height), np.bool_)
    channels = before.size // max(height * width, 1)
    compare(np.ascontiguousarray(before).reshape(-1), np.ascontiguousarray(after).reshape(-1), STRIP * channels, same)
    return same


@njit(cache=True, nogil=True, error_model="numpy")
def compare(before, after, length, same):
    """Whether runs of this length are the same, into `same`."""
    for strip in range(same.size):
        first = strip * length
        last = min(first + length, before.size)
        same[strip] = all_same(before[first:last], after[first:last])


@njit(cache=True, nogil=True, error_model="numpy")
def all_same(before, after):
    """Whether all of two arrays are the same light."""
    odd = np.uint32(0)
    brightest = np.float32(BRIGHTEST)
    for i in range(before.size):
        value = after[i]
        fine = (value == before[i]) & (value >= np.float32(0)) & (value <= brightest)
        odd = np.uint32(odd | np.uint32(fine == False))  # noqa: E712 (vectorises, `not` does not)
    return odd == 0
