"""Events of one interval in order of (time, row, column).

A stable counting sort of the keys on their microsecond, in passes of 16 bits (one pass for intervals up to 65 ms),
then an insertion sort on the pixel within each microsecond: keys come block by block and each pixel's in order of
time, so it finds them nearly sorted.
"""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_cache import compiled

_TIME, _PIXEL = np.uint64(28), np.uint64(3)
_PASS = np.uint64(16)


@compiled
def sorted_by_time(keys, n, last_us):
    """keys[:n] stably sorted on their time, which is at most last_us."""
    source = keys
    shift = _TIME
    left = last_us
    while left > 0 or shift == _TIME:
        bins = min(left, np.int64(65535)) + 1
        start = np.zeros(bins + 1, np.int64)
        mask = np.uint64(0xFFFF)
        for i in range(n):
            start[np.int64((source[i] >> shift) & mask) + 1] += 1
        for k in range(bins):
            start[k + 1] += start[k]
        target = np.empty(n, np.uint64)
        for i in range(n):
            k = np.int64((source[i] >> shift) & mask)
            target[start[k]] = source[i]
            start[k] += 1
        source = target
        shift += _PASS
        left >>= np.int64(16)
    for i in range(1, n):
        key = source[i]
        rank = key >> _PIXEL
        j = i
        while j > 0 and source[j - 1] >> _PIXEL > rank:
            source[j] = source[j - 1]
            j -= 1
        source[j] = key
    return source


@compiled
def unpack(keys, width, first_us, t, x, y, p, label):
    """Keys to the arrays of `Events`; `label` has length 0 where none are wanted."""
    per_pixel = 1.0 / width
    for i in range(keys.size):
        key = keys[i]
        pixel = np.int64((key >> _PIXEL) & np.uint64(0x1FFFFFF))
        row = np.int64((np.float64(pixel) + 0.5) * per_pixel)
        t[i] = first_us + np.int64(key >> _TIME)
        x[i] = np.uint16(pixel - row * width)
        y[i] = np.uint16(row)
        p[i] = np.uint8((key >> np.uint64(2)) & np.uint64(1))
    for i in range(label.size):
        label[i] = np.uint8(keys[i] & np.uint64(3))
