"""Events of one interval in order of (time, row, column), by as many threads as there are parts.

Each part is ordered by itself: a stable counting sort of the keys on their microsecond, in passes of 16 bits (one pass
for intervals up to 65 ms), then an insertion sort on the pixel within each microsecond: keys come block by block and
each pixel's in order of time, so it finds them nearly sorted.  Then each thread merges a share of the time; of keys at
the same microsecond those of the first part come first, as its pixels do.
"""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_compiler import compiled, inner

_TIME, _PIXEL = np.uint64(28), np.uint64(3)
_PASS, _MASK = np.uint64(16), np.uint64(0xFFFF)
_NEVER = np.uint64(1 << 36)


@compiled
def order_keys(keys, begins, ends, last_us, ordered):
    """Those of a part, keys[begins[k] : ends[k]] of all k, into `ordered`; their time is at most last_us."""
    source, shift, left = keys, _TIME, last_us
    places = np.empty(min(last_us, np.int64(_MASK)) + 1, np.int64)
    while True:
        target = ordered if left <= np.int64(_MASK) else np.empty(ordered.size, np.uint64)
        to_places(source, begins, ends, shift, places)
        for run in range(begins.size):
            for i in range(begins[run], ends[run]):
                k = np.int64((source[i] >> shift) & _MASK)
                target[places[k]] = source[i]
                places[k] += 1
        if left <= np.int64(_MASK):
            break
        source, shift, left = target, shift + _PASS, left >> np.int64(_PASS)
        begins, ends = np.zeros(1, np.int64), np.full(1, ordered.size)
    order_pixels(ordered)


@inner
def to_places(keys, begins, ends, shift, places):
    """Where the keys of each digit begin in the order of digits."""
    for k in range(places.size):
        places[k] = 0
    for run in range(begins.size):
        for i in range(begins[run], ends[run]):
            places[np.int64((keys[i] >> shift) & _MASK)] += 1
    total = np.int64(0)
    for k in range(places.size):
        places[k], total = total, total + places[k]


@inner
def order_pixels(keys):
    """Insertion sort on the pixel within each microsecond."""
    for i in range(1, keys.size):
        key = keys[i]
        rank = key >> _PIXEL
        j = i
        while j > 0 and keys[j - 1] >> _PIXEL > rank:
            keys[j] = keys[j - 1]
            j -= 1
        keys[j] = key


@compiled
def unpack(keys, ends, share, shares, width, first_us, t, x, y, p, label):
    """A share of the time of the ordered parts keys[ends[k] : ends[k + 1]] to the arrays of `Events`.

    `label` has length 0 where none are wanted.
    """
    heads, stops = share_of(keys, ends, share, shares), share_of(keys, ends, share + 1, shares)
    first, last = np.int64(0), np.int64(0)
    for k in range(heads.size):
        first, last = first + heads[k] - ends[k], last + stops[k] - ends[k]
    mine = keys[first:last] if heads.size == 1 else merged(keys, heads, stops, np.empty(last - first, np.uint64))
    unpack_keys(mine, width, first_us, t[first:last], x[first:last], y[first:last], p[first:last])
    for i in range(min(mine.size, label.size)):
        label[first + i] = np.uint8(mine[i] & np.uint64(3))


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
def share_of(keys, ends, share, shares):
    """Where a share of the time begins in each part: at what is that share of the longest part."""
    longest, begins = 0, np.empty(ends.size - 1, np.int64)
    for k in range(begins.size):
        begins[k] = ends[k] if share == 0 else ends[k + 1]
        if ends[k + 1] - ends[k] > ends[longest + 1] - ends[longest]:
            longest = k
    if 0 < share < shares:
        time = keys[ends[longest] + (ends[longest + 1] - ends[longest]) * share // shares] >> _TIME
        for k in range(begins.size):
            begins[k] = ends[k] + first_from(keys[ends[k] : ends[k + 1]], time << _TIME)
    return begins


@inner
def first_from(numbers, least):
    """Index of the first of the ascending `numbers` that is at least `least`."""
    low, high = 0, numbers.size
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@inner
def merged(keys, heads, stops, into):
    """keys[heads[k] : stops[k]] of all parts k in order of (time, part): run by run of one part."""
    n = 0
    while n < into.size:
        part, earliest, limit = 0, _NEVER, _NEVER  # whose turn it is, and the time at which it no longer is
        for k in range(heads.size):
            time = keys[heads[k]] >> _TIME if heads[k] < stops[k] else _NEVER
            if time < earliest:
                part, earliest, limit = k, time, earliest
            else:
                limit = min(limit, time + np.uint64(1))
        i, stop = heads[part], stops[part]
        while i < stop and keys[i] >> _TIME < limit:
            into[n] = keys[i]
            i, n = i + 1, n + 1
        heads[part] = i
    return into


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
