"""Slow path for a comparator input that is a straight line in nats between frames: crossing times in closed form.

That is ESIM's model (no filter, or `timing = "linear"`), and `timing = "frame"`, where only the order is kept.  The
flagged pixels of a block become lanes; each round takes the next crossing of every lane that has one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernels.crossing import (
    AT,
    FREE,
    LABEL,
    LEVEL_OFF,
    LEVEL_ON,
    UP,
    WHEN,
    cross_all,
    keep_lanes,
    over_cap,
    reached_lanes,
    room,
)
from vid2ev.kernels.layout import CAPPED, INPUT, LAG1, LAG2, PITCH
from vid2ev.kernels.scan import NEW, NOISE0, NOISE1, OLD1, OLD2
from vid2ev.physics.log_curve import log_level

START, END, PER_NAT, SOLVED, REACHED, ADDED0, ADDED1 = (FREE + k * PITCH for k in range(7))


@njit(cache=True, nogil=True, error_model="numpy")
def load_lines(block, scratch, lanes, pixels, hits, count, p0, flags):
    """The comparator's input before and after the interval, light or nats, of flagged pixels into lanes."""
    poles = len(flags.poles)
    for j in range(count):
        i = hits[j]
        pixels[j] = p0 + i
        before, after = np.float64(block[INPUT * PITCH + i]), np.float64(scratch[NEW + i])
        if poles == 1:
            before -= scratch[OLD1 + i]
            after -= block[LAG1 * PITCH + i]
        elif poles == 2:
            before -= scratch[OLD2 + i]
            after -= block[LAG2 * PITCH + i]
        lanes[START + j], lanes[END + j] = before, after
        if len(flags.noise):
            lanes[ADDED0 + j], lanes[ADDED1 + j] = scratch[NOISE0 + i], scratch[NOISE1 + i]


@njit(cache=True, nogil=True, error_model="numpy")
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
        lanes[WHEN + j], lanes[SOLVED + j] = 0.0, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def to_nats(plane, count, num):
    """A plane of light to nats."""
    for j in range(count):
        plane[j] = log_level(max(plane[j], 0.0), num.curve)


@njit(cache=True, nogil=True, error_model="numpy")
def next_crossings(lanes, count, flags, num):
    """The next crossing of each lane into AT, WHEN and UP; REACHED is 1 where there is one.

    Beyond the work cap the memory goes to the signal at the end of the interval, in one event.
    """
    cap = np.float64(num.max_crossings)
    for j in range(count):
        start, end, on, off = lanes[START + j], lanes[END + j], lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j]
        up = end >= on
        at = on if up else off
        here = (at - start) * lanes[PER_NAT + j]
        when = lanes[WHEN + j]
        # (a NaN, from a line without a slope, keeps the earlier time)
        when = min(here, 1.0) if here > when else when
        if len(flags.frame_time):
            when = 1.0
        rest = lanes[SOLVED + j] >= cap
        lanes[SOLVED + j] += 1.0
        reached = up | (end <= off)
        lanes[REACHED + j] = 1.0 if reached else 0.0
        lanes[END + j] = end if reached else np.nan  # a lane that is through stays so
        lanes[UP + j], lanes[LABEL + j] = 1.0 if up else 0.0, 0.0
        lanes[AT + j] = end if rest else at
        lanes[WHEN + j] = 1.0 if rest else when


@njit(cache=True, nogil=True, error_model="numpy")
def straight(lanes, pixels, live, count, enough, planes, flags, num, iv, out, n, tally):
    """Rounds of crossings until at most `enough` lanes may have one left: (those lanes' number, out, n)."""
    while True:
        next_crossings(lanes, count, flags, num)
        alive = reached_lanes(lanes, REACHED, count, live)
        if 4 * alive < 3 * count:
            keep_lanes(lanes, AT, REACHED, pixels, live, alive)
            count = alive
        tally[CAPPED] += over_cap(lanes, SOLVED, live, alive, num)
        out = room(out, n, alive)
        n = cross_all(lanes, pixels, count, live, alive, planes, flags, num, iv, out, n, tally)
        if alive <= enough:
            keep_lanes(lanes, WHEN, REACHED, pixels, live, alive)
            return alive, out, n
