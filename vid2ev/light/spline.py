"""A photograph seen by a camera that may be turned and zoomed, in linear light.

Every output pixel is a mean of the light around its place, weighted with the cubic B-spline

    b(u) = 2/3 - u**2 + |u|**3 / 2      |u| <= 1
           (2 - |u|)**3 / 6             1 <= |u| <= 2

where u is the distance along the photograph's rows, or columns, in output pixels, or in pixels of the photograph where
these are larger.  It is what the blur of a lens and the width of a pixel do.  The weight is never negative, so there is
no ringing; it is smooth twice over, so that light changes smoothly as the camera moves; it blurs almost alike wherever
between two pixels it falls, so that contrast does not beat with the motion; and it passes nothing that would alias.

Source: Unser, "Splines: a perfect fit for signal and image processing", IEEE Signal Processing Magazine 16(6), 1999.
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.light.resample import Taps, resampled


def seen(
    photograph: np.ndarray, size: tuple[int, int], centre: tuple[float, float], degrees: float, scale: float
) -> np.ndarray:
    """Light [float32, H x W or H x W x 3] that a camera of `size` (width, height) sees of a photograph.

    centre    the place in the photograph [px from its upper left corner] in the middle of the picture
    degrees   by which the camera is turned clockwise
    scale     output pixels per pixel of the photograph

    What lies outside is as the nearest pixel of the border.
    """
    width, height = size
    if degrees == 0:
        rows = spline_taps(photograph.shape[0], centre[1] - height / 2 / scale, 1 / scale, height)
        columns = spline_taps(photograph.shape[1], centre[0] - width / 2 / scale, 1 / scale, width)
        return resampled(photograph, rows, columns)
    turn = math.radians(degrees)
    planes = np.ascontiguousarray(photograph if photograph.ndim == 3 else photograph[..., None])
    out = np.empty((height, width, planes.shape[2]), np.float32)
    _turned(planes, centre[0], centre[1], math.cos(turn) / scale, math.sin(turn) / scale, 1 / scale, out)
    return out if photograph.ndim == 3 else out[..., 0]


def spline_taps(length: int, begin: float, step: float, outputs: int) -> Taps:
    """The taps of `outputs` pixels, `step` pixels wide each, from `begin` on, of an axis of `length` pixels."""
    most = math.ceil(4 * max(step, 1)) + 1
    first, weights = np.empty(outputs, np.int64), np.zeros((outputs, most), np.float32)
    _taps(length, begin, step, first, weights)
    return Taps(first, np.minimum(most, length - first), weights)


@inner
def _weights(place, width, length, weights):
    """Weights about a place, those beyond the border moved on to it; the first pixel they are for."""
    low = int(np.floor(place - 2 * width - 0.5)) + 1
    first = min(max(low, 0), length - 1)
    weights[:] = 0
    total = 0.0
    for k in range(low, low + int(np.ceil(4 * width)) + 1):
        u = abs(k + 0.5 - place) / width
        weight = (2 / 3 - u * u + u * u * u / 2) if u <= 1 else (2 - u) ** 3 / 6 if u < 2 else 0.0
        weights[min(max(k, 0), length - 1) - first] += weight
        total += weight
    for k in range(weights.size):
        weights[k] /= total
    return first


@compiled
def _taps(length, begin, step, firsts, weights):
    row = np.empty(weights.shape[1], np.float64)
    for i in range(firsts.size):
        firsts[i] = _weights(begin + (i + 0.5) * step, max(step, 1.0), length, row)
        weights[i] = row


@compiled
def _turned(photograph, centre_x, centre_y, along, across, step, out):
    height, width, channels = out.shape
    rows, columns, _ = photograph.shape
    most = int(np.ceil(4 * max(step, 1.0))) + 1
    weight_x, weight_y = np.empty(most), np.empty(most)
    for j in range(height):
        for i in range(width):
            right, down = i + 0.5 - width / 2, j + 0.5 - height / 2
            x, y = centre_x + right * along - down * across, centre_y + right * across + down * along
            first_x = _weights(x, max(step, 1.0), columns, weight_x)
            first_y = _weights(y, max(step, 1.0), rows, weight_y)
            for c in range(channels):
                total = 0.0
                for k in range(min(most, rows - first_y)):
                    row = 0.0
                    for m in range(min(most, columns - first_x)):
                        row += weight_x[m] * photograph[first_y + k, first_x + m, c]
                    total += weight_y[k] * row
                out[j, i, c] = total
