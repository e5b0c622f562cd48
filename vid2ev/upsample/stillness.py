"""Which strips of two frames are the same."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.stream.still import BRIGHTEST, STRIP, strip_count

_BRIGHTEST = np.float32(BRIGHTEST)


def still_strips(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The strips in which two arrays of light, [H, W] or [H, W, 3], are the same, as of `Still`."""
    height, width = before.shape[:2]
    same = np.empty(strip_count(width, height), np.bool_)
    channels = before.size // max(height * width, 1)
    compare(np.ascontiguousarray(before).reshape(-1), np.ascontiguousarray(after).reshape(-1), STRIP * channels, same)
    return same


@compiled
def compare(before, after, length, same):
    """Whether runs of this length are the same, into `same`."""
    for strip in range(same.size):
        first = strip * length
        last = min(first + length, before.size)
        same[strip] = all_same(before[first:last], after[first:last])


@inner
def all_same(before, after):
    """Whether all of two arrays are the same light."""
    odd = np.uint32(0)
    for i in range(before.size):
        odd = np.uint32(odd | np.uint32(is_kept(before[i], after[i]) == False))  # noqa: E712 (vectorises, `not` does not)
    return odd == 0


@inner
def is_kept(before, after):
    """Whether a pixel's light is what it was, and light as it should be."""
    return (before == after) & (after >= np.float32(0)) & (after <= _BRIGHTEST)
