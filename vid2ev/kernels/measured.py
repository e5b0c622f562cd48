"""What is kept of a block of pixels while it is measured, and the sums that are taken of it: the place of each."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.compiling.intrinsics import bits_32
from vid2ev.kernels.layout import PITCH
from vid2ev.physics.elementary import expm1_32

F = np.float32
# Planes of the state of a block, in units of PITCH; the last four are of memories that jump to the signal.
LIGHT, LEVEL, SLOPE, PLAY, WIDE, WAY, BENDS, TURNS, TURNED_BENDS, PEAKS, TRAVEL, SMOOTH = range(12)
BEHIND, PHASE, TRACE, STIRS, STIRS_AT_TURNS, STRAYS, STRAYS_AT_TURNS = range(12, 19)
PLANES = 19
# Planes of the scratch: light now, light, level and smoothed slope before, bend, all bends as they count at a turn and
# as they are felt, the slope before the bend, the greater of those beside it, and the trace of the events before.
SEEN, LIT, BEFORE, SMOOTHED, BENT, IF_TURNED, FELT, UNBENT, STEEPER, TRACED = (k * PITCH for k in range(10))
BARE_BEFORE = 10 * PITCH
SCRATCH = 11 * PITCH
# Planes of the lanes: what is taken from a pixel, and what is found for it.
AT_LEVEL, AT_PLAY, FROM, AT_SLOPE, AT_SMOOTH, AT_LIGHT, AT_LIT = (k * PITCH for k in range(7))
AT_HALF, PUSHED, MOVED, GONE, SHARE, LOST, STEEP, DIMMEST, TOOK = (k * PITCH for k in range(7, 16))
LANES = 16 * PITCH
# Sums of a block, after its extremes.
TRAVELLED, AT_LEAST, PUSHED_S, TURNED, BEND, TURN_BEND, OFF_PEAKS, OFF_PEAKS_OFTEN = range(3, 11)
FIGURES = 11
# How travel is spread: sums of travel and of travel x number, by the number's quarter of an octave.
BY_SLOPE, BY_TURNS, BY_BENDS, BY_PEAKS, BY_LIGHT, BY_FELT, BY_FELT_AT_TURNS = range(7)
BY_STIRS, BY_STIRS_BEFORE, BY_STIRS_AT_TURNS, BY_STRAYS, BY_STRAYS_BEFORE, BY_STRAYS_AT_TURNS = range(7, 13)
BY_ALL, BY_JUMPS = 7, 13  # how many there are, without and with memories that jump
QUARTERS, LOWEST = 160, (127 - 24) << 2  # from 2**-24, and all below, to 2**16, and all above; four to an octave
OF_ONE = F(0.36787945)  # 1/e
PER_MS, PER_MS2 = F(1e-3), F(1e-6)  # of 1/s and 1/s^2, so that sums are within the quarters


@inner
def gone_of(dt_s, tau_s):
    """What is gone of an exponential after a time; all if it has no time constant."""
    return -expm1_32(-dt_s / tau_s) if tau_s > F(0.0) else F(1.0)


@inner
def left_of(dt_s, tau_s):
    """What is left of it."""
    return F(1.0) - gone_of(dt_s, tau_s)


@inner
def first_tau(light, num):
    """Time constant of the first pole at a light [s], where it depends on that."""
    return F(num.tau1_s) * (F(1.0) + F(num.dark)) / (light + F(num.dark))


@inner
def reach_behind(tau1_s, tau2_s):
    """E (D - E D)+ of the delay D of two poles at most, or of one [s]."""
    if tau1_s * tau2_s > F(0.0):
        return F(0.5) * np.sqrt(tau1_s * tau1_s + tau2_s * tau2_s)
    return max(tau1_s, tau2_s) * OF_ONE


@inner
def note(spread, of, number, counted):
    """Add a travel to the quarter of an octave that a number >= 0 has, of spread [..., QUARTERS, 2]: what is
    counted of it, and that times the number."""
    note_both(spread, of, number, counted, counted * number)


@inner
def note_both(spread, of, number, counted, other):
    """Add what is counted, and something other, to the quarter of an octave that a number >= 0 has."""
    quarter = np.uintp(min(max(np.int64(bits_32(number) >> np.int32(21)) - LOWEST, 0), QUARTERS - 1))
    spread[of, quarter, 0] += counted
    spread[of, quarter, 1] += other
