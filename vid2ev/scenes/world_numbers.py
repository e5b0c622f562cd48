"""A snapshot as the numbers that rays meet, seen from one camera."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.pose import Pose
from vid2ev.scenes.mesh_numbers import joined
from vid2ev.scenes.rays.layout import MOST_THINGS, NOTHING, POINT, SHADOW_BITS, SUN, World
from vid2ev.scenes.snapshot import KINDS, Lamp, Shape, Snapshot, Texture, Thing
from vid2ev.scenes.surroundings import irradiance_of


def numbers_of(snapshot: Snapshot, camera: Pose) -> World:
    """What rays from a camera (camera to world) meet.  Raises UsageError for more than a key can tell apart."""
    things = list(snapshot.things)
    _check_counts(things, snapshot.lamps)
    to_things = [thing.pose.inverse() @ camera for thing in things]
    balls = np.array([_ball(thing, camera) for thing in things]).reshape(-1, 4)
    nearest = np.maximum(np.linalg.norm(balls[:, :3], axis=1) - balls[:, 3], 0)
    textures = tuple(dict.fromkeys(t for t in (*map(texture_on, things), snapshot.environment) if t is not None))
    numbers = {texture: number for number, texture in enumerate(textures)}
    meshes = tuple(dict.fromkeys(thing.shape.mesh for thing in things if thing.shape.mesh is not None))
    mesh, roots = joined(meshes)
    surfaces = [thing.surface for thing in things]
    sky, dark = snapshot.environment, np.zeros((9, 3))
    pictures, levels, texels = _atlas(textures)
    return World(
        kind=np.array([KINDS.index(thing.shape.kind) for thing in things], np.int64),
        order=np.argsort(nearest, kind="stable"),
        half=_rows([np.array(thing.shape.size_m) / 2 for thing in things], 3),
        turn=_rows([pose.rotation for pose in to_things], 3, 3),
        eye=_rows([pose.translation_m for pose in to_things], 3),
        ball=balls,
        nearest=nearest,
        root=np.array([roots[meshes.index(t.shape.mesh)] if t.shape.mesh else NOTHING for t in things], np.int64),
        colour=_rows([surface.colour for surface in surfaces], 3),
        gloss=_rows([(surface.specular, surface.shininess, surface.emission) for surface in surfaces], 3),
        repeat=_rows([surface.repeat for surface in surfaces], 2),
        wraps=_rows([wraps_on(thing) for thing in things], 2).astype(np.int64),
        texture=np.array([_number(texture_on(thing), numbers) for thing in things], np.int64),
        environment=NOTHING if sky is None else numbers[sky],
        to_environment=_to_environment(snapshot, camera),
        environment_gain=float(snapshot.environment_gain),
        irradiance=dark if sky is None else snapshot.environment_gain * irradiance_of(sky),
        **_lamps(snapshot.lamps, things, camera),
        pictures=pictures,
        levels=levels,
        texels=texels,
        bounds=mesh.bounds,
        links=mesh.links,
        corners=mesh.corners,
        triangle_uv=mesh.uv,
        triangle_normals=mesh.normals,
        triangle_colours=mesh.colours,
        triangle_part=mesh.part,
    )


def _check_counts(things: Sequence[Thing], lamps: Sequence[Lamp]) -> None:
    casting = sum(lamp.shadows for lamp in lamps if lamp.kind != "ambient")
    if casting > SHADOW_BITS:
        raise UsageError(
            f"{casting} lamps with shadows; expected at most {SHADOW_BITS}: let the fainter ones shine without"
        )
    if len(things) > MOST_THINGS:
        raise UsageError(f"{len(things):,} things; expected at most {MOST_THINGS:,}: make meshes of several")


def _rows(values: Sequence, *shape: int) -> np.ndarray:
    return np.array(values, np.float64).reshape(-1, *shape)


def texture_on(thing: Thing) -> Texture | None:
    """The picture on a thing: the surface's, or else that of its mesh; none on a mesh without (u, v)."""
    mesh = thing.shape.mesh
    if mesh is None:
        return thing.surface.texture
    return None if mesh.uv is None else thing.surface.texture or mesh.texture


def _number(texture: Texture | None, numbers: dict[Texture, int]) -> int:
    return NOTHING if texture is None else numbers[texture]


