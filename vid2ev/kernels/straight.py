"""Slow path for a comparator input that is a straight line in nats between frames: crossing times in closed form.

That is ESIM's model (no filter, or `timing = "linear"`), and `timing = "frame"`, where only the order is kept.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.crossing import SIGNAL, UP, key_of
from vid2ev.kernels.ladder import AFTER_LADDER, END, FIRST, RUNGS, STEP
from vid2ev.kernels.layout import INPUT, LANE_PITCH, PITCH, lane
from vid2ev.kernels.scratch import NEW, NOISE0, NOISE1
from vid2ev.kernels.sink import put, put_two, replace_last, room
from vid2ev.kernels.steep import new_lag, old_lag
from vid2ev.physics.log_curve import log_level

START, PER_NAT, ADDED0, ADDED1 = (AFTER_LADDER + k * LANE_PITCH for k in range(4))


@inner
def load_lines(block, scratch, lanes, pixels, hits, count, p0, flags):
    """The comparator's input before and after the interval, light or nats, of flagged pixels into lanes."""
    poles = len(flags.poles)
    for j in range(count):
        i = np.int64(hits[j])
        pixels[j] = p0 + i
        before, after = np.float64(block[INPUT * PITCH + i]), np.float64(scratch[NEW + i])
        if poles == 1:
            before -= old_lag(block, scratch, 1, i, flags)
            after -= new_lag(scratch, 1, i, flags)
        elif poles == 2:
            before -= old_lag(block, scratch, 2, i, flags)
            after -= new_lag(scratch, 2, i, flags)
        lanes[START + j], lanes[END + j] = before, after
        if len(flags.noise):
            lanes[ADDED0 + j], lanes[ADDED1 + j] = scratch[NOISE0 + i], scratch[NOISE1 + i]


@inner
def prepare_lines(lanes, count, flags, num, iv):
    """The loaded lines in nats, leak and noise included."""
    if len(flags.log_input) == 0:
        to_nats(lanes[START:], count, num)
        to_nats(lanes[END:], count, num)
    for j in range(count):
        before, after = lanes[START + j] + iv.leak0, lanes[END + j] + iv.leak1
        if len(flags.noise):
            before, after = before + lanes[ADDED0 + j], after + lanes[ADDED1 + j]
        lanes[START + j], lanes[END + j], lanes[PER_NAT + j] = before, after, 1.0 / (after - before)
        lanes[RUNGS + j] = 0.0


@inner
def to_nats(plane, count, num):
    """A plane of light to nats."""
    for j in range(count):
        plane[j] = log_level(max(plane[j], 0.0), num.curve)


@inner
def line_times(levels, when, who, count, lanes, num):
    """Times of a batch of crossings."""
    for k in range(count):
        j = lane(who[k])
        here = (levels[k] - lanes[START + j]) * lanes[PER_NAT + j]
        # (a NaN, from a line without a slope, is its start)
        when[k] = 1.0 if num.frame_time else (min(here, 1.0) if here > 0.0 else 0.0)


@inner
def send_lines(lanes, pixels, stamps, count, crossings, num, iv, out, n):
    """Keys of all crossings of lanes that have only to be counted, without a batch between: (out, n).

    Most lanes have one or two, so two are made for each, in vector code, and counted if there are any.
    """
    out = room(out, n, crossings + 2)
    for j in range(count):
        first, rung = rung_times(lanes, j, num, iv)
        polarity = np.int64(lanes[UP + j])
        stamps[j] = key_of(first, pixels[j], polarity, SIGNAL, iv)
        stamps[LANE_PITCH + j] = key_of(first + rung, pixels[j], polarity, SIGNAL, iv)
    for j in range(count):
        rungs = np.int64(lanes[RUNGS + j])
        n = put_two(out, n, stamps[j], stamps[LANE_PITCH + j], rungs)
        if rungs > 2:
            polarity = np.int64(lanes[UP + j])
            first, rung = rung_times(lanes, j, num, iv)
            for k in range(2, rungs):
                n = put(out, n, key_of(first + k * rung, pixels[j], polarity, SIGNAL, iv), True)
        if rungs > num.max_crossings:
            replace_last(out, n, key_of(iv.dt_ns, pixels[j], np.int64(lanes[UP + j]), SIGNAL, iv))
    return out, n


@inner
def rung_times(lanes, j, num, iv):
    """Time of lane j's first rung, and from one to the next [ns since t0]."""
    if num.frame_time:
        return iv.dt_ns, 0.0
    per_nat = lanes[PER_NAT + j] * iv.dt_ns
    return (lanes[FIRST + j] - lanes[START + j]) * per_nat, lanes[STEP + j] * per_nat
