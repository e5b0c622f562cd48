"""Knots: the instants at which it is found how densely a scene is to be rendered (`instants`).

They are 16 ms apart, or

    1 / 8 of the fastest turn or orbit       what comes into view in each round is to be met there
    1 / 6 of the fastest swing of a shake    at the faster of two it is as fast as anywhere between, but for 1 / 1.15

but at least 2 ms; and there is one in the midst of two keyframes that are nearer to each other than 16 ms, as all of a
motion may be between them, if it is 2 ms from the last such one of the same motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from vid2ev.scenes.scene import LightSource, Object
from vid2ev.scenes.trajectory import Keyframes, Motion, Orbit, Shake, Spin
from vid2ev.scenes.world import World

COARSEST_NS, FINEST_NS = 16_000_000, 2_000_000  # from knot to knot
ROUND_PARTS, SWING_PARTS = 8, 6
STEP_NS = 50_000  # over which motion is measured at a knot


def first_knots_ns(world: World) -> list[int]:
    """The knots of a world [ns], from its beginning to its end."""
    knots_hz = max([1e9 / COARSEST_NS, *map(_knots_hz, _motions(world))])
    parts = math.ceil(world.duration_ns / max(FINEST_NS, 1e9 / knots_hz))
    even = (round(world.duration_ns * k / parts) for k in range(parts + 1))
    sudden = (t_ns for motion in _motions(world) for t_ns in _sudden_ns(motion, world.duration_ns))
    return sorted({*even, *sudden})


def _knots_hz(motion: Motion) -> float:
    """How many knots per second a motion asks for, at least."""
    if isinstance(motion, Spin):
        return ROUND_PARTS * abs(motion.rate_deg_s) / 360
    if isinstance(motion, Orbit):
        return ROUND_PARTS / motion.period_s
    return SWING_PARTS * motion.high_hz if isinstance(motion, Shake) else 0.0


def _sudden_ns(motion: Motion, end_ns: int) -> list[int]:
    """Instants before an end in the midst of what may begin and end between two knots, FINEST_NS apart."""
    found: list[int] = []
    for begin_s, end_s in pairwise(motion.times_s if isinstance(motion, Keyframes) else ()):
        t_ns = round(1e9 * max(begin_s, (begin_s + end_s) / 2 - 0.5e-9 * STEP_NS))
        near = 1e9 * (end_s - begin_s) < COARSEST_NS
        if near and 0 < t_ns < end_ns and (not found or t_ns - found[-1] >= FINEST_NS):
            found.append(t_ns)
    return found


def _motions(world: World) -> Iterator[Motion]:
    """All motions of camera, things and lamps."""
    things: list[Object | LightSource] = [*world.scene.objects, *world.scene.lights]
    for trajectory in (world.scene.camera.trajectory, *(thing.trajectory for thing in things)):
        yield from trajectory
