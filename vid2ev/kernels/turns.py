"""Turning points of many responses at a time: the vector form of `physics.photoreceptor.turning_points`.

Lanes that may turn are gathered, the first zero of the slope is found by four bracketed steps of Halley's method, and
the few that are not settled then, or turn twice, are finished one by one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernels.layout import LANE_PITCH
from vid2ev.physics.elementary import exp64, log64
from vid2ev.physics.photoreceptor import response, slope_zero

RISE, C1, C2, A, AT_0, AT_1, BEND, LO, HI, ROOT, STEP, KIND, VALUE = (k * LANE_PITCH for k in range(13))
TURNS = 13 * LANE_PITCH
NEVER, ONCE, TWICE = 0.0, 1.0, 2.0
ENOUGH = 1e-3  # last step, in units of the faster time constant: what is left is of third order in it


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def start_turns(turns, count):
    """Start in the middle of each bracket."""
    for k in range(count):
        turns[ROOT + k] = 0.5 * (turns[LO + k] + turns[HI + k])


@njit(cache=True, nogil=True, error_model="numpy")
def step_turns(turns, count, b):
    """One bracketed step towards the first turning point of each lane."""
    for k in range(count):
        rise, a, s = turns[RISE + k], turns[A + k], turns[ROOT + k]
        p1, p2 = a * turns[C1 + k] * exp64(-a * s), b * turns[C2 + k] * exp64(-b * s)
        f, d, dd = rise - p1 - p2, a * p1 + b * p2, -(a * a * p1 + b * b * p2)
        same = (f > 0.0) == (turns[AT_0 + k] > 0.0)
        lo, hi = s if same else turns[LO + k], turns[HI + k] if same else s
        move = -(f * d) / (d * d - 0.5 * f * dd)
        there = s + move
        good = (there >= lo) & (there <= hi)
        # (where the exponentials have died away Halley's step is small without being near: Newton's tells)
        turns[ROOT + k] = there if good else 0.5 * (lo + hi)
        turns[STEP + k] = max(abs(move), abs(f / d)) * max(1.0, max(a, b)) if good else np.inf
        turns[LO + k], turns[HI + k] = lo, hi


@njit(cache=True, nogil=True, error_model="numpy")
def second_turn(turns, k, b):
    """Lane k's turning point after the inflection, if it turns twice; 1.0 otherwise."""
    if turns[KIND + k] != TWICE:
        return 1.0
    c1, c2, a = turns[C1 + k], turns[C2 + k], turns[A + k]
    return slope_zero(turns[BEND + k], 1.0, -turns[AT_0 + k], turns[RISE + k], c1, c2, a, b)


@njit(cache=True, nogil=True, error_model="numpy")
def find_turns(turns, count, b):
    """ROOT is the first turning point of each lane (meaningless where KIND is NEVER), VALUE the response there, less
    y0.
    """
    bracket_turns(turns, count, b)
    start_turns(turns, count)
    for _ in range(4):
        step_turns(turns, count, b)
    for k in range(count):
        if turns[KIND + k] != NEVER and not turns[STEP + k] < ENOUGH:
            rise, c1, c2, a = turns[RISE + k], turns[C1 + k], turns[C2 + k], turns[A + k]
            turns[ROOT + k] = slope_zero(turns[LO + k], turns[HI + k], turns[AT_0 + k], rise, c1, c2, a, b)
    for k in range(count):
        turns[VALUE + k] = response(
            turns[ROOT + k], 0.0, turns[RISE + k], turns[C1 + k], turns[C2 + k], turns[A + k], b
        )
