"""Slow path for the filter's response: crossing times by a root of the closed form, many at a time.

The flagged pixels of some blocks become lanes.  Each lane holds its response, y(s) = y0 + rise s + c1 (e^-as - 1) +
c2 (e^-bs - 1), and the monotone piece [s0, s1] it is in.  Which levels a piece reaches is known from its end
(`ladder`); the times are then roots in [s0, s1], found for a batch at a time: four steps of Halley's method in float32,
and as many in float64 as it takes, vector code all of it.  What is not settled then is finished by a bracketed search.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels import turns as T
from vid2ev.kernels.ladder import AFTER_LADDER, END, REACHED, RUNGS, keep_lanes, reached_lanes
from vid2ev.kernels.layout import HIGH, INPUT, LANE_PITCH, LOW, PITCH
from vid2ev.kernels.scan import CLOCK, NEW, NOISE0, NOISE1, new_lag, old_lag
from vid2ev.physics.elementary import exp64, expm1_32, expm1_64
from vid2ev.physics.log_curve import light_at, log_level
from vid2ev.physics.photoreceptor import bracketed, response, response_terms, separate_rates

F = np.float32
# Planes of the lanes: the response, the piece, the end of the next piece and of the interval, the levels that the scan
# compares; slopes and curvatures at both ends; noise added; 1.0 where the slope keeps its sign by its bounds.
Y0, RISE, C1, C2, A, S0, F0, S1, F1, NEXT, LAST, UPPER, LOWER = (AFTER_LADDER + k * LANE_PITCH for k in range(13))
SLOPE0, SLOPE1, BEND0, BEND1, ADDED0, ADDED1, STEADY = (LOWER + (1 + k) * LANE_PITCH for k in range(7))
LANES = STEADY + LANE_PITCH
# A job is a response and its piece: planes of a batch, or those of the lanes from Y0 on.
JOB_Y0, JOB_RISE, JOB_C1, JOB_C2, JOB_A, FROM_S, FROM_Y, TO_S, TO_Y = (
    plane - Y0 for plane in (Y0, RISE, C1, C2, A, S0, F0, S1, F1)
)
JOBS = NEXT - Y0
# Planes of a batch in float32.
G_D0, G_RISE, G_C1, G_C2, G_A, G_S, G_LO, G_HI, G_UP = (k * LANE_PITCH for k in range(9))
GUESSES = 9 * LANE_PITCH
# Accepted last step, in units of the faster time constant, or of the way in which the slope changes by itself where
# that is shorter, as near a turning point or in the dark before a flash: the method is of third order in it.
ENOUGH = 2e-3
ROUNDED, TRACE = 1e-15, 1e-30
POLISHES = 3  # steps in float64, at the most


@inner
def load_responses(block, scratch, lanes, pixels, hits, count, p0, flags):
    """Input, rise, lags and levels of flagged pixels into lanes; `prepare_responses` makes the rest of them."""
    for j in range(count):
        i = np.int64(hits[j])
        pixels[j] = p0 + i
        old, new = np.float64(block[INPUT * PITCH + i]), np.float64(scratch[NEW + i])
        lanes[Y0 + j], lanes[RISE + j], lanes[LAST + j] = old, new - old, new
        lanes[UPPER + j], lanes[LOWER + j] = block[HIGH * PITCH + i], block[LOW * PITCH + i]
        if len(flags.poles):
            lanes[LAST + j] = new - new_lag(scratch, len(flags.poles), i, flags)
            lanes[C1 + j] = old_lag(block, scratch, 1, i, flags)
        if len(flags.poles) == 2:
            lanes[C2 + j] = old_lag(block, scratch, 2, i, flags)
        if len(flags.light_bandwidth):
            lanes[A + j] = scratch[CLOCK + i]
        if len(flags.noise):
            lanes[ADDED0 + j], lanes[ADDED1 + j] = scratch[NOISE0 + i], scratch[NOISE1 + i]


@inner
def prepare_responses(lanes, turns, guesses, live, count, b, flags, num, iv):
    """The responses of the loaded lanes, each on its first monotone piece."""
    two, poles = len(flags.poles) == 2, len(flags.poles) > 0
    base, drift = iv.leak0, iv.leak1 - iv.leak0
    for j in range(count):
        e1 = lanes[C1 + j] if poles else 0.0
        e2 = lanes[C2 + j] if two else 0.0
        du = lanes[RISE + j]
        a = separate_rates(lanes[A + j], b) if len(flags.light_bandwidth) else iv.a
        y0, rise = lanes[Y0 + j] - (e2 if two else e1) + base, du + drift
        last = lanes[LAST + j] + (base + drift)
        if len(flags.noise):
            y0, rise = y0 + lanes[ADDED0 + j], rise + (lanes[ADDED1 + j] - lanes[ADDED0 + j])
            last += lanes[ADDED1 + j]
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
        least = rise - max(k1, k1 * end1) - max(k2, k2 * end2)
        most = rise - min(k1, k1 * end1) - min(k2, k2 * end2)
        lanes[STEADY + j] = 1.0 if (least > 0.0) | (most < 0.0) else 0.0
    for j in range(count):
        lanes[S0 + j], lanes[S1 + j], lanes[NEXT + j], lanes[RUNGS + j] = 0.0, 1.0, 1.0, 0.0
    if poles:
        split_pieces(lanes, turns, guesses, live, count, b)
    ends_in_nats(lanes, count, flags, num)


@inner
def above_rounding(total, size, later):
    """A sum of terms of this size; where only rounding is left of it, as from rest, a trace of what comes later."""
    return total if abs(total) > ROUNDED * size else TRACE * later


@inner
def ends_in_nats(lanes, count, flags, num):
    """END [nat] of each lane's piece."""
    # (light has a floor of 0: after a flash of many decades the arithmetic may leave less than nothing of it)
    for j in range(count):
        lanes[END + j] = lanes[F1 + j] if len(flags.log_input) else log_level(max(lanes[F1 + j], 0.0), num.curve)


