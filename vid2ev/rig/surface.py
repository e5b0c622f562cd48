"""The surface that a depth map is, and how it lies in the picture of another camera.

A source pixel with direction (x, y, 1) and inverse depth w = 1 / Z is seen by a camera at

    (a, b, c) = R' (x, y, 1) - w R' t,      u = fx a / c + cx,      v = fy b / c + cy,      1 / Z_there = w / c

(X_source = R X_camera + t), which holds for w = 0, infinitely far, too.  Two triangles join each four neighbours.
Every pixel of the camera whose centre lies in a triangle gets the place in the source that it sees, perspective
regarded; the nearest triangle wins.  Neighbours share their corners, so there are no cracks between them.

**Cuts.**  Where a surface would have to be steeper than `STEEPEST_DEG` against the line of sight,

    |w1 - w2| > tan(STEEPEST_DEG) / f max(w1, w2)                                       f in px

there are two surfaces, one before the other.  There each pixel keeps its own square of half a pixel around, at the
depth of its own surface, and what opens up between is a hole.  Gaps of up to `GAP_PX` are bridged all the same: they
are steps of a depth map with few digits.  Triangles seen from behind are left out.

Source: the projection of planar patches is a homography (R. Hartley, A. Zisserman, "Multiple View Geometry", 2004,
section 13.1), so that source places are linear in screen coordinates after division by c.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.rig.bands import Bands
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import bent, rays_of
from vid2ev.rig.pose import Pose
from vid2ev.rig.triangles import draw_patches, draw_quads

F = np.float32
STEEPEST_DEG = 85.0
GAP_PX = 2.0
NEAREST = F(1e-6)  # of the distance from the source: what is nearer to the camera's plane, or behind it, is not seen
CUTS_AT_ONCE = 1 << 16


class Corners(NamedTuple):
    """The corners of the surface: the source's pixel centres, and its borders half a pixel further out."""

    columns: np.ndarray  # [W + 2] px of the source
    rows: np.ndarray  # [H + 2]
    rays: np.ndarray  # [H + 2, W + 2, 2] float32, on the plane z = 1; NaN where the lens sees nothing


class Surface(NamedTuple):
    """A depth map as a surface."""

    corners: Corners
    inverse: np.ndarray  # [H + 2, W + 2] float32, 1/m
    steep: float  # the step of inverse depth, as a share, from one pixel to the next that is a cut
    cut: np.ndarray  # [H + 1, W + 1] bool: a cut passes between these four corners
    near_cut: np.ndarray  # [H, W] bool: a cut is so near that sampling has to look out


class Seen(NamedTuple):
    """What a camera sees of a surface: for its pixels [h, w], float32."""

    x: np.ndarray  # the place in the source [px]; meaningless in holes
    y: np.ndarray
    inverse: np.ndarray  # inverse depth in the camera's coordinates [1/m]; -1 in holes


def corners_of(source: Intrinsics) -> Corners:
    """The corners of every surface of a source."""
    width, height = source.size
    columns, rows = (np.concatenate([[-0.5], np.arange(n), [n - 0.5]]) for n in (width, height))
    rays = rays_of(np.stack(np.meshgrid(columns, rows), axis=-1), source)[..., :2]
    return Corners(columns.astype(F), rows.astype(F), rays.astype(F))


def surface_of(inverse: np.ndarray, corners: Corners, source: Intrinsics) -> Surface:
    """The surface of inverse depths [H, W], all of them at least 0 and finite."""
    inverse = np.pad(inverse.astype(F, copy=False), 1, mode="edge")
    steep = math.tan(math.radians(STEEPEST_DEG)) / max(source.focal_px)
    cut = np.empty((inverse.shape[0] - 1, inverse.shape[1] - 1), np.bool_)
    near_cut = np.zeros((inverse.shape[0] - 2, inverse.shape[1] - 2), np.bool_)
    _find_cuts(inverse, F(steep), cut, near_cut)
    return Surface(corners, inverse, steep, cut, near_cut)


def seen_of(surface: Surface, camera: Intrinsics, pose: Pose, bands: Bands) -> Seen:
    """What a camera sees of a surface; pose: from its coordinates to those of the source."""
    shape = camera.size[::-1]
    seen = Seen(np.zeros(shape, F), np.zeros(shape, F), np.full(shape, -1, F))
    columns, rows, rays = surface.corners
    quads = (*_placed(rays, surface.inverse, camera, pose), columns, rows, surface.cut, F(GAP_PX))
    bands.run(shape[0], draw_quads, *quads, *seen)
    cuts = np.argwhere(surface.cut)
    for first in range(0, len(cuts), CUTS_AT_ONCE):
        patches = _patches_of(surface, cuts[first : first + CUTS_AT_ONCE])
        drawn = (*_placed(patches.rays, patches.inverse, camera, pose), patches.columns, patches.rows)
        bands.run(shape[0], draw_patches, *drawn, *seen)
    return seen


