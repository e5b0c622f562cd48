"""When levels are reached: roots of the closed form of a response, many at a time.

A **job** is a response, y(s) = y0 + rise s + c1 (e^-as - 1) + c2 (e^-bs - 1), and the monotone piece of it, [s0, s1],
in which it is at a level: four steps of Halley's method in float32, and as many in float64 as it takes, vector code all
of it.  What is not settled then is finished by a bracketed search.

Where something that drifts is added to the log of a response of light, the level is a light that moves: in float32 in a
straight line, in float64 as it does.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.company import rolled
from vid2ev.kernels.crossing import UP
from vid2ev.kernels.ladder import AFTER_LADDER, END, REACHED
from vid2ev.kernels.layout import LANE_PITCH, lane
from vid2ev.kernels.path import Path, moved_light, reach, value_inside
from vid2ev.physics.elementary import expm1_32, expm1_64
from vid2ev.physics.log_curve import light_at
from vid2ev.physics.photoreceptor import bracketed

F = np.float32
# A job is planes of a batch, or of the lanes from AFTER_LADDER on: the response, its piece; what is added to its log at
# the start and what more at the end [nat], and which way it goes then.
Y0, RISE, C1, C2, A, FROM_S, FROM_Y, TO_S, TO_Y, BASE, DRIFT, WAY = (k * LANE_PITCH for k in range(12))
JOBS = 12 * LANE_PITCH
# Planes of a batch in float32.
G_D0, G_RISE, G_C1, G_C2, G_A, G_S, G_LO, G_HI, G_UP = (k * LANE_PITCH for k in range(9))
GUESSES = 9 * LANE_PITCH
# Accepted last step, in units of the faster time constant, or of the way in which the slope changes by itself where
# that is shorter, as near a turning point or in the dark before a flash: the method is of third order in it.
ENOUGH = 2e-3
POLISHES = 3  # steps in float64, at the most


@inner
def gather_jobs(jobs, who, count, lanes, flags):
    """The jobs of the lanes `who`."""
    own = lanes[AFTER_LADDER:]
    for k in range(count):
        j = lane(who[k])
        jobs[Y0 + k], jobs[RISE + k] = own[Y0 + j], own[RISE + j]
        jobs[C1 + k], jobs[C2 + k], jobs[A + k] = own[C1 + j], own[C2 + j], own[A + j]
        jobs[FROM_S + k], jobs[TO_S + k] = own[FROM_S + j], own[TO_S + j]
        jobs[FROM_Y + k], jobs[TO_Y + k] = own[FROM_Y + j], own[TO_Y + j]
    if len(flags.drift):
        for k in range(count):
            j = lane(who[k])
            jobs[BASE + k], jobs[DRIFT + k], jobs[WAY + k] = own[BASE + j], own[DRIFT + j], lanes[UP + j]


@inner
def to_signals(levels, count, flags, num):
    """Levels [nat] to levels of what the filter gives, unless these move."""
    if len(flags.log_input) + len(flags.drift) == 0:
        for k in range(count):
            levels[k] = light_at(levels[k], num.curve)


@inner
def batch_times(levels, when, steps, jobs, guesses, who, count, lanes, b, flags, num):
    """Times `when` of a batch of crossings at `levels` [nat] of the lanes `who`."""
    to_signals(levels, count, flags, num)
    gather_jobs(jobs, who, count, lanes, flags)
    left = approach(levels, when, steps, jobs, guesses, count, b, flags.poles, flags.drift, num)
    for k in range(count):
        if not steps[k] < ENOUGH:
            when[k] = finish(levels, jobs, when[k], k, b, flags.poles, flags.drift, num, left)


@inner
def lane_times(levels, when, steps, guesses, live, alive, count, lanes, b, flags, num):
    """Times `when` of one crossing at `levels` [nat] of each of the lanes live[:alive], those that are REACHED.

    Most lanes have one, so their jobs are not copied to a batch; the few others are solved in vain, half-way or at
    the end.
    """
    to_signals(levels, count, flags, num)
    jobs = lanes[AFTER_LADDER:]
    if len(flags.drift):
        for j in range(count):
            levels[j] = levels[j] if lanes[REACHED + j] > 0.0 else lanes[END + j]
            jobs[WAY + j] = lanes[UP + j]
    else:
        for j in range(count):
            levels[j] = levels[j] if lanes[REACHED + j] > 0.0 else 0.5 * (jobs[FROM_Y + j] + jobs[TO_Y + j])
    left = approach(levels, when, steps, jobs, guesses, count, b, flags.poles, flags.drift, num)
    for k in range(alive):
        j = lane(live[k])
        when[k] = when[j]
        if not steps[j] < ENOUGH:
            when[k] = finish(levels, jobs, when[j], j, b, flags.poles, flags.drift, num, left)


@inner
def approach(levels, when, steps, jobs, guesses, count, b, poles, drift, num):
    """Times `when` at which the jobs are at `levels`, and how far off they may be; returns how many of the steps in
    float64 are left to those that are not near enough.

    A job takes as many steps as it needs, whatever the others of its batch do: a batch decides only whether they are
    taken by all at once or (`finish`) by one after the other, so times do not depend on who is in it.
    """
    guess(levels, jobs, guesses, count, drift, num)
    for _ in range(rolled(4)):
        improve(guesses, count, F(b), poles)
    for k in range(count):
        when[k], steps[k] = guesses[G_S + k], np.inf
    left = rolled(POLISHES)
    while left > 0:
        left -= 1
        for k in range(count):
            there, step = polished(levels, jobs, when[k], k, b, poles, drift, num)
            near = steps[k] < ENOUGH
            when[k], steps[k] = when[k] if near else there, steps[k] if near else step
        rough = np.int32(0)
        for k in range(count):
            rough = np.int32(rough + np.int32(0 if steps[k] < ENOUGH else 1))
        if 16 * rough <= count:
            break
    return left


@inner
def guess(levels, jobs, guesses, count, drift, num):
    """The jobs in float32, with the chords' roots as a start."""
    for k in range(count):
        lo, hi, start, stop = jobs[FROM_S + k], jobs[TO_S + k], jobs[FROM_Y + k], jobs[TO_Y + k]
        level, rise, up = levels[k], jobs[RISE + k], stop > start
        if len(drift):  # (as if the light did what its level does)
            middle = 0.5 * (lo + hi)
            there, drifts = levels[k] - jobs[BASE + k] - jobs[DRIFT + k] * middle, jobs[DRIFT + k]
            level, fall, _ = moved_light(there, drifts, num.curve)
            level, rise, up = level + fall * middle, rise + fall, jobs[WAY + k] > 0.0
            start, stop = start + fall * lo, stop + fall * hi
        share = (level - start) / (stop - start)
        guesses[G_D0 + k], guesses[G_RISE + k] = jobs[Y0 + k] - level, rise
        guesses[G_S + k] = lo + (hi - lo) * min(max(share, 0.0), 1.0)
        guesses[G_LO + k], guesses[G_HI + k] = lo, hi
        guesses[G_UP + k] = F(1.0) if up else F(-1.0)
    for k in range(count):
        guesses[G_A + k], guesses[G_C1 + k], guesses[G_C2 + k] = jobs[A + k], jobs[C1 + k], jobs[C2 + k]


