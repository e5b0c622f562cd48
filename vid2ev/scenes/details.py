"""Where a picture has details that rays through the centres of pixels may miss, or that need finer cells.

    corners    the pixels in which corners of planes, boxes and meshes of few vertices are, and where the outline
               of a cylinder leaves its side
    small      all pixels around a thing whose ball is less than 3 px in radius
    thin       the pixels along the edges of a plane, box or cylinder that is less than 2 px wide

Only things that are wholly before the camera are looked at.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixels_of
from vid2ev.rig.pose import Pose
from vid2ev.scenes.rays.layout import World
from vid2ev.scenes.snapshot import Snapshot, Thing

SMALL_PX, THIN_PX = 3.0, 2.0
FEW = 64  # vertices
AROUND = 0.2  # px: a corner is also in a pixel that begins so near
CUBE = np.array(list(product((-0.5, 0.5), repeat=3)))
EDGES = np.array([(a, b) for a in range(8) for b in range(a) if (a ^ b).bit_count() == 1])


def details_of(snapshot: Snapshot, world: World, intrinsics: Intrinsics, camera: Pose) -> np.ndarray:
    """uint8 [H + 2, W + 2], 1 where pixels (with a margin of 1 px) are to be measured finely."""
    width, height = intrinsics.size
    found = np.zeros((height + 2, width + 2), np.uint8)
    columns, lines = places_of_details(snapshot, world, intrinsics, camera).T
    found[lines, columns] = 1
    return found


def places_of_details(snapshot: Snapshot, world: World, intrinsics: Intrinsics, camera: Pose) -> np.ndarray:
    """Those pixels one by one, int64 [n, 2], column and line; some may be there twice."""
    size = intrinsics.size[0] + 2, intrinsics.size[1] + 2
    focal, back, points, kinds = max(intrinsics.focal_px), camera.inverse(), [np.zeros((0, 3))], ["mesh"]
    found = []
    for thing, (x, y, z, radius) in zip(snapshot.things, world.ball, strict=True):
        if z - radius > 0 and radius * focal / z < SMALL_PX:
            centre = pixels_of(np.array([[x, y, z]]), intrinsics)
            found.append(_around(centre, radius * focal / z + 1, size))
        elif (corners := _corners(thing)) is not None:
            here = back @ thing.pose
            points.append(here.apply(corners))
            kinds.append(thing.shape.kind)
            if thing.shape.kind == "cylinder":
                points.append(here.apply(_rim_ends(thing, here.inverse().translation_m)))
                kinds.append("mesh")
    spots = np.split(pixels_of(np.concatenate(points), intrinsics), np.cumsum([len(some) for some in points[:-1]]))
    sharp = [some for some, kind in zip(spots, kinds, strict=True) if kind != "cylinder"]
    edges = [_thin_edges(some, size) for some, kind in zip(spots, kinds, strict=True) if kind != "mesh"]
    found.append(_around(np.concatenate(sharp), AROUND, size))
    found.append(_around(np.concatenate([np.zeros((0, 2)), *edges]), 0.5, size))
    return np.concatenate(found)


def _corners(thing: Thing) -> np.ndarray | None:
    """Corners of a thing, or of the box around it; None if it has none worth looking at."""
    if thing.shape.kind == "mesh":
        vertices = thing.shape.mesh.vertices  # type: ignore[union-attr]
        return vertices if len(vertices) <= FEW else None
    if thing.shape.kind == "sphere":
        return None
    return CUBE * thing.shape.size_m * ((1, 1, 0) if thing.shape.kind == "plane" else (1, 1, 1))


def _rim_ends(thing: Thing, eye: np.ndarray) -> np.ndarray:
    """Where the outline of a cylinder goes over from its side to its ends, seen from a place: up to four points."""
    half = np.maximum(thing.shape.size_m, 1e-300) / np.float64(2)
    x, y = eye[:2] / half[:2]
    distance = np.hypot(x, y)
    if distance <= 1:
        return np.zeros((0, 3))
    angles = np.arctan2(y, x) + np.arccos(1 / distance) * np.array([-1, 1])
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1) * half[:2]
    return np.concatenate([np.column_stack([around, [z, z]]) for z in (-half[2], half[2])])


def _thin_edges(corners: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Places [n, 2, px] along the edges between eight corners, if these are of a thing that is thin."""
    import cv2

    if np.isfinite(corners).all():
        _, sides, _ = cv2.minAreaRect(np.clip(corners, -1e6, 1e6).astype(np.float32))
        if min(sides) < THIN_PX and max(sides) < 4 * max(size):
            share = np.linspace(0, 1, int(2 * max(sides)) + 2)[:, None, None]
            return (corners[EDGES[:, 0]] * share + corners[EDGES[:, 1]] * (1 - share)).reshape(-1, 2)
    return np.zeros((0, 2))


def _around(places: np.ndarray, around: float, size: tuple[int, int]) -> np.ndarray:
    """The pixels of a canvas of this size within `around` of places [n, 2, px], as a square."""
    steps = 1.5 + np.minimum(np.arange(-around, around + min(1.0, 2 * around), min(1.0, 2 * around)), around)
    columns, lines = (np.floor(np.add.outer(steps, places[:, axis])) for axis in range(2))
    columns, lines = np.broadcast_arrays(columns[:, None], lines[None])
    inside = (columns >= 0) & (columns < size[0]) & (lines >= 0) & (lines < size[1])
    return np.stack([columns[inside], lines[inside]], axis=1).astype(np.int64)