def _placed(rays: np.ndarray, inverse: np.ndarray, camera: Intrinsics, pose: Pose) -> tuple[np.ndarray, ...]:
    """u, v, 1 / c and inverse depth there, of places with direction and inverse depth; NaN what is not in front."""
    shape = inverse.shape
    u, v, over_c, there = (np.empty(inverse.size, F) for _ in range(4))
    back = pose.inverse()
    turn, way = back.rotation.astype(F), back.translation_m.astype(F)
    flat = camera.model == "none"
    (fx, fy), (cx, cy) = (camera.focal_px, camera.centre_px) if flat else ((1.0, 1.0), (0.0, 0.0))
    lens = np.array([fx, fy, cx, cy], F)
    _place(rays.reshape(-1, 2), inverse.reshape(-1), turn, way, lens, u, v, over_c, there)
    if not flat:
        u, v = np.moveaxis(bent(np.stack([u, v], axis=-1), camera), -1, 0)
    return tuple(np.ascontiguousarray(values).reshape(shape) for values in (u, v, over_c, there))


@cached
def _place(rays, inverse, turn, way, lens, u, v, over_c, there):
    for i in range(inverse.size):
        x, y, w = rays[i, 0], rays[i, 1], inverse[i]
        a = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] + way[0] * w
        b = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] + way[1] * w
        c = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] + way[2] * w
        q = F(1) / c if c > NEAREST else F(np.nan)
        u[i], v[i] = lens[0] * a * q + lens[2], lens[1] * b * q + lens[3]
        over_c[i], there[i] = q, w * q


@cached
def _find_cuts(inverse, steep, cut, near_cut):
    height, width = near_cut.shape
    for j in range(height + 1):
        for i in range(width + 1):
            a, b, c, d = inverse[j, i], inverse[j, i + 1], inverse[j + 1, i], inverse[j + 1, i + 1]
            cut[j, i] = max(a, b, c, d) - min(a, b, c, d) > steep * max(a, b, c, d)
            if cut[j, i]:  # (between pixels i - 1 and i; sampling looks two pixels away from the nearest one)
                near_cut[max(j - 2, 0) : min(j + 2, height), max(i - 2, 0) : min(i + 2, width)] = True


class _Patches(NamedTuple):
    """Quarters of quads: their corners, clockwise."""

    columns: np.ndarray  # [n, 4] place in the source
    rows: np.ndarray
    rays: np.ndarray  # [n, 4, 2]
    inverse: np.ndarray  # [n, 4]


def _patches_of(surface: Surface, quads: np.ndarray) -> _Patches:
    """Each of the quads [n, 2 (row, column)] as four patches, at the depth of the surface that its corner is on."""
    shape = (4 * len(quads), 4)
    patches = _Patches(np.empty(shape, F), np.empty(shape, F), np.empty((*shape, 2), F), np.empty(shape, F))
    _quarter(quads, *surface.corners, surface.inverse, F(surface.steep), *patches)
    return patches


@cached
def _quarter(quads, columns, rows, rays, inverse, steep, patch_columns, patch_rows, patch_rays, patch_inverse):
    depth, joined, own = np.empty(4, np.float32), np.empty(4, np.bool_), np.empty(4, np.float32)
    for n in range(len(quads)):
        j, i = quads[n, 0], quads[n, 1]
        depth[0], depth[1] = inverse[j, i], inverse[j, i + 1]  # (the corners clockwise)
        depth[3], depth[2] = inverse[j + 1, i], inverse[j + 1, i + 1]
        for k in range(4):  # (k and k + 1 are on one surface)
            one, two = depth[k], depth[(k + 1) % 4]
            joined[k] = abs(one - two) <= steep * max(one, two)
        for k in range(4):
            _depths_of_quarter(depth, joined, k, own)
            for c in range(4):  # the corner, half-way to the next, the middle, half-way to the one before
                along, inwards = (F(0), F(0.5), F(0.5), F(0))[c], (F(0), F(0), F(0.5), F(0.5))[c]
                # (from corner 0 the way to the next goes to the right, from corner 1 down, and so on)
                right = (along, F(1) - inwards, F(1) - along, inwards)[k]
                down = (inwards, along, F(1) - inwards, F(1) - along)[k]
                patch = 4 * n + k
                patch_columns[patch, c] = columns[i] + right * (columns[i + 1] - columns[i])
                patch_rows[patch, c] = rows[j] + down * (rows[j + 1] - rows[j])
                for axis in range(2):
                    above = rays[j, i, axis] + right * (rays[j, i + 1, axis] - rays[j, i, axis])
                    below = rays[j + 1, i, axis] + right * (rays[j + 1, i + 1, axis] - rays[j + 1, i, axis])
                    patch_rays[patch, c, axis] = above + down * (below - above)
                patch_inverse[patch, c] = own[c]


@cached
def _depths_of_quarter(depth, joined, k, own):
    """Inverse depths of the patch at corner k: means with the corners on the same surface, so that patches meet."""
    following, before = (k + 1) % 4, (k + 3) % 4
    own[0] = depth[k]
    own[1] = F(0.5) * (depth[k] + depth[following]) if joined[k] else depth[k]
    own[3] = F(0.5) * (depth[k] + depth[before]) if joined[before] else depth[k]
    total, count = depth[k], F(1)  # (of all corners that can be reached from this one)
    for way in (1, 3):
        at = k
        while count < F(4) and joined[at if way == 1 else (at + 3) % 4]:
            at = (at + way) % 4
            total, count = total + depth[at], count + F(1)
    own[2] = total / count
