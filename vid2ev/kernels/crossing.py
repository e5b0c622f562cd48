"""Levels are reached: the memories move, events are sent unless a pixel is refractory.

Every slow path ends in `cross_all`, so there is one text of what a crossing does.  It takes a batch of lanes, one
crossing each, in loops that vectorise.  An event is a 64-bit key,

    microseconds after the interval's first_us << 28 | pixel << 3 | polarity << 2 | label
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernels.layout import HIGH, LOW, PITCH, SWALLOWED, place_of, stride_of
from vid2ev.kernels.scan import MARGIN, compared
from vid2ev.physics.crossing_noise import noisy_thresholds

SIGNAL, SHOT, LEAK, HOT = range(4)

# The planes of the lanes that `cross_all` reads and writes; those of the slow paths follow.
LABEL, SCAN_ON, SCAN_OFF, AT, UP, WHEN, LEVEL_ON, LEVEL_OFF = (k * PITCH for k in range(8))
FREE = 8 * PITCH


@njit(cache=True, nogil=True, error_model="numpy")
def room(out, n, more):
    """`out`, or a copy of at least twice the length where `more` keys after n would not fit."""
    if n + more <= out.size:
        return out
    longer = np.empty(max(2 * out.size, n + more), np.uint64)
    longer[:n] = out[:n]
    return longer


@njit(cache=True, nogil=True, error_model="numpy")
def key_of(when_ns, pixel, polarity, label, iv):
    """The key of an event `when_ns` after t0: its time is the nearest microsecond in (t0, t1]."""
    k = np.int64((iv.offset_ns + when_ns) * 1e-3 + 0.5)
    k = min(max(k, np.int64(1)), iv.last_us)
    return np.uint64((k << np.int64(28)) | (pixel << np.int64(3)) | (polarity << np.int64(2)) | label)


@njit(cache=True, nogil=True, error_model="numpy")
def move_memories(lanes, pixels, count, live, alive, planes, flags, num):
    """Set the memories of the lanes live[:alive] of `count` to AT [nat]: new levels, in the lanes and in the state.

    Arithmetic runs over all lanes, which vectorises; what those beside `live` get means nothing.
    """
    memory, theta, drawn, crossings, fast = planes.memory, planes.theta, planes.drawn, planes.count, planes.fast
    for k in range(alive):
        memory[pixels[live[k]]] = lanes[AT + live[k]]
    for j in range(count):
        lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = num.threshold_on, num.threshold_off
    if len(flags.mismatch):
        for k in range(alive):
            j = live[k]
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = theta[2 * pixels[j]], theta[2 * pixels[j] + 1]
    if len(flags.crossing_noise):
        for j in range(count):
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = noisy_thresholds(
                lanes[LEVEL_ON + j],
                lanes[LEVEL_OFF + j],
                num.crossing_noise,
                num.seed,
                num.camera,
                pixels[j],
                crossings[pixels[j]],
            )
        for k in range(alive):
            j = live[k]
            crossings[pixels[j]] += np.uint32(1)
            drawn[2 * pixels[j]], drawn[2 * pixels[j] + 1] = (
                np.float32(lanes[LEVEL_ON + j]),
                np.float32(lanes[LEVEL_OFF + j]),
            )
        for j in range(count):  # the rounded thresholds are the thresholds, now and when they are read back
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = (
                np.float32(lanes[LEVEL_ON + j]),
                np.float32(lanes[LEVEL_OFF + j]),
            )
    scan_levels(lanes, count, flags, num)
    stride = stride_of(flags)
    for k in range(alive):
        j = live[k]
        at = place_of(pixels[j], stride)
        fast[at + HIGH * PITCH] = np.float32(lanes[SCAN_ON + j])
        fast[at + LOW * PITCH] = np.float32(lanes[SCAN_OFF + j])


@njit(cache=True, nogil=True, error_model="numpy")
def scan_levels(lanes, count, flags, num):
    """From the memory AT and the thresholds to levels [nat], and those that the scan compares."""
    for j in range(count):
        lanes[LEVEL_ON + j] = lanes[AT + j] + lanes[LEVEL_ON + j]
        lanes[LEVEL_OFF + j] = lanes[AT + j] - lanes[LEVEL_OFF + j]
    compare_levels(lanes, count, flags, num)


@njit(cache=True, nogil=True, error_model="numpy")
def compare_levels(lanes, count, flags, num):
    """From levels [nat] to those that the scan compares."""
    compared(lanes[SCAN_ON:], lanes[LEVEL_ON:], -MARGIN, count, flags, num)
    compared(lanes[SCAN_OFF:], lanes[LEVEL_OFF:], MARGIN, count, flags, num)


@njit(cache=True, nogil=True, error_model="numpy")
def load_levels(lanes, pixels, count, planes, flags, num):
    """The levels of pixels [nat] into ON and OFF."""
    memory, theta, drawn = planes.memory, planes.theta, planes.drawn
    for j in range(count):
        here = memory[pixels[j]]
        lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = here + num.threshold_on, here - num.threshold_off
        if len(flags.crossing_noise):
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = here + drawn[2 * pixels[j]], here - drawn[2 * pixels[j] + 1]
        elif len(flags.mismatch):
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = here + theta[2 * pixels[j]], here - theta[2 * pixels[j] + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def cross_all(lanes, pixels, count, live, alive, planes, flags, num, iv, out, n, tally):
    """One crossing in each of the lanes live[:alive]: the level AT [nat] is reached at the fraction WHEN.

    Returns n, the number of keys in `out`, which has room for `alive` more.  LABEL is read only with the flag `labels`.
    """
    if len(flags.labels) and len(flags.leak):
        label_leaks(lanes, pixels, live, alive, planes.t_reset, num, iv)
    move_memories(lanes, pixels, count, live, alive, planes, flags, num)
    t_last = planes.t_last
    for k in range(alive):
        j = live[k]
        label = np.int64(lanes[LABEL + j]) if len(flags.labels) else np.int64(SIGNAL)
        polarity = np.int64(1) if lanes[UP + j] > 0.0 else np.int64(0)
        out[n] = key_of(lanes[WHEN + j] * iv.dt_ns, pixels[j], polarity, label, iv)
        if len(flags.refractory):
            t_ns = iv.t0_ns + np.int64(lanes[WHEN + j] * iv.dt_ns)
            blind = t_ns - t_last[pixels[j]] < num.refractory_ns
            t_last[pixels[j]] = t_last[pixels[j]] if blind else t_ns
            tally[SWALLOWED] += np.int64(blind)
            n += np.int64(not blind)
        else:
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def label_leaks(lanes, pixels, live, alive, t_reset, num, iv):
    """Call an ON event a leak event if the leak made more than half of the way since the memory last moved."""
    for k in range(alive):
        j = live[k]
        t_ns = iv.t0_ns + np.int64(lanes[WHEN + j] * iv.dt_ns)
        drift = num.leak_nat_per_ns * np.float64(t_ns - t_reset[pixels[j]])
        if lanes[UP + j] > 0.0 and lanes[LABEL + j] == SIGNAL and drift > 0.5 * num.threshold_on:
            lanes[LABEL + j] = LEAK
        t_reset[pixels[j]] = t_ns


@njit(cache=True, nogil=True, error_model="numpy")
def reached_lanes(lanes, reached, count, live):
    """Indices of the lanes whose plane `reached` is 1 into `live`; returns their number."""
    left = 0
    for j in range(count):
        live[left] = j
        left += np.int64(lanes[reached + j])
    return left


@njit(cache=True, nogil=True, error_model="numpy")
def over_cap(lanes, solved, live, alive, num):
    """How many of the live lanes have just gone beyond the work cap."""
    over = 0
    for k in range(alive):
        over += np.int64(lanes[solved + live[k]] == num.max_crossings + 1.0)
    return over


@njit(cache=True, nogil=True, error_model="numpy")
def keep_lanes(lanes, first, last, pixels, live, alive):
    """Move the lanes live[:alive] (ascending) to the front, in the planes from `first` to `last`; `live` follows."""
    for start in range(first, last, PITCH):
        plane = lanes[start : start + PITCH]
        for k in range(alive):
            plane[k] = plane[live[k]]
    for k in range(alive):
        pixels[k] = pixels[live[k]]
        live[k] = k
