"""Lenses: from directions to pixels and back, distortion and all.

    px = K distortion(x / z, y / z)          `pixels_of`
    (x, y, 1) = the direction of px          `rays_of`

The distortion itself is kornia's, in float64.  Its inverse has no closed form: a first guess comes from a table of the
radial part, and Newton's method refines it with the full law, until the pixel is met to 1e-9 px.

A polynomial describes a lens only as far as it was fitted.  Further out it may turn back, so that directions from far
outside land in the picture a second time.  What lies beyond the turn, and what is not in front of the camera, has no
pixel: it is NaN.

Sources: the models of OpenCV 4.x ("Camera calibration and 3D reconstruction", "Fisheye camera model"), as in kornia's
`distort_points` and `distort_points_kannala_brandt`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vid2ev.rig.intrinsics import DistortionModel, Intrinsics

if TYPE_CHECKING:
    from torch import Tensor

FIELD_DEG = 89.5  # from the axis; a plane at z = 1 cannot hold more
STEPS = 12  # of Newton's method, at most
NEAR_PX = 1e-6  # what counts as met


def pixels_of(points: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """Pixels [..., 2] where points or directions [..., 3] of the camera's coordinates are seen; NaN where they are not.

    The picture's borders are not regarded.
    """
    points = np.asarray(points, np.float64)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        plane = points[..., :2] / np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    plane[np.isnan(plane).any(-1)] = np.nan
    return bent(plane, camera)


def rays_of(px: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """Directions [..., 3] with z = 1 that pixels [..., 2] look into, in the camera's coordinates; NaN where none."""
    px = np.asarray(px, np.float64)
    plane = (px - camera.centre_px) / camera.focal_px
    if camera.model != "none":
        plane = _straightened(px, plane, camera)
    return np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], axis=-1)


def pixel_grid(size: tuple[int, int]) -> np.ndarray:
    """The centres of all pixels [H, W, 2], float64."""
    return np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1).astype(np.float64)


def bent(plane: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """Pixels [..., 2] of places [..., 2] on the plane z = 1, in the same precision; NaN beyond the lens's field."""
    if camera.model == "none":
        with np.errstate(over="ignore"):  # (what is seen along the picture's plane is infinitely far out)
            return (plane * camera.focal_px + camera.centre_px).astype(plane.dtype)
    import torch

    return bent_tensor(torch.from_numpy(plane), camera).numpy()


def bent_tensor(plane: Tensor, camera: Intrinsics) -> Tensor:
    """`bent` of a tensor, on its device."""
    if camera.model == "none":
        return plane * plane.new_tensor(camera.focal_px) + plane.new_tensor(camera.centre_px)
    limit = plane.new_tensor(radial_table(camera)[0][-1])
    inside = plane[..., 0] ** 2 + plane[..., 1] ** 2 <= limit * limit
    px = _distorted_tensor(plane.where(inside[..., None], 0), camera)
    px[~inside] = math.nan
    return px


def focal_of_field(width: int, fov_deg: float, model: DistortionModel, distortion: tuple[float, ...]) -> float:
    """The focal length [px] with which the middle row, of so many pixels, sees a field [deg] from border to border,
    what the lens does across its radius (tangential distortion) left aside.

    Raises ValueError for a lens that does not see so far.
    """
    plain = _radial(model, distortion)
    edge = float(bent(np.array([[math.tan(math.radians(fov_deg) / 2), 0.0]]), plain)[0, 0])
    if not edge > 0:
        widest = 2 * math.degrees(math.atan(radial_table(plain)[0][-1]))
        raise ValueError(
            f"fov_deg {fov_deg:g} is more than this lens sees, {widest:.4g}: make it less, or state focal_px"
        )
    return width / 2 / edge


def _radial(model: DistortionModel, distortion: tuple[float, ...]) -> Intrinsics:
    """What a lens does along its radius alone, for places on the plane z = 1."""
    along = (*distortion[:2], 0.0, 0.0, *distortion[4:]) if model == "radtan" else distortion
    return Intrinsics(size=(1, 1), focal_px=(1.0, 1.0), centre_px=(0.0, 0.0), model=model, distortion=along)


@lru_cache(maxsize=64)
def radial_table(camera: Intrinsics) -> tuple[np.ndarray, np.ndarray]:
    """Radii on the plane z = 1, rising from 0, and the radii that the lens makes of them, as far as these rise, too."""
    radii = np.tan(np.radians(np.linspace(0, FIELD_DEG, 8192)))
    plain = _radial(camera.model, camera.distortion)
    with np.errstate(over="ignore", invalid="ignore"):
        made = _distorted(np.stack([radii, np.zeros_like(radii)], -1), plain)[:, 0]
        rising = np.diff(made) > 0
    count = int(np.argmin(rising)) + 1 if not rising.all() else radii.size
    return radii[:count], made[:count]


def _distorted(plane: np.ndarray, camera: Intrinsics) -> np.ndarray:
    import torch

    return _distorted_tensor(torch.from_numpy(np.ascontiguousarray(plane)), camera).numpy()


def _distorted_tensor(plane: Tensor, camera: Intrinsics) -> Tensor:
    from kornia.geometry.calibration import distort_points
    from kornia.geometry.camera import distort_points_kannala_brandt

    points = plane.reshape(-1, 2)
    (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
    if camera.model == "equidistant":
        values = points.new_tensor([fx, fy, cx, cy, *camera.distortion])
        made = distort_points_kannala_brandt(points, values.expand(len(points), 8))
    else:
        matrix, plain = points.new_tensor(camera.matrix), points.new_tensor(np.eye(3))
        made = distort_points(points, matrix, points.new_tensor(camera.distortion), plain)
    return made.reshape(plane.shape)


def _straightened(px: np.ndarray, plane: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """The places on the plane z = 1 that the lens takes to px, from those without a lens."""
    radii, made = radial_table(camera)
    seen = np.linalg.norm(plane, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        place = np.where(seen > 0, plane * (np.interp(seen, made, radii) / seen), 0.0)
    right, lower, step = np.array([1e-7, 0]), np.array([0, 1e-7]), 1e-7
    for _ in range(STEPS):
        here = _distorted(place, camera)
        miss = px - here
        if not np.nanmax(np.abs(miss), initial=0) > 1e-3 * NEAR_PX:
            break
        with np.errstate(all="ignore"):  # (a quotient of polynomials may be infinite in a place)
            across = (_distorted(place + right, camera) - here) / step
            down = (_distorted(place + lower, camera) - here) / step
            area = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
            way = np.stack(
                [
                    (miss[..., 0] * down[..., 1] - miss[..., 1] * down[..., 0]) / area,
                    (miss[..., 1] * across[..., 0] - miss[..., 0] * across[..., 1]) / area,
                ],
                axis=-1,
            )
            place = np.clip(place + np.nan_to_num(way), -radii[-1], radii[-1])
    met = (np.abs(px - _distorted(place, camera)).max(-1) <= NEAR_PX) & (np.linalg.norm(place, axis=-1) <= radii[-1])
    place[~met] = np.nan
    return place