def wraps_on(thing: Thing) -> tuple[bool, bool]:
    """Whether its picture begins anew where (u, v) leave 0 ... 1, across and down."""
    kind, (across, down) = thing.shape.kind, thing.surface.repeat
    around = kind in ("sphere", "cylinder", "mesh")
    return around or abs(across) > 1, kind == "mesh" or abs(down) > 1


def _ball(thing: Thing, camera: Pose) -> tuple[float, ...]:
    """A ball around a thing: its centre in the camera's coordinates, and its radius."""
    centre, radius = _own_ball(thing.shape)
    seen = camera.inverse().apply(thing.pose.apply(centre))
    return (*seen, radius * (1 + 1e-9) + 1e-12)


def _own_ball(shape: Shape) -> tuple[np.ndarray, float]:
    half = np.array(shape.size_m) / 2
    if shape.mesh is not None:
        return shape.mesh.ball
    if shape.kind == "plane":
        half[2] = 0
    if shape.kind == "cylinder":
        half[:2] = max(half[0], half[1]), 0
    return np.zeros(3), float(half.max() if shape.kind == "sphere" else np.linalg.norm(half))


def _to_environment(snapshot: Snapshot, camera: Pose) -> np.ndarray:
    """Rotations [n + 1, 3, 3] from things, and last from the camera, to the environment."""
    to_sky = snapshot.environment_pose.rotation.T
    return np.array([to_sky @ pose.rotation for pose in (*(thing.pose for thing in snapshot.things), camera)])


def _lamps(lamps: Sequence[Lamp], things: Sequence[Thing], camera: Pose) -> dict[str, Any]:
    """The fields of the world that tell of lamps."""
    ambient = sum((np.array(lamp.colour) for lamp in lamps if lamp.kind == "ambient"), np.zeros(3))
    # (those with shadows first: the number of a lamp is that of its bit in a key)
    others = sorted((lamp for lamp in lamps if lamp.kind != "ambient"), key=lambda lamp: not lamp.shadows)
    spots = [np.array(lamp.position_m if lamp.kind == "point" else lamp.direction, np.float64) for lamp in others]
    poses = [thing.pose for thing in things]
    return {
        "ambient": ambient.reshape(1, 3),
        "casts": int(any(lamp.shadows for lamp in others)),
        "lamp_kind": np.array([POINT if lamp.kind == "point" else SUN for lamp in others], np.int64),
        "lamp_colour": _rows([lamp.colour for lamp in others], 3),
        "lamp_reach2": np.array([lamp.reach_m**2 for lamp in others], np.float64),
        "lamp_shadows": np.array([lamp.shadows for lamp in others], np.int64),
        "lamp_in_camera": _rows([_seen(lamp, spot, camera) for lamp, spot in zip(others, spots, strict=True)], 3),
        "lamp": np.array(
            [[_seen(lamp, spot, pose) for lamp, spot in zip(others, spots, strict=True)] for pose in poses], np.float64
        ).reshape(len(things), len(others), 3),
    }


def _seen(lamp: Lamp, spot: np.ndarray, pose: Pose) -> np.ndarray:
    """A lamp's position, or the direction towards it, in the coordinates of a pose."""
    if lamp.kind == "point":
        return pose.inverse().apply(spot)
    return -(pose.rotation.T @ spot) / np.linalg.norm(spot)


@lru_cache(maxsize=2)
def _atlas(textures: tuple[Texture, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The levels of all textures one after the other: `pictures`, `levels` and `texels` of the world."""
    if not textures:
        return np.zeros((0, 2), np.int64), np.zeros((0, 3), np.int64), np.zeros((0, 3), np.float32)
    sets = [texture.levels for texture in textures]
    counts = [len(one.sizes) for one in sets]
    pictures = np.stack([np.cumsum([0, *counts[:-1]]), counts], axis=1)
    firsts = np.cumsum([0, *(len(one.pixels) for one in sets[:-1])])
    levels = np.concatenate([one.sizes + np.array([first, 0, 0]) for one, first in zip(sets, firsts, strict=True)])
    texels = sets[0].pixels if len(sets) == 1 else np.concatenate([one.pixels for one in sets])
    return pictures.astype(np.int64), levels.astype(np.int64), texels