@inner
def split_pieces(lanes, turns, guesses, live, count, b):
    """Let the first piece of lanes with a turning point that matters end there."""
    for j in range(count):
        lanes[REACHED + j] = may_turn(lanes, j)
    some = reached_lanes(lanes, count, live)
    for k in range(some):
        j = live[k]
        turns[T.RISE + k], turns[T.C1 + k], turns[T.C2 + k] = lanes[RISE + j], lanes[C1 + j], lanes[C2 + j]
        turns[T.A + k], turns[T.AT_0 + k], turns[T.AT_1 + k] = lanes[A + j], lanes[SLOPE0 + j], lanes[SLOPE1 + j]
    T.find_turns(turns, guesses, some, b)
    for k in range(some):
        if turns[T.KIND + k] != T.NEVER:
            j = live[k]
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
def next_pieces(lanes, pixels, live, count, b, flags, num):
    """Keep the lanes whose interval goes on after the piece, and move them to the next one; returns their number."""
    for j in range(count):
        lanes[REACHED + j] = 1.0 if lanes[S1 + j] < 1.0 else 0.0
    left = reached_lanes(lanes, count, live)
    keep_lanes(lanes, END, LANES, pixels, live, left)
    for j in range(left):
        lanes[S0 + j], lanes[F0 + j] = lanes[S1 + j], lanes[F1 + j]
        lanes[S1 + j], lanes[NEXT + j] = lanes[NEXT + j], 1.0
        inside = response(lanes[S1 + j], lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j], b)
        lanes[F1 + j] = inside if lanes[S1 + j] < 1.0 else lanes[LAST + j]
    ends_in_nats(lanes, left, flags, num)
    return left


