"""Slow path for the filter's response: crossing times by a root of the closed form, many pixels at a time.

The flagged pixels of a block become lanes.  Each lane holds its response, y(s) = y0 + rise s + c1 (e^-as - 1) + c2
(e^-bs - 1), and the monotone piece [s0, s1] it is in.  Rounds of: pick the level that the piece reaches, solve (three
steps of Halley's method, vector code), cross, until no lane is left.  The few lanes that four steps do not settle are
finished by a bracketed search.  Levels are in the filter's domain: nats, or light.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernels import turns as T
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
    load_levels,
    over_cap,
    reached_lanes,
    room,
)
from vid2ev.kernels.layout import CAPPED, INPUT, LAG1, LAG2, PITCH
from vid2ev.kernels.scan import CLOCK, NEW, NOISE0, NOISE1, OLD1, OLD2
from vid2ev.physics.elementary import exp64, expm1_64
from vid2ev.physics.log_curve import light_at, log_level
from vid2ev.physics.photoreceptor import (
    response,
    response_terms,
    separate_rates,
)

# The response, the piece, the crossings so far; what follows (from the levels in the filter's domain) is made anew in
# each round.
Y0, RISE, C1, C2, A, S0, F0, S1, F1, NEXT, LAST, SOLVED, UPPER, LOWER = (FREE + k * PITCH for k in range(14))
REACHED, TARGET, STEP, LOW_S, HIGH_S, ADDED0, ADDED1 = (LOWER + (1 + k) * PITCH for k in range(7))
SLOPE0, SLOPE1, BEND0, BEND1 = (ADDED1 + (1 + k) * PITCH for k in range(4))
LANES = BEND1 + PITCH
# Accepted last step, in units of the faster time constant: the method is of third order, with a large constant near a
# turning point.
ENOUGH = 2e-3


@njit(cache=True, nogil=True, error_model="numpy")
def load_responses(block, scratch, lanes, pixels, hits, count, p0, flags, iv):
    """Input, rise and lags of flagged pixels into lanes; `prepare_responses` makes the rest of them."""
    for j in range(count):
        i = hits[j]
        pixels[j] = p0 + i
        lanes[Y0 + j] = block[INPUT * PITCH + i]
        lanes[RISE + j] = np.float64(scratch[NEW + i]) - np.float64(block[INPUT * PITCH + i])
        lanes[LAST + j] = scratch[NEW + i]
        if len(flags.poles):
            lanes[LAST + j] -= block[(LAG1 if len(flags.poles) == 1 else LAG2) * PITCH + i]
        lanes[C1 + j] = scratch[OLD1 + i] if len(flags.poles) else 0.0
        lanes[C2 + j] = scratch[OLD2 + i] if len(flags.poles) == 2 else 0.0
        lanes[A + j] = scratch[CLOCK + i] if len(flags.light_bandwidth) else iv.a
        if len(flags.noise):
            lanes[ADDED0 + j], lanes[ADDED1 + j] = scratch[NOISE0 + i], scratch[NOISE1 + i]


@njit(cache=True, nogil=True, error_model="numpy")
def prepare_responses(lanes, turns, pixels, live, count, b, planes, flags, num, iv):
    """Levels and responses of the loaded lanes, each on its first monotone piece."""
    two, poles = len(flags.poles) == 2, len(flags.poles) > 0
    load_levels(lanes, pixels, count, planes, flags, num)
    for j in range(count):
        du, e1, e2 = lanes[RISE + j], lanes[C1 + j], lanes[C2 + j]
        a = separate_rates(lanes[A + j], b) if len(flags.light_bandwidth) else lanes[A + j]
        base, drift = iv.leak0, iv.leak1 - iv.leak0
        if len(flags.noise):
            base, drift = base + lanes[ADDED0 + j], drift + (lanes[ADDED1 + j] - lanes[ADDED0 + j])
        y0, rise = (lanes[Y0 + j] - (e2 if two else e1)) + base, du + drift
        c1, c2 = response_terms(du, e1, e2, a, b, two) if poles else (0.0, 0.0)
        end1 = exp64(-a) if poles else 1.0
        end2 = exp64(-b) if two else 1.0
        # The end comes from the state that the next interval starts with, so that nothing happens in between.
        last = lanes[LAST + j] + (base + drift)
        lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j] = y0, rise, c1, c2, a
        lanes[S0 + j], lanes[F0 + j], lanes[S1 + j], lanes[NEXT + j] = 0.0, y0, 1.0, 1.0
        lanes[F1 + j], lanes[LAST + j], lanes[SOLVED + j] = last, last, 0.0
        k1, k2 = a * c1, b * c2
        lanes[SLOPE0 + j] = rise - k1 - k2
        lanes[SLOPE1 + j] = rise - k1 * end1 - k2 * end2
        lanes[BEND0 + j] = a * k1 + b * k2
        lanes[BEND1 + j] = a * k1 * end1 + b * k2 * end2
    if poles:
        levels_of(lanes, count, flags, num)
        split_pieces(lanes, turns, live, count, b)


@njit(cache=True, nogil=True, error_model="numpy")
def split_pieces(lanes, turns, live, count, b):
    """Let the first piece of lanes with a turning point that matters end there."""
    for j in range(count):
        lanes[REACHED + j] = 1.0 if may_turn(lanes, j) else 0.0
    some = reached_lanes(lanes, REACHED, count, live)
    for k in range(some):
        j = live[k]
        turns[T.RISE + k], turns[T.C1 + k], turns[T.C2 + k] = lanes[RISE + j], lanes[C1 + j], lanes[C2 + j]
        turns[T.A + k], turns[T.AT_0 + k], turns[T.AT_1 + k] = lanes[A + j], lanes[SLOPE0 + j], lanes[SLOPE1 + j]
    T.find_turns(turns, some, b)
    for k in range(some):
        if turns[T.KIND + k] != T.NEVER:
            j = live[k]
            lanes[S1 + j], lanes[NEXT + j] = turns[T.ROOT + k], T.second_turn(turns, k, b)
            lanes[F1 + j] = lanes[Y0 + j] + turns[T.VALUE + k]


@njit(cache=True, nogil=True, error_model="numpy")
def may_turn(lanes, j):
    """Whether a turning point inside the interval may matter to lane j.

    There is none where neither slope nor curvature changes its sign.  Where only the slope does, the turning point lies
    beyond the ends by less than the smaller of the two slopes (times the interval, which is 1): without a level that
    near, the signal is as good as monotone.
    """
    slope_0, slope_1, bend_0, bend_1 = lanes[SLOPE0 + j], lanes[SLOPE1 + j], lanes[BEND0 + j], lanes[BEND1 + j]
    start, end, beyond = lanes[F0 + j], lanes[F1 + j], min(abs(slope_0), abs(slope_1))
    if bend_0 < 0.0:
        near = max(start, end) + beyond >= lanes[UPPER + j]
    else:
        near = min(start, end) - beyond <= lanes[LOWER + j]
    return (bend_0 * bend_1 <= 0.0) | ((slope_0 * slope_1 <= 0.0) & near)


@njit(cache=True, nogil=True, error_model="numpy")
def end_of_piece(lanes, j, b):
    """The response at the end of lane j's piece."""
    return response(lanes[S1 + j], lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j], b)