@inner
def improve(guesses, count, b, poles):
    """One bracketed step of Halley's method for each guess."""
    one, two = len(poles) > 0, len(poles) == 2
    for k in range(count):
        s, a, c1, c2 = guesses[G_S + k], guesses[G_A + k], guesses[G_C1 + k], guesses[G_C2 + k]
        m1 = expm1_32(-a * s) if one else F(0.0)
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
def polished(levels, jobs, s, k, b, poles, drift, num):
    """One step of Halley's method in float64 for job k at s: the time, and what is left, in units of `ENOUGH`."""
    one, two = len(poles) > 0, len(poles) == 2
    rise, c1, c2, a = jobs[RISE + k], jobs[C1 + k], jobs[C2 + k], jobs[A + k]
    m1 = expm1_64(-a * s) if one else 0.0
    m2 = expm1_64(-b * s) if two else 0.0
    k1, k2 = a * c1 * (1.0 + m1), b * c2 * (1.0 + m2)
    level, d, bend, knee = levels[k], rise - k1 - k2, a * k1 + b * k2, num.curve.log_knee
    if len(drift):
        at, drifts = levels[k] - jobs[BASE + k] - jobs[DRIFT + k] * s, jobs[DRIFT + k]
        level, fall, less = moved_light(at, drifts, num.curve)
        d, bend = d + fall, bend - less
    f = (jobs[Y0 + k] - level) + (rise * s + (c1 * m1 + c2 * m2))
    step = -(f * d) / (d * d - 0.5 * f * bend)
    there = s + step
    inside = (there >= jobs[FROM_S + k]) & (there <= jobs[TO_S + k])
    # (where the exponentials have died away Halley's step is small without being near: Newton's tells)
    left, known = max(abs(step), abs(f / d)) * max(max(1.0, abs(bend / d)), max(a, b)), inside
    if len(drift):  # (beyond the knee a level moves another way than the step knows)
        known = inside & ((at < knee) == (at - drifts * step < knee))
    return there if inside else s, left if known else np.inf


@inner
def finish(levels, jobs, s, k, b, poles, drift, num, left):
    """The root of job k, from what `approach` left of its steps on."""
    while left > 0:
        left -= 1
        s, step = polished(levels, jobs, s, k, b, poles, drift, num)
        if step < ENOUGH:
            return s
    if len(drift):
        return settle_moving(levels[k], jobs, k, b, num)
    return settle(levels[k], jobs, s, k, b)


@inner
def settle_moving(level, jobs, k, b, num):
    """The root of job k at a level [nat] as that of a path, in which what is added drifts."""
    path = Path(
        jobs[Y0 + k], 0.0, jobs[RISE + k], jobs[C1 + k], jobs[C2 + k], jobs[A + k], b, True, jobs[BASE + k],
        jobs[DRIFT + k], num.curve,
    )  # fmt: skip
    lo, hi, up = jobs[FROM_S + k], jobs[TO_S + k], jobs[WAY + k] > 0.0
    begin, end = value_inside(path, lo), value_inside(path, hi)
    if (end < level) == up:  # the end that the next interval starts with is rounded: there, and not before it
        return hi
    return reach(path, level, lo, hi, begin, end, up)


@inner
def settle(level, jobs, s, k, b):
    """The root of job k at a level by Newton's method inside its piece, or halving that where Newton's is slow."""
    rise, c1, c2, a = jobs[RISE + k], jobs[C1 + k], jobs[C2 + k], jobs[A + k]
    d0 = jobs[Y0 + k] - level
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
