"""Shapes as triangles, with what each has at its corners.

    plane, box          exact
    sphere, cylinder    vertices on the surface: edges are inside by r (1 - cos(pi / AROUND)), or 0.01 px of a sphere
                        300 px wide

How (u, v) lie on shapes is told in `scenes.snapshot`.  Next to the poles of a sphere the rows get narrower, because
triangles there have no longitude of their own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vid2ev.scenes.snapshot import Mesh, Shape

AROUND = 256  # corners of a circle
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
SQUARE_UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
# of each side of a box: where x, y and the inwards z of its plane go
SIDES = np.array(
    [
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    np.float64,
)


class Corners(NamedTuple):
    """Triangles: vertices [n, 3] m, triangles [m, 3], and of their corners uv [m, 3, 2], normals [m, 3, 3] (none where
    each triangle is flat: [0, 3, 3]) and colours [m, 3, 3]."""

    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray
    normals: np.ndarray
    colours: np.ndarray


FLAT = np.zeros((0, 3, 3))


def corners_of(shape: Shape) -> Corners:
    """The triangles of a shape, in its own coordinates."""
    if shape.mesh is not None:
        return _of_mesh(shape.mesh)
    made = {"plane": _plane, "box": _box, "sphere": _sphere, "cylinder": _cylinder}[shape.kind](np.array(shape.size_m))
    return made._replace(colours=np.ones((len(made.triangles), 3, 3)))


def _of_mesh(mesh: Mesh) -> Corners:
    # (Blender takes no triangle with a corner twice)
    triangles = mesh.triangles[(mesh.triangles != np.roll(mesh.triangles, 1, axis=1)).all(axis=1)]
    uv = np.zeros((len(triangles), 3, 2)) if mesh.uv is None else mesh.uv[triangles]
    normals = FLAT if mesh.normals is None else mesh.normals[triangles]
    colours = np.ones((len(triangles), 3, 3)) if mesh.colours is None else mesh.colours[triangles]
    return Corners(mesh.vertices, triangles, uv, normals, colours)


def _plane(size: np.ndarray) -> Corners:
    return _quads(SQUARE * size / 2, np.array([[0, 1, 2, 3]]), SQUARE_UV[None])


def _box(size: np.ndarray) -> Corners:
    vertices = np.concatenate([(SQUARE - (0, 0, 1)) @ side for side in SIDES]) * size / 2
    return _quads(vertices, np.arange(24).reshape(6, 4), np.repeat(SQUARE_UV[None], 6, axis=0))


def _sphere(size: np.ndarray) -> Corners:
    fine = 1 / (AROUND // 2) / 2.0 ** np.arange(1, 6)
    down = np.unique([*np.linspace(0, 1, AROUND // 2 + 1), *fine, *(1 - fine)])
    u, v = np.meshgrid(np.linspace(0, 1, AROUND + 1), down)
    longitude, latitude = 2 * math.pi * (u - 0.5), math.pi * v
    # (x, -z) = sin(latitude) (sin, cos)(longitude), y = -cos(latitude)
    unit = np.stack(
        [np.sin(latitude) * np.sin(longitude), -np.cos(latitude), -np.sin(latitude) * np.cos(longitude)], axis=-1
    ).reshape(-1, 3)
    made = _grid(unit * size / 2, np.stack([u, v], axis=-1))
    with_normals = _across(unit, size)[made.triangles]
    return made._replace(normals=with_normals)


def _cylinder(size: np.ndarray) -> Corners:
    u, v = np.meshgrid(np.linspace(0, 1, 2 * AROUND + 1), [0.0, 1.0])
    turn = 2 * math.pi * (0.5 - u)
    unit = np.stack([np.cos(turn), np.sin(turn), 2 * v - 1], axis=-1).reshape(-1, 3)
    side = _grid(unit * size / 2, np.stack([u, v], axis=-1))
    side = side._replace(normals=_across(unit * (1, 1, 0), size)[side.triangles])
    parts = [side, *(_end(unit[: 2 * AROUND, :2], size, z) for z in (-1.0, 1.0))]
    firsts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    triangles = [part.triangles + first for part, first in zip(parts, firsts, strict=False)]
    joined = [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]
    return Corners(joined[0], np.concatenate(triangles), joined[2], joined[3], FLAT)


def _end(rim: np.ndarray, size: np.ndarray, z: float) -> Corners:
    """A fan of triangles: the low end as a plane, the high one as the far side of a box."""
    count = len(rim)
    vertices = np.column_stack([np.concatenate([[[0.0, 0.0]], rim]), np.full(count + 1, z)])
    number = np.arange(count)
    triangles = np.column_stack([0 * number, 1 + number, 1 + (number + 1) % count])[:, :: -int(z)]
    uv = vertices[:, :2] * (-z, 1) / 2 + 0.5
    normals = np.tile([0.0, 0, z], (count, 3, 1))
    return Corners(vertices * size / 2, triangles, uv[triangles], normals, FLAT)


def _across(unit: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Unit normals of an ellipsoid that is a scaled unit sphere."""
    normals = unit / np.maximum(size, 1e-12)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def _grid(vertices: np.ndarray, uv: np.ndarray) -> Corners:
    """Quadrangles between vertices in rows and columns."""
    rows, columns = uv.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    quads = np.stack([first, first + 1, first + columns + 1, first + columns], axis=1)
    return _quads(vertices, quads, uv.reshape(-1, 2)[quads])


def _quads(vertices: np.ndarray, quads: np.ndarray, uv: np.ndarray) -> Corners:
    """Two triangles for each four corners [n, 4], with uv [n, 4, 2] to the right and down as seen from outside."""
    halves = [[0, 2, 1], [0, 3, 2]]  # (counter-clockwise)
    return Corners(vertices, quads[:, halves].reshape(-1, 3), uv[:, halves].reshape(-1, 3, 2), FLAT, FLAT)
