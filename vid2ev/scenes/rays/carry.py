"""Where the point that a pixel sees is at another instant, and whether it is seen then."""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import NOTHING
from vid2ev.scenes.rays.meet import meet

SAME_DEPTH = 1e-4  # of the depth


@law
def carry(world, motions, x, y, depth, thing, stack):
    """(x, y) on the plane z = 1 of the second camera, NaN if not in front of it, and whether it sees the point.

    world    of the second instant
    motions  float64 [n + 1, 3, 4]: of each thing, from the first camera to the second; the last one turns directions
    x, y     the ray through the pixel, which meets `thing` at `depth`; what is not, or infinitely far, is a direction
    """
    number, along = thing, depth
    if not (thing >= 0 and depth < math.inf):
        number, along = len(world.kind), 1.0
    px, py, z = moved(motions, number, along * x, along * y, along)
    if not z > 0.0:
        return math.nan, math.nan, False
    there_x, there_y = px / z, py / z
    if not (abs(there_x) >= 0.0 and abs(there_y) >= 0.0):
        return math.nan, math.nan, False
    found, t, _, _, _ = meet(world, world.order, len(world.order), there_x, there_y, stack)
    if number == len(world.kind):
        return there_x, there_y, found == NOTHING
    return there_x, there_y, found == thing and abs(t - z) <= SAME_DEPTH * z


@law
def moved(motions, i, x, y, z):
    """A point after a motion."""
    m = motions
    return (
        m[i, 0, 0] * x + m[i, 0, 1] * y + m[i, 0, 2] * z + m[i, 0, 3],
        m[i, 1, 0] * x + m[i, 1, 1] * y + m[i, 1, 2] * z + m[i, 1, 3],
        m[i, 2, 0] * x + m[i, 2, 1] * y + m[i, 2, 2] * z + m[i, 2, 3],
    )