@inner
def gather_jobs(jobs, who, count, lanes):
    """The responses of a batch of crossings out of the lanes."""
    for k in range(count):
        j = who[k]
        jobs[JOB_Y0 + k], jobs[JOB_RISE + k] = lanes[Y0 + j], lanes[RISE + j]
        jobs[JOB_C1 + k], jobs[JOB_C2 + k], jobs[JOB_A + k] = lanes[C1 + j], lanes[C2 + j], lanes[A + j]
        jobs[FROM_S + k], jobs[TO_S + k] = lanes[S0 + j], lanes[S1 + j]
        jobs[FROM_Y + k], jobs[TO_Y + k] = lanes[F0 + j], lanes[F1 + j]


@inner
def to_signals(levels, count, flags, num):
    """Levels [nat] to levels of what the filter gives."""
    if len(flags.log_input) == 0:
        for k in range(count):
            levels[k] = light_at(levels[k], num.curve)


@inner
def batch_times(levels, when, steps, jobs, guesses, who, count, lanes, b, flags, num):
    """Times `when` of a batch of crossings at `levels` [nat] of the lanes `who`."""
    to_signals(levels, count, flags, num)
    gather_jobs(jobs, who, count, lanes)
    left = approach(levels, when, steps, jobs, guesses, count, b, flags)
    for k in range(count):
        if not steps[k] < ENOUGH:
            when[k] = finish(levels, jobs, when[k], k, b, flags, left)


@inner
def lane_times(levels, when, steps, guesses, live, alive, count, lanes, b, flags, num):
    """Times `when` of one crossing at `levels` [nat] of each of the lanes live[:alive], those that are REACHED.

    Most lanes have one, so their responses are not copied to a batch; the few others are solved in vain, half-way.
    """
    to_signals(levels, count, flags, num)
    for j in range(count):
        levels[j] = levels[j] if lanes[REACHED + j] > 0.0 else 0.5 * (lanes[F0 + j] + lanes[F1 + j])
    jobs = lanes[Y0:]
    left = approach(levels, when, steps, jobs, guesses, count, b, flags)
    for k in range(alive):
        j = live[k]
        when[k] = when[j] if steps[j] < ENOUGH else finish(levels, jobs, when[j], j, b, flags, left)


@inner
def approach(levels, when, steps, jobs, guesses, count, b, flags):
    """Times `when` at which the jobs are at `levels`, and how far off they may be; returns how many of the steps in
    float64 are left to those that are not near enough.

    A job takes as many steps as it needs, whatever the others of its batch do: a batch decides only whether they are
    taken by all at once or (`finish`) by one after the other, so times do not depend on who is in it.
    """
    guess(levels, jobs, guesses, count)
    for _ in range(4):
        improve(guesses, count, F(b), flags)
    for k in range(count):
        when[k], steps[k] = guesses[G_S + k], np.inf
    left = POLISHES
    while left > 0:
        left -= 1
        for k in range(count):
            there, step = polished(levels, jobs, when[k], k, b, flags)
            near = steps[k] < ENOUGH
            when[k], steps[k] = when[k] if near else there, steps[k] if near else step
        rough = np.int32(0)
        for k in range(count):
            rough = np.int32(rough + np.int32(0 if steps[k] < ENOUGH else 1))
        if 16 * rough <= count:
            break
    return left


@inner
def guess(levels, jobs, guesses, count):
    """The jobs in float32, with the chords' roots as a start."""
    for k in range(count):
        lo, hi, start, stop = jobs[FROM_S + k], jobs[TO_S + k], jobs[FROM_Y + k], jobs[TO_Y + k]
        share = (levels[k] - start) / (stop - start)
        guesses[G_D0 + k] = jobs[JOB_Y0 + k] - levels[k]
        guesses[G_S + k] = lo + (hi - lo) * min(max(share, 0.0), 1.0)
        guesses[G_LO + k], guesses[G_HI + k] = lo, hi
        guesses[G_UP + k] = F(1.0) if stop > start else F(-1.0)
    for k in range(count):
        guesses[G_RISE + k], guesses[G_A + k] = jobs[JOB_RISE + k], jobs[JOB_A + k]
        guesses[G_C1 + k], guesses[G_C2 + k] = jobs[JOB_C1 + k], jobs[JOB_C2 + k]


