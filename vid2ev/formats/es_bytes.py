"""The bytes of Event Stream, decoded; what they mean is explained in `es`."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.formats.es import EXPOSURES, OUTSIDE, TIME

EVENT = 5  # bytes


@cached
def decode_dvs(
    state: np.ndarray,
    data: np.ndarray,
    width: int,
    height: int,
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
) -> tuple[int, int]:
    """Fill t, x, y, p from whole events; returns the numbers of bytes used and events found."""
    now, used, found = state[TIME], 0, 0
    while used < len(data):
        first = np.int64(data[used])
        if first >= 0xFE:
            now += 0x7F if first == 0xFF else 0
            used += 1
            continue
        if used + EVENT > len(data):
            break
        now += first >> 1
        column = np.int64(data[used + 1]) | np.int64(data[used + 2]) << 8
        row = np.int64(data[used + 3]) | np.int64(data[used + 4]) << 8
        if column < width and row < height:
            t[found], x[found], y[found], p[found] = now, column, height - 1 - row, first & 1
            found += 1
        else:
            state[OUTSIDE] += 1
        used += EVENT
    state[TIME] = now
    return used, found


@cached
def decode_atis(
    state: np.ndarray,
    data: np.ndarray,
    width: int,
    height: int,
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
) -> tuple[int, int]:
    """The same for ATIS."""
    now, used, found = state[TIME], 0, 0
    while used < len(data):
        first = np.int64(data[used])
        if first >= 0xFC:
            now += 0x3F * (first & 3)
            used += 1
            continue
        if used + EVENT > len(data):
            break
        now += first >> 2
        column = np.int64(data[used + 1]) | np.int64(data[used + 2]) << 8
        row = np.int64(data[used + 3]) | np.int64(data[used + 4]) << 8
        if first & 1:
            state[EXPOSURES] += 1
        elif column < width and row < height:
            t[found], x[found], y[found], p[found] = now, column, height - 1 - row, first >> 1 & 1
            found += 1
        else:
            state[OUTSIDE] += 1
        used += EVENT
    state[TIME] = now
    return used, found
