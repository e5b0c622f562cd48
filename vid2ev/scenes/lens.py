"""Rays of a camera's pixels, and pixels of points, through its lens.

    (u, v) = K distortion(x / z, y / z)          the models of `rig.intrinsics`, computed by OpenCV

A ray is (x, y, 1); where the lens bends light back (no ray leads to the pixel), or a ray would not look forwards, it is
NaN, and nothing is seen there.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vid2ev.rig.intrinsics import Intrinsics

CLOSE_PX = 0.02  # a ray is one if it leads back to its pixel


@lru_cache(maxsize=16)
def rays_of_pixels(intrinsics: Intrinsics) -> np.ndarray:
    """x, y [H + 2, W + 2, 2] of the rays through pixel centres, with a margin of 1 px; not to be written to."""
    width, height = intrinsics.size
    x, y = np.meshgrid(np.arange(-1.0, width + 1), np.arange(-1.0, height + 1))
    rays = rays_of(np.stack([x, y], axis=-1).reshape(-1, 2), intrinsics).reshape(height + 2, width + 2, 2)
    rays.flags.writeable = False
    return rays


def rays_of(pixels: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """x, y [n, 2] of the rays (x, y, 1) through places [n, 2, px] of the picture."""
    pixels = np.asarray(pixels, np.float64)
    if intrinsics.model == "none" or not len(pixels):
        return (pixels - intrinsics.centre_px) / intrinsics.focal_px
    import cv2

    matrix, distortion = intrinsics.matrix, np.array(intrinsics.distortion)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    undistort = cv2.fisheye.undistortPoints if intrinsics.model == "equidistant" else cv2.undistortPoints
    rays = undistort(pixels[:, None], matrix, distortion, criteria=criteria).reshape(-1, 2)
    back = pixels_of(np.concatenate([rays, np.ones((len(rays), 1))], axis=1), intrinsics)
    rays[~(np.linalg.norm(back - pixels, axis=1) < CLOSE_PX)] = np.nan
    return rays


def pixels_of(points_m: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """Places [n, 2, px] at which points [n, 3] in the camera's coordinates are seen; NaN for those behind it."""
    points_m = np.asarray(points_m, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = points_m[:, :2] / points_m[:, 2:]
    plane[~(points_m[:, 2] > 0) | ~np.isfinite(plane).all(axis=1)] = np.nan
    if intrinsics.model == "none" or not len(plane):
        return plane * intrinsics.focal_px + intrinsics.centre_px
    import cv2

    matrix, distortion = intrinsics.matrix, np.array(intrinsics.distortion)
    if intrinsics.model == "equidistant":
        return cv2.fisheye.distortPoints(plane[:, None], matrix, distortion).reshape(-1, 2)
    there = np.concatenate([plane, np.ones((len(plane), 1))], axis=1)
    return cv2.projectPoints(there, np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)
