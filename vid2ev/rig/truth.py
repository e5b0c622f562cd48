"""What is known of a scene for certain, once its depth is: where things are seen, and how they move.

    pixel map        px_b = K_b distortion_b(R (Z r) + t)        R, t: from a to b
    optical flow     pixel map from a camera to itself at another instant, less the pixel

Poses are those of the cameras in one and the same frame, such as the rig's (X_frame = R X_camera + t); everything but
the cameras stands still.  Infinite depth turns and does not shift.  Maps are float32 [H, W, 2] (x, y) px, at the pixels
of the first camera; NaN where depth is not known, or the place is not in front of the second.
"""

from __future__ import annotations

import numpy as np

from vid2ev.rig.bands import Bands
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid, pixels_of, rays_of
from vid2ev.rig.pose import Pose
from vid2ev.rig.surface import corners_of, seen_of, surface_of
from vid2ev.rig.views import filled_inverse


def pixel_map(
    camera_a: Intrinsics, pose_a: Pose, depth_a_m: np.ndarray, camera_b: Intrinsics, pose_b: Pose
) -> np.ndarray:
    """Where in camera b the pixels of camera a are: [H, W, 2] px, inside its picture or not; depth [H, W] m."""
    way = pose_b.inverse() @ pose_a
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(depth_a_m > 0, 1 / np.asarray(depth_a_m, np.float64), np.nan)
    # over Z, so that the infinitely far is a direction
    places = rays_of(pixel_grid(camera_a.size), camera_a) @ way.rotation.T + inverse[..., None] * way.translation_m
    return pixels_of(places, camera_b).astype(np.float32)


def depth_of_plane(camera: Intrinsics, pose: Pose, plane_m: float) -> np.ndarray:
    """Depth [H, W] float32 m that a camera has of a plane at z = plane_m of the frame its pose is in; NaN without."""
    rays = rays_of(pixel_grid(camera.size), camera) @ pose.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth_m = (plane_m - pose.translation_m[2]) / rays[..., 2]
    return np.where(depth_m > 0, depth_m, np.nan).astype(np.float32)


def depth_seen(source: Intrinsics, depth_m: np.ndarray, camera: Intrinsics, pose: Pose) -> np.ndarray:
    """Depth [h, w] float32 m that a camera has of what a source with a depth map [H, W] sees.

    pose   from the camera's coordinates to those of the source; NaN in holes, and where depth is not known
    """
    inverse, known = filled_inverse(np.asarray(depth_m, np.float32))
    surface = surface_of(inverse, corners_of(source), source)
    x, y, there = seen_of(surface, camera, pose, Bands())
    width, height = source.size
    rows, columns = (np.clip(np.rint(place), 0, last - 1).astype(np.intp) for place, last in ((y, height), (x, width)))
    with np.errstate(divide="ignore"):
        return np.where((there >= 0) & known[rows, columns], 1 / there, np.float32(np.nan))