@njit(cache=True, nogil=True, error_model="numpy")
def levels_of(lanes, count, flags, num):
    """The lanes' levels in the filter's domain."""
    if len(flags.log_input):
        for j in range(count):
            lanes[UPPER + j], lanes[LOWER + j] = lanes[LEVEL_ON + j], lanes[LEVEL_OFF + j]
    else:
        for j in range(count):
            lanes[UPPER + j] = light_at(lanes[LEVEL_ON + j], num.curve)
        for j in range(count):
            lanes[LOWER + j] = light_at(lanes[LEVEL_OFF + j], num.curve)


@njit(cache=True, nogil=True, error_model="numpy")
def pick(lanes, count, b, floor):
    """Move each lane to the piece in which it reaches a level (REACHED 1; TARGET, UP, AT set), or find none (0)."""
    # (light has a floor of 0: after a flash of many decades the arithmetic may leave less than nothing of it)
    pieces = 0
    for j in range(count):
        set_target(lanes, j, floor)
        pieces += np.int64(lanes[S1 + j] < 1.0)
    if pieces > 0:
        for j in range(count):
            while lanes[REACHED + j] == 0.0 and lanes[S1 + j] < 1.0:
                lanes[S0 + j], lanes[F0 + j] = lanes[S1 + j], lanes[F1 + j]
                lanes[S1 + j], lanes[NEXT + j] = lanes[NEXT + j], 1.0
                lanes[F1 + j] = end_of_piece(lanes, j, b) if lanes[S1 + j] < 1.0 else lanes[LAST + j]
                set_target(lanes, j, floor)
    for j in range(count):
        lanes[F1 + j] = lanes[F1 + j] if lanes[REACHED + j] > 0.0 else np.nan  # a lane that is through stays so


@njit(cache=True, nogil=True, error_model="numpy")
def set_target(lanes, j, floor):
    """The level, if any, that lane j's piece ends at or beyond."""
    end, upper, lower = lanes[F1 + j], lanes[UPPER + j], lanes[LOWER + j]
    end = floor if end < floor else end  # (a NaN stays one)
    up = end >= upper
    lanes[REACHED + j] = 1.0 if up | (end <= lower) else 0.0
    lanes[UP + j], lanes[LABEL + j] = 1.0 if up else 0.0, 0.0
    lanes[TARGET + j] = upper if up else lower
    lanes[AT + j] = lanes[LEVEL_ON + j] if up else lanes[LEVEL_OFF + j]


