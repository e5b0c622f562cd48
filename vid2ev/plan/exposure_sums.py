"""Sums over the values of exposures, column by column, which the processor does many at a time.

Light is float32, rows [H, n]; sums are float64 [n] each, one under the other.  Of a change c there is the greatest
|c| and the sum of c^2.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached

LEAST, MOST, SUM, LIT_MOST, LIT_SUM, LIT_SQUARE = range(6)  # of the light behind the lens shading
SHADED, CLIPPED, OVERFULL, NEAR = 6, 8, 10, 12  # changes, and how many values are near the full well
SUMS = 13


@cached
def add_light(light, shade, dark, bright, black, white, gain, well, near_well, sums):
    """Add the light of an exposure.  All is in light: what lies between dark and bright may be seen, black is the first
    code and white the last, a well is what a pixel `gain` times as sensitive holds, near_well where it may be full.
    """
    for y in range(light.shape[0]):
        row, optical = light[y], shade[y]
        for i in range(row.size):
            before = np.float64(row[i])
            value = before * np.float64(optical[i])
            seen = min(max(value, dark), bright)
            lit = value if seen == value else 0.0
            shaded = seen - min(max(before, dark), bright)
            clipped = value - min(max(value, black), white)
            overfull = max(seen * gain - well, 0.0)
            sums[LEAST, i] = min(sums[LEAST, i], value)
            sums[MOST, i] = max(sums[MOST, i], value)
            sums[SUM, i] += value
            sums[LIT_MOST, i] = max(sums[LIT_MOST, i], lit)
            sums[LIT_SUM, i] += lit
            sums[LIT_SQUARE, i] += lit * lit
            sums[SHADED, i] = max(sums[SHADED, i], abs(shaded))
            sums[SHADED + 1, i] += shaded * shaded
            sums[CLIPPED, i] = max(sums[CLIPPED, i], abs(clipped))
            sums[CLIPPED + 1, i] += clipped * clipped
            sums[OVERFULL, i] = max(sums[OVERFULL, i], overfull)
            sums[OVERFULL + 1, i] += overfull * overfull
            sums[NEAR, i] += 1.0 if seen >= near_well else 0.0


@cached
def add_change(one, other, shade, dark, bright, sums):
    """Add what two pictures of light differ by, between dark and bright; behind the lens or before it, whatever is more
    (float64 [2, n])."""
    for y in range(one.shape[0]):
        first, second, optical = one[y], other[y], shade[y]
        for i in range(first.size):
            a, b, gain = np.float64(first[i]), np.float64(second[i]), np.float64(optical[i])
            plain = abs(min(max(a, dark), bright) - min(max(b, dark), bright))
            shaded = abs(min(max(a * gain, dark), bright) - min(max(b * gain, dark), bright))
            change = max(plain, shaded)
            sums[0, i] = max(sums[0, i], change)
            sums[1, i] += change * change
