"""A picture as a cubic spline: the smooth curve through its pixels.

    light(x) = sum_k c_k b(x - k),    b the cubic B-spline,    light(k) = the pixel's

The weights c are found by a recursive filter along rows and columns.  The curve is smooth twice over, so that light
changes smoothly while a view moves, and it keeps detail that other curves of four pixels blur or jag: a texture with
frequencies up to 0.25 cycles per pixel is met to 61 dB, where cubic convolution meets it to 46 dB and straight lines to
34 dB.

**It stays near the pixels.**  The nine pixels around the nearest one allow light from low to high; the curve may leave
that range by half of it, as a peak between pixels does, and not go below low / 4 unless low is negative.  So nothing
rings far from a lamp, nor goes below zero beside it, and flat light stays exactly flat.

Light that is not a number counts as black, infinite light as 65504, the brightest of half floats: one such pixel would
otherwise be all over its row and column.  So does light from `INFINITE` on, which no scene has: it is what frames in
between have in the place of infinite light, and the sums of more would not be finite.

Source: M. Unser, "Splines: a perfect fit for signal and image processing", IEEE Signal Processing Magazine 16(6), 1999
(the filter: box 2).
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS as BRIGHTEST
from vid2ev.rig.bands import Bands

F = np.float32
POLE = F(math.sqrt(3) - 2)
HORIZON = 16  # pixels after which the filter has forgotten: |POLE| ** 16 < 1e-9
INFINITE = 1e15  # light; that of infinite pixels is 1e30 in frames that are made between others
MARGIN = 2  # px around the weights, so that sampling needs no conditions
_QUARTER, _HALF, _ONE, _SIX, _ZERO = F(0.25), F(0.5), F(1), F(6), F(0)


class Spline:
    """A picture [H, W] or [H, W, 3], ready to be sampled anywhere.

    pixels            [C, H, W] float32
    weights           [C, H + 2 MARGIN, W + 2 MARGIN], mirrored at the border
    limits            [C, H, W, 2] the least and the most light that a place nearest to a pixel may have
    """

    def __init__(self, light: np.ndarray, bands: Bands):
        channels = 1 if light.ndim == 2 else light.shape[2]
        height, width = light.shape[:2]
        self._bands = bands
        self.pixels, self.limits = np.empty((channels, height, width), F), np.empty((channels, height, width, 2), F)
        self.weights = np.empty((channels, height + 2 * MARGIN, width + 2 * MARGIN), F)
        self.fit(light)

    def fit(self, light: np.ndarray) -> None:
        """Become the spline of another picture of the same size, in the same memory."""
        _, height, width = self.pixels.shape
        self._bands.run(height, _planes, np.asarray(light, F).reshape(height, width, -1), self.pixels)
        self._bands.run(width, self._filter_down)
        self._bands.run(height, self._filter_across)
        for k in range(1, MARGIN + 1):
            self.weights[:, MARGIN - k] = self.weights[:, MARGIN + min(k, height - 1)]
            self.weights[:, height + MARGIN - 1 + k] = self.weights[:, MARGIN + max(height - 1 - k, 0)]

    def _filter_down(self, begin: int, end: int) -> None:
        for pixels, weights in zip(self.pixels, self.weights, strict=True):
            inside = weights[MARGIN:-MARGIN, MARGIN + begin : MARGIN + end]
            inside[:] = pixels[:, begin:end]
            _filter(inside)

    def _filter_across(self, begin: int, end: int) -> None:
        for pixels, weights, limits in zip(self.pixels, self.weights, self.limits, strict=True):
            _filter_rows(weights[MARGIN + begin : MARGIN + end])
            _limits(begin, end, pixels, limits)


@cached
def _planes(begin, end, light, pixels):
    """Colour by colour, and each a number."""
    brightest, infinite = F(BRIGHTEST), F(INFINITE)
    for c in range(light.shape[2]):
        for j in range(begin, end):
            for i in range(light.shape[1]):
                value = light[j, i, c]
                if abs(value) < infinite:
                    pixels[c, j, i] = value
                else:
                    pixels[c, j, i] = brightest if value > _ZERO else -brightest if value < _ZERO else _ZERO


@cached
def _filter(c):
    """From light to weights along the columns of c [n, m], in place; the picture goes on mirrored."""
    n, m = c.shape
    if n < 2:
        return
    scale, power = POLE / (POLE * POLE - _ONE), POLE
    first = c[0].copy()
    for k in range(1, HORIZON):
        place = k % (2 * n - 2)
        row = c[min(place, 2 * n - 2 - place)]
        for i in range(m):
            first[i] += power * row[i]
        power *= POLE
    for i in range(m):
        c[0, i] = _SIX * first[i]
    for k in range(1, n):
        here, above = c[k], c[k - 1]
        for i in range(m):
            here[i] = _SIX * here[i] + POLE * above[i]
    here, above = c[n - 1], c[n - 2]
    for i in range(m):
        here[i] = scale * (here[i] + POLE * above[i])
    for k in range(n - 2, -1, -1):
        here, below = c[k], c[k + 1]
        for i in range(m):
            here[i] = POLE * (below[i] - here[i])


@cached
def _filter_rows(c):
    """The same along rows with margins, eight at a time lest the processor wait for each step; margins mirrored."""
    n, last = c.shape[1] - 2 * MARGIN, c.shape[0] - 1
    block = np.empty((n, 8), np.float32)
    for row in range(0, last + 1, 8):  # (eight names, since a loop over them is not unrolled; the last may come again)
        r0, r1, r2, r3 = c[row], c[min(row + 1, last)], c[min(row + 2, last)], c[min(row + 3, last)]
        r4, r5, r6, r7 = (c[min(row + 4, last)], c[min(row + 5, last)], c[min(row + 6, last)], c[min(row + 7, last)])
        for i in range(n):
            b, k = block[i], i + MARGIN
            b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7] = r0[k], r1[k], r2[k], r3[k], r4[k], r5[k], r6[k], r7[k]
        _filter(block)
        for i in range(n):
            b, k = block[i], i + MARGIN
            r0[k], r1[k], r2[k], r3[k], r4[k], r5[k], r6[k], r7[k] = b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]
    for j in range(last + 1):
        for i in range(1, MARGIN + 1):
            c[j, MARGIN - i] = c[j, MARGIN + min(i, n - 1)]
            c[j, n + MARGIN - 1 + i] = c[j, MARGIN + max(n - 1 - i, 0)]


@cached
def _limits(begin, end, pixels, limits):
    """How low and how high the light nearest to each pixel may be."""
    height, width = pixels.shape
    low, high = np.empty(width, np.float32), np.empty(width, np.float32)
    for j in range(begin, end):
        above, here, below = pixels[max(j - 1, 0)], pixels[j], pixels[min(j + 1, height - 1)]
        for i in range(width):
            low[i] = min(min(above[i], here[i]), below[i])
            high[i] = max(max(above[i], here[i]), below[i])
        for i in range(width):
            left, right = max(i - 1, 0), min(i + 1, width - 1)
            dark = min(min(low[left], low[i]), low[right])
            bright = max(max(high[left], high[i]), high[right])
            room = _HALF * (bright - dark)
            limits[j, i, 0] = max(dark - room, _QUARTER * dark) if dark >= _ZERO else dark - room
            limits[j, i, 1] = bright + room