@njit(cache=True, nogil=True, error_model="numpy")
def halley(s, lo, hi, y0, rise, c1, c2, a, b, two, poles, target, up):
    """One bracketed step: (s, lo, hi, size of the step)."""
    m1 = expm1_64(-a * s) if poles else 0.0
    m2 = expm1_64(-b * s) if two else 0.0
    f = (y0 - target) + (rise * s + (c1 * m1 + c2 * m2))
    k1, k2 = a * c1 * (1.0 + m1), b * c2 * (1.0 + m2)
    d = rise - k1 - k2
    below = (f < 0.0) == up
    lo, hi = s if below else lo, hi if below else s
    step = -(f * d) / (d * d - 0.5 * f * (a * k1 + b * k2))
    there = s + step
    inside = (there >= lo) & (there <= hi)
    # (where the exponentials have died away Halley's step is small without being near: Newton's tells)
    return there if inside else 0.5 * (lo + hi), lo, hi, max(abs(step), abs(f / d)) if inside else 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def solve(lanes, count, flags, b):
    """Four steps for each lane, from the chord's root."""
    poles, two = len(flags.poles) > 0, len(flags.poles) == 2
    for j in range(count):
        y0, rise, c1, c2, a = lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j]
        lo, hi, f0, f1, target = lanes[S0 + j], lanes[S1 + j], lanes[F0 + j], lanes[F1 + j], lanes[TARGET + j]
        up = f1 > f0
        s = lo + (hi - lo) * (target - f0) / (f1 - f0)
        s = min(max(s, lo), hi)
        s, lo, hi, step = halley(s, lo, hi, y0, rise, c1, c2, a, b, two, poles, target, up)
        s, lo, hi, step = halley(s, lo, hi, y0, rise, c1, c2, a, b, two, poles, target, up)
        s, lo, hi, step = halley(s, lo, hi, y0, rise, c1, c2, a, b, two, poles, target, up)
        s, lo, hi, step = halley(s, lo, hi, y0, rise, c1, c2, a, b, two, poles, target, up)
        lanes[WHEN + j], lanes[LOW_S + j], lanes[HIGH_S + j] = s, lo, hi
        lanes[STEP + j] = step * max(1.0, max(a, b))


@njit(cache=True, nogil=True, error_model="numpy")
def settle(lanes, j, b):
    """Finish lane j by Newton's method inside the bracket, halving it where Newton leaves it or is slow."""
    y0, rise, c1, c2, a = lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j]
    target, up = lanes[TARGET + j], lanes[F1 + j] > lanes[F0 + j]
    lo, hi, s = lanes[LOW_S + j], lanes[HIGH_S + j], lanes[WHEN + j]
    enough = 1e-9 / max(1.0, max(a, b))
    for k in range(80):
        m1, m2 = expm1_64(-a * s), expm1_64(-b * s)
        f = (y0 - target) + (rise * s + (c1 * m1 + c2 * m2))
        if (f < 0.0) == up:
            lo = s
        else:
            hi = s
        newton = s - f / (rise - a * c1 * (1.0 + m1) - b * c2 * (1.0 + m2))
        here = newton if (newton > lo) & (newton < hi) & (k % 4 != 3) else 0.5 * (lo + hi)
        if abs(here - s) < enough:
            return here
        s = here
    return s


@njit(cache=True, nogil=True, error_model="numpy")
def take_the_rest(lanes, live, alive, flags, num):
    """Lanes beyond the work cap: the memory goes to the signal at the end of the interval, in one event."""
    for k in range(alive):
        j = live[k]
        if lanes[SOLVED + j] > num.max_crossings:
            lanes[WHEN + j], lanes[S1 + j] = 1.0, 1.0
            last = lanes[LAST + j]
            lanes[F1 + j], lanes[TARGET + j] = last, last
            lanes[AT + j] = last if len(flags.log_input) else log_level(max(last, 0.0), num.curve)


@njit(cache=True, nogil=True, error_model="numpy")
def respond(lanes, pixels, live, count, enough, planes, flags, num, iv, out, n, tally):
    """Rounds of crossings until at most `enough` lanes may have one left: (those lanes' number, out, n)."""
    b = iv.b if len(flags.poles) == 2 else 0.0
    while True:
        levels_of(lanes, count, flags, num)
        pick(lanes, count, b, -np.inf if len(flags.log_input) else 0.0)
        alive = reached_lanes(lanes, REACHED, count, live)
        if 4 * alive < 3 * count:
            keep_lanes(lanes, AT, STEP, pixels, live, alive)
            count = alive
        solve(lanes, count, flags, b)
        for k in range(alive):
            if not lanes[STEP + live[k]] < ENOUGH:
                lanes[WHEN + live[k]] = settle(lanes, live[k], b)
        for j in range(count):
            lanes[SOLVED + j] += 1.0
        over = over_cap(lanes, SOLVED, live, alive, num)
        if over > 0:
            take_the_rest(lanes, live, alive, flags, num)
            tally[CAPPED] += over
        out = room(out, n, alive)
        n = cross_all(lanes, pixels, count, live, alive, planes, flags, num, iv, out, n, tally)
        for j in range(count):
            lanes[S0 + j], lanes[F0 + j] = lanes[WHEN + j], lanes[TARGET + j]
        if alive <= enough:
            keep_lanes(lanes, LEVEL_ON, UPPER, pixels, live, alive)
            return alive, out, n