@inner
def improve(guesses, count, b, flags):
    """One bracketed step of Halley's method for each guess."""
    poles, two = len(flags.poles) > 0, len(flags.poles) == 2
    for k in range(count):
        s, a, c1, c2 = guesses[G_S + k], guesses[G_A + k], guesses[G_C1 + k], guesses[G_C2 + k]
        m1 = expm1_32(-a * s) if poles else F(0.0)
        m2 = expm1_32(-b * s) if two else F(0.0)
        f = guesses[G_D0 + k] + (guesses[G_RISE + k] * s + (c1 * m1 + c2 * m2))
        k1, k2 = a * c1 * (F(1.0) + m1), b * c2 * (F(1.0) + m2)
        d = guesses[G_RISE + k] - k1 - k2
        below = f * guesses[G_UP + k] < F(0.0)
        lo = s if below else guesses[G_LO + k]
        hi = guesses[G_HI + k] if below else s
        there = s - (f * d) / (d * d - F(0.5) * f * (a * k1 + b * k2))
        guesses[G_S + k] = there if (there >= lo) & (there <= hi) else F(0.5) * (lo + hi)
        guesses[G_LO + k], guesses[G_HI + k] = lo, hi


@inner
def polished(levels, jobs, s, k, b, flags):
    """One step of Halley's method in float64 for job k at s: the time, and what is left, in units of `ENOUGH`."""
    poles, two = len(flags.poles) > 0, len(flags.poles) == 2
    rise, c1, c2, a = jobs[JOB_RISE + k], jobs[JOB_C1 + k], jobs[JOB_C2 + k], jobs[JOB_A + k]
    m1 = expm1_64(-a * s) if poles else 0.0
    m2 = expm1_64(-b * s) if two else 0.0
    f = (jobs[JOB_Y0 + k] - levels[k]) + (rise * s + (c1 * m1 + c2 * m2))
    k1, k2 = a * c1 * (1.0 + m1), b * c2 * (1.0 + m2)
    d, bend = rise - k1 - k2, a * k1 + b * k2
    step = -(f * d) / (d * d - 0.5 * f * bend)
    there = s + step
    inside = (there >= jobs[FROM_S + k]) & (there <= jobs[TO_S + k])
    # (where the exponentials have died away Halley's step is small without being near: Newton's tells)
    left = max(abs(step), abs(f / d)) * max(max(1.0, abs(bend / d)), max(a, b))
    return there if inside else s, left if inside else np.inf


@inner
def finish(levels, jobs, s, k, b, flags, left):
    """The root of job k, from what `approach` left of its steps on."""
    while left > 0:
        left -= 1
        s, step = polished(levels, jobs, s, k, b, flags)
        if step < ENOUGH:
            return s
    return settle(levels[k], jobs, s, k, b)


@inner
def settle(level, jobs, s, k, b):
    """The root of job k at a level by Newton's method inside its piece, or halving that where Newton's is slow."""
    rise, c1, c2, a = jobs[JOB_RISE + k], jobs[JOB_C1 + k], jobs[JOB_C2 + k], jobs[JOB_A + k]
    d0 = jobs[JOB_Y0 + k] - level
    lo, hi, up = jobs[FROM_S + k], jobs[TO_S + k], jobs[TO_Y + k] > jobs[FROM_Y + k]
    enough = 1e-9 / max(1.0, max(a, b))
    end = d0 + (rise * hi + (c1 * expm1_64(-a * hi) + c2 * expm1_64(-b * hi)))
    if (end < 0.0) == up:  # the end that the next interval starts with is rounded: there, and not before it
        return hi
    step = hi - lo
    for _ in range(100):
        m1, m2 = expm1_64(-a * s), expm1_64(-b * s)
        f = d0 + (rise * s + (c1 * m1 + c2 * m2))
        if (f < 0.0) == up:
            lo = s
        else:
            hi = s
        here = bracketed(s - f / (rise - a * c1 * (1.0 + m1) - b * c2 * (1.0 + m2)), s, lo, hi, step)
        step, s = abs(here - s), here
        if step < enough:
            break
    return s
