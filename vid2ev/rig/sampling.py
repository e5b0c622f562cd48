"""Light between the pixels of a picture.

It is that of a cubic spline through the pixels (`spline.py`), held to what the pixels around the place allow.

**Near an edge of the scene** (`near_cut` of a surface) the spline would mix what is before with what is behind.  There
cubic convolution (Keys, a = -1/2) looks at the sixteen pixels around, and those that are not on the surface of the
nearest one count as that one.

**Pixels with an area.**  A camera's pixel is the mean of `samples` x `samples` places in it.

Source: R. G. Keys, "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29(6), 1981.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.compiling.cache import cached
from vid2ev.rig.bands import Bands
from vid2ev.rig.spline import MARGIN, Spline

F = np.float32
_NOWHERE = np.zeros((0, 0), np.bool_)
_SIXTH, _HALF, _ONE, _TWO, _ZERO = F(1 / 6), F(0.5), F(1), F(2), F(0)
_TWO_THIRDS = F(2 / 3)
_I, _II, _III = np.uintp(1), np.uintp(2), np.uintp(3)


def sampled(
    spline: Spline,
    x: np.ndarray,
    y: np.ndarray,
    bands: Bands,
    near_cut: np.ndarray = _NOWHERE,
    inverse: np.ndarray = _NOWHERE,
    steep: float = 0.0,
) -> np.ndarray:
    """Light [h, w, C] at places x, y [h, w] float32 of a picture; beyond its border, that of the border.

    near_cut, inverse, steep   those of a surface, if the picture is of one
    """
    out = np.empty((*x.shape, len(spline.pixels)), F)

    def sample(begin: int, end: int) -> None:
        _sample(spline.weights, spline.limits, x, y, begin, end, out)
        if near_cut.size:
            _sample_beside_cuts(spline.pixels, x, y, near_cut, inverse, F(steep), begin, end, out)

    bands.run(len(x), sample)
    return out


def pixel_means(fine: np.ndarray, samples: int) -> np.ndarray:
    """Means [h, w, C] of samples x samples places each, of [samples h, samples w, C]."""
    if samples == 1:
        return fine
    height, width, channels = fine.shape
    out = np.empty((height // samples, width // samples, channels), F)
    _means(fine, samples, out)
    return out


@cached
def _sample(weights, limits, x, y, begin, end, out):
    """Rows of places, each twice: once for where they are and for the weights of the splines there, once for light."""
    channels, height, width, _ = limits.shape
    step = np.uintp(width + 2 * MARGIN)
    splines, allowed = weights.reshape(channels, -1), limits.reshape(channels, height * width, 2)
    shares = np.empty((x.shape[1], 8), np.float32)
    firsts, owns = np.empty(x.shape[1], np.uintp), np.empty(x.shape[1], np.uintp)
    for j in range(begin, end):
        _place(x[j], y[j], width, height, shares, firsts, owns)
        for i in range(x.shape[1]):
            x0, x1, x2, x3 = shares[i, 0], shares[i, 1], shares[i, 2], shares[i, 3]
            y0, y1, y2, y3 = shares[i, 4], shares[i, 5], shares[i, 6], shares[i, 7]
            first, second, third, fourth = firsts[i], firsts[i] + step, firsts[i] + _II * step, firsts[i] + _III * step
            for c in range(channels):
                p = splines[c]  # (columns first: the four of them become one vector)
                v0 = y0 * p[first] + y1 * p[second] + (y2 * p[third] + y3 * p[fourth])
                v1 = y0 * p[first + _I] + y1 * p[second + _I] + (y2 * p[third + _I] + y3 * p[fourth + _I])
                v2 = y0 * p[first + _II] + y1 * p[second + _II] + (y2 * p[third + _II] + y3 * p[fourth + _II])
                v3 = y0 * p[first + _III] + y1 * p[second + _III] + (y2 * p[third + _III] + y3 * p[fourth + _III])
                light = (x0 * v0 + x1 * v1) + (x2 * v2 + x3 * v3)
                out[j, i, c] = min(max(light, allowed[c, owns[i], 0]), allowed[c, owns[i], 1])


@njit(nogil=True, error_model="numpy", inline="always")
def _place(x, y, width, height, shares, firsts, owns):
    """A row of places: the weights of four columns and four rows, the first of these sixteen, and the nearest pixel."""
    x_last, y_last = F(width - 1), F(height - 1)
    for i in range(len(x)):
        across, down = min(max(x[i], _ZERO), x_last), min(max(y[i], _ZERO), y_last)
        left, top = np.int32(across), np.int32(down)
        a, b = across - F(left), down - F(top)
        shares[i, 0], shares[i, 1], shares[i, 2], shares[i, 3] = spline_weights(a)
        shares[i, 4], shares[i, 5], shares[i, 6], shares[i, 7] = spline_weights(b)
        firsts[i] = (top + (MARGIN - 1)) * (width + 2 * MARGIN) + left + (MARGIN - 1)
        owns[i] = (top + (b >= _HALF)) * width + left + (a >= _HALF)


@njit(nogil=True, error_model="numpy", inline="always")
def spline_weights(a):
    """The weights of four splines for a place a beyond the second."""
    b = _ONE - a
    w0, w3 = _SIXTH * b * b * b, _SIXTH * a * a * a
    w1 = _TWO_THIRDS - a * a * (_ONE - _HALF * a)
    return w0, w1, _ONE - w0 - w1 - w3, w3


@njit(nogil=True, error_model="numpy", inline="always")
def keys_weights(a):
    """The weights of four pixels for a place a beyond the second (Keys, a = -1/2)."""
    b = _ONE - a
    w0, w3 = -_HALF * a * b * b, -_HALF * a * a * b
    w2 = a * (_HALF + a * (_TWO - F(1.5) * a))
    return w0, _ONE - w0 - w2 - w3, w2, w3


@cached
def _sample_beside_cuts(pixels, x, y, near_cut, inverse, steep, begin, end, out):
    """Places near cuts once more, by cubic convolution among the pixels of one surface."""
    height, width = near_cut.shape
    x_last, y_last = F(width - 1), F(height - 1)
    columns, rows, weights = np.empty(16, np.int64), np.empty(16, np.int64), np.empty(16, np.float32)
    for j in range(begin, end):
        for i in range(x.shape[1]):
            across, down = min(max(x[j, i], _ZERO), x_last), min(max(y[j, i], _ZERO), y_last)
            own_x, own_y = int(across + _HALF), int(down + _HALF)
            if not near_cut[own_y, own_x]:
                continue
            left, top, depth, count = int(across), int(down), inverse[own_y, own_x], 0
            weights_x, weights_y = keys_weights(across - F(left)), keys_weights(down - F(top))
            for m in range(4):
                row = min(max(top + m - 1, 0), height - 1)
                for n in range(4):
                    column = min(max(left + n - 1, 0), width - 1)
                    there, away = inverse[row, column], F(max(abs(row - own_y), abs(column - own_x)))
                    if abs(there - depth) <= steep * away * max(there, depth):
                        columns[count], rows[count], weights[count] = column, row, weights_y[m] * weights_x[n]
                        count += 1
            for c in range(out.shape[2]):
                own = pixels[c, own_y, own_x]
                total, low, high = _ZERO, own, own
                for k in range(count):
                    light = pixels[c, rows[k], columns[k]]
                    total += weights[k] * (light - own)
                    low, high = min(low, light), max(high, light)
                out[j, i, c] = min(max(own + total, low), high)


@cached
def _means(fine, samples, out):
    share = F(1) / F(samples * samples)
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            for c in range(out.shape[2]):
                first = fine[j * samples, i * samples, c]  # (sums of differences: flat light stays exactly flat)
                total = _ZERO
                for m in range(j * samples, (j + 1) * samples):
                    for n in range(i * samples, (i + 1) * samples):
                        total += fine[m, n, c] - first
                out[j, i, c] = first + share * total
