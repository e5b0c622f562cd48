"""Slow path for straight lines and thresholds that stay: all crossings of a pixel in the interval at once.

The levels of a pixel are then rungs an equal step apart, so their number is a quotient.  Pixels go through in one
round, in order, and each one's crossings in order of time.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernels.crossing import (
    AT,
    LEVEL_OFF,
    LEVEL_ON,
    SCAN_OFF,
    SCAN_ON,
    SIGNAL,
    UP,
    WHEN,
    key_of,
    room,
    scan_levels,
)
from vid2ev.kernels.layout import CAPPED, HIGH, LOW, PITCH, SWALLOWED, place_of, stride_of
from vid2ev.kernels.straight import END, PER_NAT, REACHED, SOLVED, START

# Crossings of a lane, the first one's time and the time between them [ns since t0], and the step of its levels.
RUNGS, FIRST_NS, RUNG_NS, STEP = SOLVED, WHEN, PER_NAT, REACHED


@njit(cache=True, nogil=True, error_model="numpy")
def climb(lanes, pixels, count, planes, flags, num, iv, out, n, tally):
    """All events of `count` prepared lanes, and the levels they leave behind: (out, n)."""
    memory, theta = planes.memory, planes.theta
    for j in range(count):
        lanes[AT + j] = memory[pixels[j]]
    for j in range(count):
        lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = num.threshold_on, num.threshold_off
        if len(flags.mismatch):
            lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j] = theta[2 * pixels[j]], theta[2 * pixels[j] + 1]
    events = count_rungs(lanes, count, flags, num, iv, tally)
    scan_levels(lanes, count, flags, num)
    stride, fast = stride_of(flags), planes.fast
    for j in range(count):
        memory[pixels[j]] = lanes[AT + j]
        at = place_of(pixels[j], stride)
        fast[at + HIGH * PITCH] = np.float32(lanes[SCAN_ON + j])
        fast[at + LOW * PITCH] = np.float32(lanes[SCAN_OFF + j])
    out = room(out, n, events + 2)
    if len(flags.refractory):
        return out, send_awake(lanes, pixels, count, planes.t_last, num, iv, out, n, tally)
    return out, send(lanes, pixels, np.empty(2 * PITCH, np.uint64), count, num, iv, out, n)


@njit(cache=True, nogil=True, error_model="numpy")
def count_rungs(lanes, count, flags, num, iv, tally):
    """RUNGS and their times, from the memory AT, which moves to the last of them; returns the number in all.

    Beyond the work cap the memory goes to the signal at the end of the interval, in one event.
    """
    cap, events, over = np.float64(num.max_crossings), np.int32(0), np.int32(0)
    for j in range(count):
        start, end, at, per_nat = lanes[START + j], lanes[END + j], lanes[AT + j], lanes[PER_NAT + j]
        up = end >= at + lanes[LEVEL_ON + j]
        step = lanes[LEVEL_ON + j] if up else -lanes[LEVEL_OFF + j]
        first = at + step
        rungs = max(np.floor((end - first) / step) + 1.0, 0.0)
        last = first + (rungs - 1.0) * step
        # The quotient may round a rung away that the levels left behind would find at the next interval's start.
        further = last + step
        more = (rungs > 0.0) & ((end >= further) if up else (end <= further))
        rungs, last = rungs + 1.0 if more else rungs, further if more else last
        capped = rungs > cap
        last = end if capped else last
        rungs = cap + 1.0 if capped else rungs
        events = np.int32(events + np.int32(rungs))
        over = np.int32(over + np.int32(capped))
        lanes[AT + j] = last if rungs > 0.0 else at
        lanes[RUNGS + j], lanes[UP + j] = rungs, 1.0 if up else 0.0
        if len(flags.frame_time):
            lanes[FIRST_NS + j], lanes[RUNG_NS + j] = iv.dt_ns, 0.0
        else:
            lanes[FIRST_NS + j], lanes[RUNG_NS + j] = (first - start) * per_nat * iv.dt_ns, step * per_nat * iv.dt_ns
    tally[CAPPED] += over
    return events


@njit(cache=True, nogil=True, error_model="numpy")
def send(lanes, pixels, stamps, count, num, iv, out, n):
    """Keys of all crossings; returns n.

    Most lanes have one or two, so two are made for each, in vector code, and counted if there are any.
    """
    for j in range(count):
        first, second = lanes[FIRST_NS + j], lanes[FIRST_NS + j] + lanes[RUNG_NS + j]
        polarity = np.int64(lanes[UP + j])
        stamps[j] = key_of(first, pixels[j], polarity, SIGNAL, iv)
        stamps[PITCH + j] = key_of(second, pixels[j], polarity, SIGNAL, iv)
    for j in range(count):
        rungs = np.int64(lanes[RUNGS + j])
        out[n], out[n + 1] = stamps[j], stamps[PITCH + j]
        if rungs > 2:
            polarity, first, rung = np.int64(lanes[UP + j]), lanes[FIRST_NS + j], lanes[RUNG_NS + j]
            for k in range(2, rungs):
                out[n + k] = key_of(first + k * rung, pixels[j], polarity, SIGNAL, iv)
        n += rungs
        if rungs > num.max_crossings:
            out[n - 1] = key_of(iv.dt_ns, pixels[j], np.int64(lanes[UP + j]), SIGNAL, iv)
    return n


@njit(cache=True, nogil=True, error_model="numpy")
def send_awake(lanes, pixels, count, t_last, num, iv, out, n, tally):
    """Keys of the crossings outside of refractory periods; returns n."""
    for j in range(count):
        polarity, first, rung = np.int64(lanes[UP + j]), lanes[FIRST_NS + j], lanes[RUNG_NS + j]
        last = t_last[pixels[j]]
        for k in range(np.int64(lanes[RUNGS + j])):
            when = first + k * rung if k < num.max_crossings else iv.dt_ns
            when = min(when, iv.dt_ns) if when > 0.0 else 0.0  # (a NaN, from a line without a slope, is its start)
            t_ns = iv.t0_ns + np.int64(when)
            if t_ns - last < num.refractory_ns:
                tally[SWALLOWED] += 1
            else:
                out[n] = key_of(when, pixels[j], polarity, SIGNAL, iv)
                n, last = n + 1, t_ns
        t_last[pixels[j]] = last
    return n
