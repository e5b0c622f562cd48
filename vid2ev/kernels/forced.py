"""Events that the light does not cause: candidates of shot noise and hot pixels within one interval.

Candidates belong to cells (k, k + 1] of a fixed 1 ms clock (and, for shot noise, to aligned blocks of pixels), so an
interval takes from each cell it touches those that lie in (t0, t1], however the light is sampled.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import INPUT, PITCH
from vid2ev.kernels.scratch import NEW
from vid2ev.physics.elementary import log64
from vid2ev.physics.log_curve import light_at
from vid2ev.physics.random import HOT, SHOT, philox, unit
from vid2ev.physics.shot import CELL_NS, CELL_PIXELS, shot_share

LOCAL = np.int64(52)  # bit at which the pixel stands in the key that orders candidates


@inner
def longer(keys, chance, n):
    """Copies of the buffers, twice as long, with their first n entries."""
    more_keys, more_chance = np.empty(2 * keys.size, np.int64), np.empty(2 * keys.size, np.float64)
    for i in range(n):
        more_keys[i], more_chance[i] = keys[i], chance[i]
    return more_keys, more_chance


@inner
def shot_of_cell(keys, chance, n, p0, pixels, cell, num, iv):
    """Add the shots of a cell; returns how many candidates there are then, or -1 if the buffers are too short.

    Arrivals in a cell are equally likely anywhere in (pixels of the block) x (time): a walk of exponential gaps.
    """
    per_block = CELL_PIXELS * num.shot_rate_hz * CELL_NS * 1e-9
    place, k, last = 0.0, 0, iv.t0_ns + np.int64(iv.dt_ns)
    while True:
        words = philox(num.seed, SHOT + 256 * num.camera, np.int64(p0 // CELL_PIXELS) | (k << 15), cell)
        place -= log64(unit(words[0])) / per_block
        if place * CELL_PIXELS >= pixels:  # (and however far beyond)
            return n
        local = np.int64(place * CELL_PIXELS)
        if n == keys.size:
            return -1
        t_ns = cell * CELL_NS + 1 + np.int64(unit(words[1]) * CELL_NS)
        keys[n] = (local << LOCAL) | (t_ns - iv.t0_ns)
        chance[n] = (1.0 if words[3] & np.uint32(1) else -1.0) * unit(words[2])
        n += np.int64((t_ns > iv.t0_ns) & (t_ns <= last))
        k += 1


@inner
def hot_of_cell(keys, chance, n, p0, pixel, cell, num, iv):
    """Add the events of a hot pixel in a cell; returns as `shot_of_cell` does."""
    gap_ns, k, last = 1e9 / num.hot_rate_hz, 0, iv.t0_ns + np.int64(iv.dt_ns)
    place = 0.0
    while True:
        words = philox(num.seed, HOT + 256 * num.camera, pixel, (cell << 17) + k)
        place -= log64(unit(words[0])) * gap_ns
        if place >= CELL_NS:
            return n
        if n == keys.size:
            return -1
        t_ns = cell * CELL_NS + 1 + np.int64(place)
        keys[n], chance[n] = ((pixel - p0) << LOCAL) | (t_ns - iv.t0_ns), 0.0
        n += np.int64((t_ns > iv.t0_ns) & (t_ns <= last))
        k += 1


@inner
def candidates(keys, chance, p0, pixels, hot, num, iv):
    """Candidates of a block by pixel and time, into buffers that grow: (keys, chance, their number).

    `chance` is 0 for a hot pixel's event, else polarity (its sign) and the number in (0, 1) that the share of the rate
    left at the light must exceed.
    """
    n = np.int64(0)
    first, last = iv.t0_ns // CELL_NS, (iv.t0_ns + np.int64(iv.dt_ns) - 1) // CELL_NS
    if num.shot_rate_hz > 0.0:
        for cell in range(first, last + 1):
            more = shot_of_cell(keys, chance, n, p0, pixels, cell, num, iv)
            while more < 0:
                keys, chance = longer(keys, chance, n)
                more = shot_of_cell(keys, chance, n, p0, pixels, cell, num, iv)
            n = more
    if num.hot_rate_hz > 0.0:
        for h in range(first_from(hot, p0), first_from(hot, p0 + pixels)):
            for cell in range(first, last + 1):
                more = hot_of_cell(keys, chance, n, p0, np.int64(hot[h]), cell, num, iv)
                while more < 0:
                    keys, chance = longer(keys, chance, n)
                    more = hot_of_cell(keys, chance, n, p0, np.int64(hot[h]), cell, num, iv)
                n = more
    if n > 64:
        keys, chance = sorted_by_pixel(keys, chance, n)
    for i in range(1, n):  # now mostly in order
        key, share, j = keys[i], chance[i], i
        while j > 0 and keys[j - 1] > key:
            keys[j], chance[j] = keys[j - 1], chance[j - 1]
            j -= 1
        keys[j], chance[j] = key, share
    return keys, chance, n


@inner
def sorted_by_pixel(keys, chance, n):
    """The first n candidates counted into the order of their pixels."""
    start = np.zeros(CELL_PIXELS + 1, np.int64)
    for i in range(n):
        start[(keys[i] >> LOCAL) + 1] += 1
    for k in range(CELL_PIXELS):
        start[k + 1] += start[k]
    ordered, shares = np.empty(keys.size, np.int64), np.empty(keys.size, np.float64)
    for i in range(n):
        k = keys[i] >> LOCAL
        ordered[start[k]], shares[start[k]] = keys[i], chance[i]
        start[k] += 1
    return ordered, shares


@inner
def place_of_candidate(key, iv):
    """(pixel of the block, fraction of the interval) of a candidate."""
    return key >> LOCAL, np.float64(key & ((np.int64(1) << LOCAL) - 1)) / iv.dt_ns


@inner
def keep_likely(block, scratch, keys, chance, n, flags, num, iv):
    """Drop the candidates of shot noise that the light at their instant does not ask for; returns how many are left."""
    left = 0
    for j in range(n):
        i, s = place_of_candidate(keys[j], iv)
        before, after = np.float64(block[INPUT * PITCH + i]), np.float64(scratch[NEW + i])
        light = before + (after - before) * s
        if len(flags.log_input):
            light = light_at(light, num.curve)
        if chance[j] == 0.0 or abs(chance[j]) < shot_share(light, num.shot_light_factor):
            keys[left], chance[left] = keys[j], chance[j]
            left += 1
    return left


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
