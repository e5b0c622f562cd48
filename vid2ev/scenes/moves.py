"""What moves from one snapshot to the next, and the balls in which a camera may see the difference.

Where nothing but things moves, a picture changes only along rays that meet one of them, before or after, or that meet
what may be in its shadow: everything behind it as seen from a lamp, as far as things are.
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev.scenes.rays.layout import MESH, POINT, World

ROWS = (
    "kind", "half", "turn", "eye", "ball", "nearest", "root", "colour", "gloss", "repeat", "wraps", "texture",
    "to_environment", "lamp",
)  # fmt: skip
WIDEST = 0.9  # sine of half the angle that a thing may take up before a lamp, for its shadow to be bounded
SHADOW_BALLS = 512


def moved_things(before: World, after: World) -> np.ndarray | None:
    """Which things [n] are not what or where they were; None where more than things has changed."""
    count = len(after.kind)
    if len(before.kind) != count:
        return None
    others = [name for name in World._fields if name not in (*ROWS, "order")]
    if not all(_same(getattr(before, name), getattr(after, name)) for name in others):
        return None
    if not np.array_equal(before.to_environment[count], after.to_environment[count]):  # (the camera's)
        return None
    moved = np.zeros(count, bool)
    for name in ROWS:
        changed = getattr(before, name)[:count] != getattr(after, name)[:count]
        moved |= changed.any(axis=tuple(range(1, changed.ndim)))
    return moved


def balls_between(before: World, after: World) -> np.ndarray | None:
    """The balls, as `touch` takes them, that hold all that moves and all that its shadows may fall on; None for
    everywhere."""
    moved = moved_things(before, after)
    if moved is None:
        return None
    balls = np.concatenate([world.ball[moved] for world in (before, after)])
    shadows = [np.empty((0, 4))]
    if after.casts and len(balls):
        for lamp in np.flatnonzero(after.lamp_shadows):
            for ball in balls:
                shadow = _shadow(ball, after.lamp_in_camera[lamp], after.lamp_kind[lamp] == POINT, after.ball)
                if shadow is None:
                    return None
                shadows.append(shadow[_touches(shadow, after)])  # (what moved away has a ball of its own)
    return _as_seen(np.concatenate([balls, *shadows]))


def _same(one: object, other: object) -> bool:
    return one is other or np.array_equal(one, other)  # type: ignore[arg-type]


def _shadow(ball: np.ndarray, lamp: np.ndarray, near: bool, things: np.ndarray) -> np.ndarray | None:
    """Balls [n, 4] around all that a ball hides from a lamp, as far as there are balls of things; None if it may be
    anything."""
    centre, radius = ball[:3], ball[3]
    far = float((np.linalg.norm(things[:, :3] - centre, axis=1) + things[:, 3]).max())
    if near:
        distance = float(np.linalg.norm(centre - lamp))
        if radius >= WIDEST * distance:
            return None
        way, spread = (centre - lamp) / distance, radius / math.sqrt(distance * distance - radius * radius)
        # Each ball is behind the one before by what the shadow is wide there.
        count = 1 + math.ceil(math.log1p(far / distance) / math.log1p(spread))
        from_lamp = distance * (1 + spread) ** np.arange(min(count, SHADOW_BALLS + 1))
        along, radii = from_lamp - distance, 1.5 * (1 + spread) * spread * from_lamp
    else:
        way, count = -lamp, 1 + math.ceil(far / (1.5 * radius))
        along = 1.5 * radius * np.arange(min(count, SHADOW_BALLS + 1))
        radii = np.full(len(along), 1.26 * radius)  # sqrt(1 + 0.75^2) at least
    if count > SHADOW_BALLS:
        return None
    return np.column_stack([centre + along[:, None] * way, radii])


def _touches(balls: np.ndarray, world: World) -> np.ndarray:
    """Which of the balls [n] reach any thing: the box around it, or the ball of a mesh."""
    touches = np.zeros(len(balls), bool)
    for thing in range(len(world.kind)):
        if world.kind[thing] == MESH:
            gaps = np.linalg.norm(balls[:, :3] - world.ball[thing, :3], axis=1) - world.ball[thing, 3]
        else:
            inside = balls[:, :3] @ world.turn[thing].T + world.eye[thing]
            gaps = np.linalg.norm(np.maximum(np.abs(inside) - world.half[thing], 0), axis=1)
        touches |= gaps <= balls[:, 3] * (1 + 1e-9)
    return touches


def _as_seen(balls: np.ndarray) -> np.ndarray:
    """Balls [n, 4] as directions and angles [n, 6]."""
    distance = np.linalg.norm(balls[:, :3], axis=1)
    inside = ~(distance > balls[:, 3])
    sine = np.where(inside, 0.0, balls[:, 3] / np.where(inside, 1.0, distance))
    arc = np.where(inside, math.pi, np.arcsin(sine))
    return np.column_stack([balls[:, :3] / np.where(inside, 1.0, distance)[:, None], sine, np.sqrt(1 - sine**2), arc])
