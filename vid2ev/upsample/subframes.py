"""How many steps an interval needs, and when they fall.

A pixel's light between two frames is taken to be straight; where a textured scene moves at v [px/s] it is
curved, and a crossing is misplaced by up to kappa v T**2 / 8 after a step of T [s], kappa = |L_xx| / |L_x|
being the curvature of edges.  Beyond half a pixel per step whole edges are jumped over.  So

    T_step = min( sqrt(8 tolerance / (kappa v)), 0.5 px / v )

and an interval T in which things move by d = v T [px] takes

    n = ceil( max( d / 0.5 px, sqrt(kappa d T / (8 tolerance)) ) )        1 if d < 0.05 px

Sources: the error of linear interpolation, |f''| T**2 / 8 (any text on numerical analysis), divided by the
slope; kappa 0.4 / px measured on photographs seen through a lens blur of 0.7 px.
"""

from __future__ import annotations

import math

TOLERANCE_S = 50e-6
KAPPA_PER_PX = 0.4
LONGEST_STEP_PX = 0.5
STILL_PX = 0.05


def steps_for(shift_px: float, interval_s: float) -> int:
    """Steps for an interval in which things move by shift_px, at least 1."""
    if shift_px < STILL_PX:
        return 1
    curved = math.sqrt(KAPPA_PER_PX * shift_px * interval_s / (8 * TOLERANCE_S))
    return max(1, math.ceil(max(shift_px / LONGEST_STEP_PX, curved)))


def instants(start_ns: int, end_ns: int, steps: int) -> list[int]:
    """The times [ns] that divide an interval evenly, without its ends: steps - 1 of them, to the nearest
    nanosecond.

    Strictly increasing: an interval of fewer nanoseconds than steps is divided into nanoseconds.
    """
    length_ns = end_ns - start_ns
    steps = min(steps, length_ns)
    return [start_ns + (2 * k * length_ns + steps) // (2 * steps) for k in range(1, steps)]
