"""Slow path for the filter's response: the pieces in which it goes one way, from the first to the last of an interval.

The flagged pixels of some blocks become lanes.  Each lane holds its response and the monotone piece it is in.  Which
levels a piece reaches is known from its end (`ladder`), and when then a root in it (`roots`).
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels import turns as T
from vid2ev.kernels.drift import goes_one_way, look_further, slope_bounds, split_drifting
from vid2ev.kernels.ladder import END, REACHED, RUNGS, keep_lanes, reached_lanes
from vid2ev.kernels.lanes import (
    BASE,
    BEND0,
    BEND1,
    C1,
    C2,
    DRIFT,
    F0,
    F1,
    LANES,
    LAST,
    LOWER,
    NEXT,
    RISE,
    S0,
    S1,
    SLOPE0,
    SLOPE1,
    STEADY,
    UPPER,
    Y0,
    A,
    end_in_nats,
    enter,
)  # fmt: skip
from vid2ev.kernels.layout import HIGH, INPUT, LOW, PITCH, lane
from vid2ev.kernels.scratch import CLOCK, NEW, NOISE0, NOISE1
from vid2ev.kernels.steep import new_lag, old_lag
from vid2ev.physics.elementary import exp64
from vid2ev.physics.photoreceptor import response_terms, separate_rates

ROUNDED, TRACE = 1e-15, 1e-30


@inner
def load_responses(block, scratch, lanes, pixels, hits, count, p0, flags):
    """Input, rise, lags and levels of flagged pixels into lanes; `prepare_responses` makes the rest of them."""
    for j in range(count):
        i = np.int64(hits[j])
        pixels[j] = p0 + i
        old, new = np.float64(block[INPUT * PITCH + i]), np.float64(scratch[NEW + i])
        lanes[Y0 + j], lanes[RISE + j], lanes[LAST + j] = old, new - old, new
        lanes[UPPER + j], lanes[LOWER + j] = block[HIGH * PITCH + i], block[LOW * PITCH + i]
        if len(flags.track):  # levels may come to be anywhere
            lanes[UPPER + j], lanes[LOWER + j] = -np.inf, np.inf
        if len(flags.poles):
            lanes[LAST + j] = new - new_lag(scratch, len(flags.poles), i, flags)
            lanes[C1 + j] = old_lag(block, scratch, 1, i, flags)
        if len(flags.poles) == 2:
            lanes[C2 + j] = old_lag(block, scratch, 2, i, flags)
        if len(flags.light_bandwidth):
            lanes[A + j] = scratch[CLOCK + i]
        if len(flags.noise):
            lanes[BASE + j] = scratch[NOISE0 + i]
            lanes[DRIFT + j] = np.float64(scratch[NOISE1 + i]) - np.float64(scratch[NOISE0 + i])


@inner
def prepare_responses(work, count, b, flags, num, iv):
    """The responses of the loaded lanes, each on its first monotone piece."""
    lanes, two, poles = work.lanes, len(flags.poles) == 2, len(flags.poles) > 0
    base, drift = iv.leak0, iv.leak1 - iv.leak0
    for j in range(count):
        e1 = lanes[C1 + j] if poles else 0.0
        e2 = lanes[C2 + j] if two else 0.0
        du = lanes[RISE + j]
        a = separate_rates(lanes[A + j], b) if len(flags.light_bandwidth) else iv.a
        y0, rise, last = lanes[Y0 + j] - (e2 if two else e1), du, lanes[LAST + j]
        if len(flags.drift):
            lanes[BASE + j], lanes[DRIFT + j] = added(lanes, j, base, drift, flags)
        else:
            y0, rise, last = y0 + base, rise + drift, last + (base + drift)
            if len(flags.noise):
                y0, rise = y0 + lanes[BASE + j], rise + lanes[DRIFT + j]
                last += lanes[BASE + j] + lanes[DRIFT + j]
        c1, c2 = response_terms(du, e1, e2, a, b, two) if poles else (0.0, 0.0)
        end1 = exp64(-a) if poles else 1.0
        end2 = exp64(-b) if two else 1.0
        lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j] = y0, rise, c1, c2, a
        # The end comes from the state that the next interval starts with, so that nothing happens in between.
        lanes[F0 + j], lanes[F1 + j], lanes[LAST + j] = y0, last, last
        k1, k2 = a * c1, b * c2
        bend = above_rounding(a * k1 + b * k2, abs(a * k1) + abs(b * k2), rise)
        lanes[SLOPE0 + j] = above_rounding(rise - k1 - k2, abs(rise) + abs(k1) + abs(k2), bend)
        lanes[SLOPE1 + j] = rise - k1 * end1 - k2 * end2
        lanes[BEND0 + j], lanes[BEND1 + j] = bend, a * k1 * end1 + b * k2 * end2
        least, most = slope_bounds(rise, k1, k2, end1, end2)
        if len(flags.drift):
            lanes[STEADY + j] = 1.0 if goes_one_way(lanes, j, least, most, num.curve) else 0.0
        else:
            lanes[STEADY + j] = 1.0 if (least > 0.0) | (most < 0.0) else 0.0
    for j in range(count):
        lanes[S0 + j], lanes[S1 + j], lanes[NEXT + j], lanes[RUNGS + j] = 0.0, 1.0, 1.0, 0.0
    if len(flags.drift):
        split_drifting(work, count, b, flags, num)
    elif poles:
        split_pieces(lanes, work.turns, work.guesses, work.live, count, b)
    for j in range(count):
        lanes[END + j] = end_in_nats(lanes, j, flags, num)


@inner
def added(lanes, j, base, drift, flags):
    """What is added to the log of lane j at the start, and what more at the end [nat]."""
    if len(flags.noise):
        return base + lanes[BASE + j], drift + lanes[DRIFT + j]
    return base, drift


@inner
def above_rounding(total, size, later):
    """A sum of terms of this size; where only rounding is left of it, as from rest, a trace of what comes later."""
    return total if abs(total) > ROUNDED * size else TRACE * later


@inner
def split_pieces(lanes, turns, guesses, live, count, b):
    """Let the first piece of lanes with a turning point that matters end there."""
    for j in range(count):
        lanes[REACHED + j] = may_turn(lanes, j)
    some = reached_lanes(lanes, count, live)
    for k in range(some):
        j = lane(live[k])
        turns[T.RISE + k], turns[T.C1 + k], turns[T.C2 + k] = lanes[RISE + j], lanes[C1 + j], lanes[C2 + j]
        turns[T.A + k], turns[T.AT_0 + k], turns[T.AT_1 + k] = lanes[A + j], lanes[SLOPE0 + j], lanes[SLOPE1 + j]
    T.find_turns(turns, guesses, some, b)
    for k in range(some):
        if turns[T.KIND + k] != T.NEVER:
            j = lane(live[k])
            lanes[S1 + j], lanes[NEXT + j] = turns[T.ROOT + k], T.second_turn(turns, k, b)
            lanes[F1 + j] = lanes[Y0 + j] + turns[T.VALUE + k]


@inner
def may_turn(lanes, j):
    """1.0 if a turning point inside the interval may matter to lane j, else 0.0.

    The slope has at most one extreme, where the curvature changes its sign.  So where its sign is the same at both ends
    there is a turning point only if the slope goes towards zero first, and only if its bounds allow one.  Where the
    signs differ, but the curvature keeps its own, the turning point lies beyond the ends by less than the smaller of
    the two slopes (times the interval, which is 1): without a level that near, the signal is as good as monotone.
    """
    slope_0, slope_1, bend_0, bend_1 = lanes[SLOPE0 + j], lanes[SLOPE1 + j], lanes[BEND0 + j], lanes[BEND1 + j]
    start, end, beyond = lanes[F0 + j], lanes[F1 + j], min(abs(slope_0), abs(slope_1))
    above = max(start, end) + beyond >= lanes[UPPER + j]
    below = min(start, end) - beyond <= lanes[LOWER + j]
    opposite, bends = slope_0 * slope_1 <= 0.0, bend_0 * bend_1 <= 0.0
    near = bends | (above if bend_0 < 0.0 else below)
    dips = bends & (slope_0 * bend_0 <= 0.0) & (lanes[STEADY + j] == 0.0)
    return 1.0 if (opposite & near) | dips else 0.0


@inner
def next_pieces(work, count, b, flags, num):
    """Keep the lanes whose interval goes on after the piece, and move them to the next one; returns their number."""
    lanes, live = work.lanes, work.live
    for j in range(count):
        lanes[REACHED + j] = 1.0 if lanes[S1 + j] < 1.0 else 0.0
    left = reached_lanes(lanes, count, live)
    keep_lanes(lanes, END, LANES, work.pixels, live, left)
    for j in range(left):
        move_on(lanes, j, b, flags, num)
    if len(flags.drift):
        for j in range(left):
            look_further(lanes, j, work.knots, b, num)
    return left


@inner
def move_on(lanes, j, b, flags, num):
    """Let lane j be on its next piece, as if that were the last and no crossing had been before."""
    enter(lanes, j, lanes[S1 + j], lanes[F1 + j], lanes[NEXT + j], b)
    lanes[NEXT + j], lanes[END + j], lanes[RUNGS + j] = 1.0, end_in_nats(lanes, j, flags, num), 0.0


@inner
def next_piece(lanes, j, knots, b, flags, num):
    """Move lane j to its next piece."""
    move_on(lanes, j, b, flags, num)
    if len(flags.drift):
        look_further(lanes, j, knots, b, num)
