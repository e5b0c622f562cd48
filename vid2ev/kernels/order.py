"""Events of each interval in order of (time, row, column), by as many threads as there are parts.

A stable counting sort of the keys on their microsecond, in passes of 16 bits (one pass for intervals up to 65 ms), then
an insertion sort on the pixel within each microsecond: keys come part by part, block by block and each pixel's in order
of time, so it finds them nearly sorted.  Where many are of one microsecond it may not, as crossings that are drawn anew
come in rounds of many pixels: then pixels are counted, too.

A place is counted for each microsecond and row; parts that are put at the same time have a row each, as what is of the
first goes before what is of the second, and else one row does for all.  Keys that are few beside the microseconds are
taken as they come, and put in order in passes of 8 bits.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.layout import PIXEL_LIMIT

_TIME, _PIXEL = np.uint64(28), np.uint64(3)
_PASS, _SHORT_PASS = np.uint64(16), np.uint64(8)
LAST_OF_PASS = 0xFFFF  # the last microsecond that one pass can tell from all others
_FAR = 64  # places that keys are moved by on average, with which to count takes less time


@compiled
def sizes_of(ends, sizes):
    """Add to sizes [frames] how many keys of a part each frame has; of group g and frame k they end at ends[g, k]."""
    for group in range(ends.shape[0]):
        for k in range(ends.shape[1]):
            first, last = run_of(ends, group, k)
            sizes[k] += last - first


@compiled
def count_keys(keys, ends, first, last, places):
    """Count those of a part in frames first ... last - 1 by their microsecond: places [frames, microseconds]."""
    for k in range(first, last):
        for group in range(ends.shape[0]):
            begin, end = run_of(ends, group, k)
            count(keys[begin:end], _TIME, _PASS, places[k - first])


@compiled
def lay_out(places, stops):
    """Counts [rows, frames, microseconds] become places, frame after frame; stops [frames] where each frame ends."""
    total = np.int64(0)
    for k in range(places.shape[1]):
        for microsecond in range(places.shape[2]):
            for row in range(places.shape[0]):
                counted = places[row, k, microsecond]
                places[row, k, microsecond] = total
                total += counted
        stops[k] = total


@compiled
def put_keys(keys, ends, first, last, places, ordered):
    """Those of a part in frames first ... last - 1 to their places in `ordered`."""
    for k in range(first, last):
        for group in range(ends.shape[0]):
            begin, end = run_of(ends, group, k)
            put(keys[begin:end], _TIME, _PASS, places[k - first], ordered)


@compiled
def take_keys(keys, ends, first, last, filled, taken):
    """Those of a part in frames first ... last - 1 as they are to `taken`, from where each is filled to [frames]."""
    for k in range(first, last):
        place = filled[k - first]
        for group in range(ends.shape[0]):
            begin, end = run_of(ends, group, k)
            for i in range(begin, end):
                taken[place] = keys[i]
                place += 1
        filled[k - first] = place


@inner
def run_of(ends, group, frame):
    """Where the keys of a group and frame begin and end."""
    if frame > 0:
        return ends[group, frame - 1], ends[group, frame]
    return (ends[group - 1, ends.shape[1] - 1] if group > 0 else np.int64(0)), ends[group, 0]


@inner
def digit_of(key, shift, bits):
    """A digit of so many bits."""
    return np.int64((key >> shift) & ((np.uint64(1) << bits) - np.uint64(1)))


@inner
def count(keys, shift, bits, places):
    """Count keys by a digit."""
    for i in range(keys.size):
        places[digit_of(keys[i], shift, bits)] += 1


@inner
def put(keys, shift, bits, places, target):
    """Each key to the next place of its digit."""
    for i in range(keys.size):
        k = digit_of(keys[i], shift, bits)
        target[places[k]] = keys[i]
        places[k] += 1


@inner
def order_digits(keys, shift, bits, most):
    """Put keys in order of the digits from a shift on, which are numbers up to `most`; stable."""
    target = np.empty(keys.size, np.uint64)
    while most > 0:
        places = np.zeros((1, 1, min(most, (np.int64(1) << np.int64(bits)) - 1) + 1), np.int64)
        count(keys, shift, bits, places[0, 0])
        lay_out(places, np.empty(1, np.int64))
        put(keys, shift, bits, places[0, 0], target)
        for i in range(keys.size):  # (a slice would be checked, and the message of that takes a second to compile)
            keys[i] = target[i]
        shift, most = shift + bits, most >> np.int64(bits)


@inner
def order_pixels(keys, last_us):
    """Keys in order of microseconds, up to last_us, to that of the pixels within each; stable."""
    left = _FAR * keys.size
    for i in range(1, keys.size):
        key = keys[i]
        rank = key >> _PIXEL
        j = i
        while j > 0 and keys[j - 1] >> _PIXEL > rank:
            keys[j] = keys[j - 1]
            j -= 1
        keys[j] = key
        left -= i - j
        if left < 0:
            order_digits(keys, _PIXEL, _PASS, (last_us + 1) * PIXEL_LIMIT - 1)
            return


@compiled
def unpack(keys, taken, stops, first_us, last_us, share, shares, width, t, x, y, p, label):
    """A share of the keys of each frame, which end at stops [frames], to the arrays of `Events`.

    Keys of a frame count their times from first_us [frames], at the most to last_us; above `LAST_OF_PASS`, or where
    they are as they were `taken`, the share is all.  `label` has length 0 where none are wanted.
    """
    begin = np.int64(0)
    for k in range(stops.size):
        frame = keys[begin : stops[k]]
        if taken:
            order_digits(frame, _TIME, _SHORT_PASS, last_us[k])
        elif last_us[k] > LAST_OF_PASS:
            order_digits(frame, _TIME + _PASS, _PASS, last_us[k] >> np.int64(_PASS))
        i, j = cut_of(frame, share, shares), cut_of(frame, share + 1, shares)
        mine, first, last = frame[i:j], begin + i, begin + j
        order_pixels(mine, last_us[k])
        unpack_keys(mine, width, first_us[k], t[first:last], x[first:last], y[first:last], p[first:last])
        for i in range(min(mine.size, label.size)):
            label[first + i] = np.uint8(mine[i] & np.uint64(3))
        begin = stops[k]


@inner
def cut_of(keys, share, shares):
    """Where a share of the keys begins, at the first of a microsecond (which other threads may put in order of
    pixels meanwhile: its keys have the same time)."""
    i = keys.size * share // shares
    while 0 < i < keys.size and keys[i] >> _TIME == keys[i - 1] >> _TIME:
        i += 1
    return i


@compiled
def unpack_frames(keys, ends, first_us, width, t, x, y, p, label):
    """Keys in no order to the arrays of `Events`: those of run k, of a frame that begins at first_us[k], end at
    ends[k]."""
    first = np.int64(0)
    for k in range(ends.size):
        last = ends[k]
        unpack_keys(keys[first:last], width, first_us[k], t[first:last], x[first:last], y[first:last], p[first:last])
        first = last
    for i in range(min(keys.size, label.size)):
        label[i] = np.uint8(keys[i] & np.uint64(3))


@inner
def unpack_keys(keys, width, first_us, t, x, y, p):
    """Keys to times, columns, rows and polarities."""
    per_pixel = 1.0 / width
    for i in range(keys.size):
        key = keys[i]
        pixel = np.int64((key >> _PIXEL) & np.uint64(0x1FFFFFF))
        row = np.int64((np.float64(pixel) + 0.5) * per_pixel)
        t[i] = first_us + np.int64(key >> _TIME)
        x[i] = np.uint16(pixel - row * width)
        y[i] = np.uint16(row)
        p[i] = np.uint8((key >> np.uint64(2)) & np.uint64(1))
