"""Meshes as the rays meet them: triangles in the order of their hierarchy, with what each has at its corners."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vid2ev.scenes.rays.hierarchy import build
from vid2ev.scenes.snapshot import Mesh


class MeshNumbers(NamedTuple):
    """See `rays.layout.World`."""

    bounds: np.ndarray
    links: np.ndarray
    corners: np.ndarray
    uv: np.ndarray
    normals: np.ndarray
    colours: np.ndarray
    part: np.ndarray


def numbers_of(mesh: Mesh) -> MeshNumbers:
    """The numbers of one mesh; `Mesh.numbers` keeps them."""
    spots = mesh.vertices[mesh.triangles]
    order, bounds, links = build(spots.min(axis=1), spots.max(axis=1))
    triangles, spots = mesh.triangles[order], spots[order]
    across = np.cross(spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0])
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    n = len(triangles)
    return MeshNumbers(
        bounds,
        links,
        np.stack([spots[:, 0], spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0]], axis=1),
        _at_corners(mesh.uv, triangles, np.zeros((n, 3, 2))),
        _at_corners(mesh.normals, triangles, np.repeat(flat[:, None], 3, axis=1)),
        _at_corners(mesh.colours, triangles, np.ones((n, 3, 3))),
        _planes(flat, spots) if mesh.normals is None else _smooth_parts(mesh.vertices, mesh.normals, triangles),
    )


@lru_cache(maxsize=4)
def joined(meshes: tuple[Mesh, ...]) -> tuple[MeshNumbers, tuple[int, ...]]:
    """Several meshes one after the other, and the first node of each."""
    parts = [mesh.numbers for mesh in meshes] or [_NONE]
    if len(parts) == 1:
        return parts[0], (0,)
    nodes = np.cumsum([0, *(len(part.links) for part in parts)])
    triangles = np.cumsum([0, *(len(part.corners) for part in parts)])
    links = []
    for part, node, triangle in zip(parts, nodes, triangles, strict=False):
        leaf = part.links[:, 1] >= 0
        first = part.links[:, 0] + np.where(leaf, triangle, node)
        links.append(np.stack([first, np.where(leaf, part.links[:, 1], part.links[:, 1] - node)], axis=1))
    whole = MeshNumbers(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    return whole._replace(links=np.concatenate(links).astype(np.int32)), tuple(int(node) for node in nodes[:-1])


def _at_corners(values: np.ndarray | None, triangles: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(otherwise if values is None else values[triangles], np.float32)


def _planes(flat: np.ndarray, spots: np.ndarray) -> np.ndarray:
    """One number for all triangles in the same plane: they have the same light at their common sides."""
    size = max(float(np.ptp(spots)), 1e-300)
    plane = np.column_stack([flat, np.einsum("ij,ij->i", flat, spots[:, 0]) / size])
    return np.unique(np.round(plane, 6), axis=0, return_inverse=True)[1].reshape(-1).astype(np.int32)


def _smooth_parts(vertices: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """One number for all triangles that lead to each other over corners with the same place and normal."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, number = np.unique(np.column_stack([vertices, np.round(normals, 4)]), axis=0, return_inverse=True)
    a, b, c = number.reshape(-1)[triangles].T
    ways = np.concatenate([a, b]), np.concatenate([b, c])
    count = int(number.max()) + 1
    _, label = connected_components(
        coo_array((np.ones(2 * len(a), np.int8), ways), shape=(count, count)), directed=False
    )
    return label[a].astype(np.int32)


_NONE = MeshNumbers(
    np.zeros((0, 6)),
    np.zeros((0, 2), np.int32),
    np.zeros((0, 3, 3)),
    np.zeros((0, 3, 2), np.float32),
    np.zeros((0, 3, 3), np.float32),
    np.zeros((0, 3, 3), np.float32),
    np.zeros(0, np.int32),
)
