"""A picture on another grid, in linear light.

An output pixel is as wide as `s` input pixels.  Along each axis

    s >= 1   the mean of the light over [a, a + s), parts of pixels counted as parts: what a larger pixel collects
    s < 1    a straight line between the two nearest pixel centres

Both keep a flat picture flat, and neither makes light below the darkest or above the brightest pixel it sees.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled, inner


class Taps(NamedTuple):
    """Which pixels make each output pixel along an axis."""

    first: np.ndarray  # [outputs] the first pixel
    taps: np.ndarray  # [outputs] how many
    weights: np.ndarray  # [outputs, most]


def taps_of(length: int, begin: Fraction, extent: Fraction, outputs: int) -> Taps:
    """The taps for `outputs` pixels over [begin, begin + extent) of an axis of `length` pixels."""
    step = extent / outputs
    rows = [_mean(begin + i * step, step) if step >= 1 else _line(begin + (i + Fraction(1, 2)) * step, length)
            for i in range(outputs)]  # fmt: skip
    most = max(len(weights) for _, weights in rows)
    padded = np.zeros((outputs, most), np.float32)
    for row, (_, weights) in zip(padded, rows, strict=True):
        row[: len(weights)] = weights
    first = np.array([place for place, _ in rows], np.int64)
    return Taps(first, np.array([len(weights) for _, weights in rows], np.int64), padded)


def resampled(light: np.ndarray, rows: Taps, columns: Taps) -> np.ndarray:
    """The picture [float32, outputs x outputs or with 3 more] of a picture [H, W] or [H, W, 3]."""
    planes = np.ascontiguousarray(light if light.ndim == 3 else light[..., None])
    out = np.empty((rows.first.size, columns.first.size, planes.shape[2]), np.float32)
    _resample(planes, tuple(rows), tuple(columns), out)
    return out if light.ndim == 3 else out[..., 0]


def _mean(begin: Fraction, step: Fraction) -> tuple[int, list[float]]:
    end = begin + step
    places = range(math.floor(begin), math.ceil(end))
    return places[0], [float((min(Fraction(k + 1), end) - max(Fraction(k), begin)) / step) for k in places]


def _line(centre: Fraction, length: int) -> tuple[int, list[float]]:
    place = min(max(centre - Fraction(1, 2), Fraction(0)), Fraction(length - 1))
    below = math.floor(place)
    return below, [1.0] if place == below else [float(1 - (place - below)), float(place - below)]


@compiled
def _resample(light, rows, columns, out):
    first_row, row_count, row_weights = rows
    first_column, column_count, column_weights = columns
    height, width, channels = light.shape
    lines, row = light.reshape(height, width * channels), np.empty(width * channels, np.float32)
    for j in range(out.shape[0]):
        _add_lines(lines, first_row[j], row_weights[j, : row_count[j]], row)
        for c in range(channels):
            _add_columns(row, c, channels, first_column, column_count, column_weights, out[j, :, c])


@inner
def _add_lines(lines, first, weights, row):
    """The weighted sum of lines from the first one on."""
    row[:] = 0
    for k in range(weights.size):
        weight, line = weights[k], lines[first + k]
        for x in range(row.size):
            row[x] += weight * line[x]


@inner
def _add_columns(row, channel, channels, first, counts, weights, out):
    """The weighted sums of the pixels of a row, in one of its channels."""
    flat, most, next_pixel = weights.reshape(-1), np.uintp(weights.shape[1]), np.uintp(channels)
    for i in range(np.uintp(out.size)):
        total, place = np.float32(0), np.uintp(first[i]) * next_pixel + np.uintp(channel)
        for k in range(np.uintp(counts[i])):
            total += flat[i * most + k] * row[place + k * next_pixel]
        out[i] = total
