"""Turning points of many responses at a time: the vector form of `physics.photoreceptor.turning_points`.

Lanes that may turn are gathered, the first zero of the slope is found by four bracketed steps of Halley's method in
float32 and one in float64, and the few that are not settled then, or turn twice, are finished one by one.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.company import rolled
from vid2ev.kernels.layout import LANE_PITCH
from vid2ev.physics.elementary import exp64, expm1_32, expm1_64, log32, log64
from vid2ev.physics.photoreceptor import response, slope_zero

F = np.float32
RISE, C1, C2, A, AT_0, AT_1, BEND, LO, HI, ROOT, STEP, KIND, VALUE = (k * LANE_PITCH for k in range(13))
TURNS = 13 * LANE_PITCH
# Planes of float32 guesses.
G_RISE, G_K1, G_K2, G_A, G_UP, G_ROOT, G_LO, G_HI = (k * LANE_PITCH for k in range(8))
NEVER, ONCE, TWICE = 0.0, 1.0, 2.0
ENOUGH = 1e-3  # last step, in units of the faster time constant: what is left is of third order in it


@inner
def bracket_turns(turns, count, b):
    """Where the first turning point of each lane lies, [LO, HI], and how many there are (KIND)."""
    for k in range(count):
        rise, a = turns[RISE + k], turns[A + k]
        k1, k2 = a * turns[C1 + k], b * turns[C2 + k]
        ratio = -(b * k2) / (a * k1)
        usable = (ratio > 1e-300) & (ratio < 1e300)
        bend = log64(ratio if usable else 1.0) / (b - a)
        inside = usable & (bend > 0.0) & (bend < 1.0)
        bend = bend if inside else 0.0
        middle = rise - k1 * exp64(-a * bend) - k2 * exp64(-b * bend)
        rises, falls_later = turns[AT_0 + k] > 0.0, turns[AT_1 + k] > 0.0
        opposite = rises != falls_later
        before = inside & ((middle > 0.0) != rises)  # the slope has changed its sign at the inflection
        turns[LO + k] = bend if opposite & inside & (before == False) else 0.0  # noqa: E712 (vectorises, `not` does not)
        turns[HI + k] = bend if before else 1.0
        turns[BEND + k] = bend
        turns[KIND + k] = ONCE if opposite else (TWICE if before else NEVER)


@inner
def start_turns(turns, guesses, count, b):
    """The lanes in float32, each starting where two of its three slopes cancel each other."""
    for k in range(count):
        lo, hi, a = turns[LO + k], turns[HI + k], turns[A + k]
        guesses[G_LO + k], guesses[G_HI + k] = lo, hi
        guesses[G_K1 + k], guesses[G_K2 + k], guesses[G_A + k] = a * turns[C1 + k], b * turns[C2 + k], a
        guesses[G_RISE + k], guesses[G_UP + k] = turns[RISE + k], 1.0 if turns[AT_0 + k] > 0.0 else -1.0
    slower = F(b)
    for k in range(count):
        lo, hi, a = guesses[G_LO + k], guesses[G_HI + k], guesses[G_A + k]
        k1, k2, rise = guesses[G_K1 + k], guesses[G_K2 + k], guesses[G_RISE + k]
        first = (a < slower) | (slower == F(0.0))  # (the only pole, or the slower one)
        late = balance(k1 if first else k2, rise, a if first else slower, lo, hi)
        early = balance(k2, -k1, slower - a, lo, hi)
        guesses[G_ROOT + k] = late if late > lo else (early if early > lo else F(0.5) * (lo + hi))


@inner
def balance(k, other, rate, lo, hi):
    """Where k exp(-rate s) has fallen to `other`, if that is between lo and hi; otherwise lo."""
    ratio = k / other
    usable = (ratio > F(1e-30)) & (ratio < F(1e30))
    s = log32(ratio if usable else F(1.0)) / rate
    return s if usable & (s > lo) & (s < hi) else lo


@inner
def improve_turns(guesses, count, b):
    """One bracketed step of Halley's method towards the first turning point of each lane."""
    for k in range(count):
        a, s = guesses[G_A + k], guesses[G_ROOT + k]
        p1 = guesses[G_K1 + k] * (F(1.0) + expm1_32(-a * s))
        p2 = guesses[G_K2 + k] * (F(1.0) + expm1_32(-b * s))
        f, d, dd = guesses[G_RISE + k] - p1 - p2, a * p1 + b * p2, -(a * a * p1 + b * b * p2)
        same = f * guesses[G_UP + k] > F(0.0)
        lo = s if same else guesses[G_LO + k]
        hi = guesses[G_HI + k] if same else s
        there = s - (f * d) / (d * d - F(0.5) * f * dd)
        guesses[G_ROOT + k] = there if (there >= lo) & (there <= hi) else F(0.5) * (lo + hi)
        guesses[G_LO + k], guesses[G_HI + k] = lo, hi


@inner
def polish_turns(turns, count, b):
    """One step in float64, and the VALUE there; STEP is what is left, in units of the faster time constant."""
    for k in range(count):
        rise, c1, c2, a, s = turns[RISE + k], turns[C1 + k], turns[C2 + k], turns[A + k], turns[ROOT + k]
        m1, m2 = expm1_64(-a * s), expm1_64(-b * s)
        p1, p2 = a * c1 * (1.0 + m1), b * c2 * (1.0 + m2)
        f, d, dd = rise - p1 - p2, a * p1 + b * p2, -(a * a * p1 + b * b * p2)
        move = -(f * d) / (d * d - 0.5 * f * dd)
        there = s + move
        good = (there >= turns[LO + k]) & (there <= turns[HI + k])
        turns[ROOT + k] = there if good else s
        # (a Taylor polynomial: with a step of ENOUGH what is left out is 1e-13 of the exponentials)
        turns[VALUE + k] = rise * s + (c1 * m1 + c2 * m2) + move * (f + move * (0.5 * d + move * dd / 6.0))
        # (where the exponentials have died away Halley's step is small without being near: Newton's tells)
        turns[STEP + k] = max(abs(move), abs(f / d)) * max(1.0, max(a, b)) if good else np.inf


@inner
def second_turn(turns, k, b):
    """Lane k's turning point after the inflection, if it turns twice; 1.0 otherwise."""
    if turns[KIND + k] != TWICE:
        return 1.0
    c1, c2, a = turns[C1 + k], turns[C2 + k], turns[A + k]
    return slope_zero(turns[BEND + k], 1.0, -turns[AT_0 + k], turns[RISE + k], c1, c2, a, b)


@inner
def find_turns(turns, guesses, count, b):
    """ROOT is the first turning point of each lane, VALUE the response there less y0; not where KIND is NEVER."""
    bracket_turns(turns, count, b)
    start_turns(turns, guesses, count, b)
    for _ in range(rolled(4)):
        improve_turns(guesses, count, np.float32(b))
    for k in range(count):
        turns[ROOT + k] = guesses[G_ROOT + k]
    polish_turns(turns, count, b)
    for k in range(count):
        if turns[KIND + k] != NEVER and not turns[STEP + k] < ENOUGH:
            rise, c1, c2, a = turns[RISE + k], turns[C1 + k], turns[C2 + k], turns[A + k]
            turns[ROOT + k] = slope_zero(turns[LO + k], turns[HI + k], turns[AT_0 + k], rise, c1, c2, a, b)
            turns[VALUE + k] = response(turns[ROOT + k], 0.0, rise, c1, c2, a, b)
