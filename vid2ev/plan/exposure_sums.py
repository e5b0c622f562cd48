"""Sums over the values of exposures, column by column, which the processor does many at a time.

Light is float32, rows [H, n]; sums are float64 [n] each, one under the other.  Of a change c there is the greatest
|c| and the sum of c^2.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernel_cache import mark_our_kernels

mark_our_kernels()
LEAST, MOST, SUM, SQUARE = range(4)  # of the light behind the lens shading
SHADED, CLIPPED, OVERFULL, NEAR = 4, 6, 8, 10  # changes, and how many values are near the full well
SUMS = 11


@njit(cache=True, nogil=True, error_model="numpy")
def add_light(light, shade, black, white, gain, well, near_well, sums):
    """Add the light of an exposure; all is in light: that of the first code and of the last, what a well holds of a
    pixel that is `gain` times as sensitive, and from where on it may be full."""
    for y in range(light.shape[0]):
        row, optical = light[y], shade[y]
        for i in range(row.size):
            before = np.float64(row[i])
            value = before * np.float64(optical[i])
            shaded = value - before
            clipped = value - min(max(value, black), white)
            overfull = max(value * gain - well, 0.0)
            sums[LEAST, i] = min(sums[LEAST, i], value)
            sums[MOST, i] = max(sums[MOST, i], value)
            sums[SUM, i] += value
            sums[SQUARE, i] += value * value
            sums[SHADED, i] = max(sums[SHADED, i], abs(shaded))
            sums[SHADED + 1, i] += shaded * shaded
            sums[CLIPPED, i] = max(sums[CLIPPED, i], abs(clipped))
            sums[CLIPPED + 1, i] += clipped * clipped
            sums[OVERFULL, i] = max(sums[OVERFULL, i], overfull)
            sums[OVERFULL + 1, i] += overfull * overfull
            sums[NEAR, i] += 1.0 if value >= near_well else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def add_change(one, other, shade, sums):
    """Add what two pictures of light differ by, where the lens brightens it more (float64 [2, n])."""
    for y in range(one.shape[0]):
        first, second, optical = one[y], other[y], shade[y]
        for i in range(first.size):
            change = (np.float64(first[i]) - np.float64(second[i])) * max(np.float64(optical[i]), 1.0)
            sums[0, i] = max(sums[0, i], abs(change))
            sums[1, i] += change * change
