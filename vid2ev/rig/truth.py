"""What is known of a scene for certain, once its depth is: where things are seen, how they move, what hides what.

    pixel map        px_b = K_b distortion_b(R (Z r) + t)        R, t: from a to b
    optical flow     pixel map from a camera to itself at another instant, less the pixel
    visible          as far away as the depth of the other camera at that place says, not farther

Poses are those of the cameras in one and the same frame, such as the rig's (X_frame = R X_camera + t); everything but
the cameras stands still.  Infinite depth turns and does not shift.  Maps are float32 [H, W, 2] (x, y) px, at the pixels
of the first camera; NaN where depth is not known, or the place is not in front of the second.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.rig.bands import Bands
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid, pixels_of, rays_of
from vid2ev.rig.pose import Pose
from vid2ev.rig.surface import corners_of, seen_of, surface_of
from vid2ev.rig.views import filled_inverse


class Carried(NamedTuple):
    """The places that the pixels of one camera see, as another has them."""

    px: np.ndarray  # [H, W, 2] float32
    depth_m: np.ndarray  # [H, W] float32


def carried(camera_a: Intrinsics, pose_a: Pose, depth_a_m: np.ndarray, camera_b: Intrinsics, pose_b: Pose) -> Carried:
    """Pixels and depths in camera b of what the pixels of camera a see; depth [H, W] m."""
    way = pose_b.inverse() @ pose_a
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(depth_a_m > 0, 1 / np.asarray(depth_a_m, np.float64), np.nan)
        # over Z, so that the infinitely far is a direction
        places = rays_of(pixel_grid(camera_a.size), camera_a) @ way.rotation.T + inverse[..., None] * way.translation_m
        depth_m = np.where(places[..., 2] > 0, places[..., 2] / inverse, np.nan)
    px = pixels_of(places, camera_b)
    return Carried(px.astype(np.float32), np.where(np.isnan(px).any(-1), np.nan, depth_m).astype(np.float32))


def pixel_map(
    camera_a: Intrinsics, pose_a: Pose, depth_a_m: np.ndarray, camera_b: Intrinsics, pose_b: Pose
) -> np.ndarray:
    """Where in camera b the pixels of camera a are: [H, W, 2] px, inside its picture or not."""
    return carried(camera_a, pose_a, depth_a_m, camera_b, pose_b).px


def visible(
    camera_a: Intrinsics,
    pose_a: Pose,
    depth_a_m: np.ndarray,
    camera_b: Intrinsics,
    pose_b: Pose,
    depth_b_m: np.ndarray,
    tolerance: float = 0.01,
) -> np.ndarray:
    """Which pixels of camera a, bool [H, W], see what camera b sees, too: in its picture, and not behind something.

    tolerance   of depth, as a share; the farthest of the four pixels of b around counts
    """
    px, depth_m = carried(camera_a, pose_a, depth_a_m, camera_b, pose_b)
    width, height = camera_b.size
    with np.errstate(invalid="ignore"):
        inside = (px >= -0.5).all(-1) & (px[..., 0] <= width - 0.5) & (px[..., 1] <= height - 0.5)
        left, top = (np.floor(np.where(inside, px[..., axis], 0)).astype(np.intp) for axis in (0, 1))
        farthest = np.full(depth_m.shape, -np.inf)
        for row in (top, top + 1):
            for column in (left, left + 1):
                there = depth_b_m[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
                farthest = np.fmax(farthest, there)
        return np.asarray(inside & (depth_m <= (1 + tolerance) * farthest))


def depth_of_plane(camera: Intrinsics, pose: Pose, plane_m: float) -> np.ndarray:
    """Depth [H, W] float32 m that a camera has of a plane at z = plane_m of the frame its pose is in; NaN without."""
    rays = rays_of(pixel_grid(camera.size), camera) @ pose.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth_m = (plane_m - pose.translation_m[2]) / rays[..., 2]
    return np.where(depth_m > 0, depth_m, np.nan).astype(np.float32)


def depth_seen(source: Intrinsics, depth_m: np.ndarray, camera: Intrinsics, pose: Pose, threads: int = 1) -> np.ndarray:
    """Depth [h, w] float32 m that a camera has of what a source with a depth map [H, W] sees.

    pose   from the camera's coordinates to those of the source; NaN in holes, and where depth is not known
    """
    inverse, known = filled_inverse(np.asarray(depth_m, np.float32))
    surface = surface_of(inverse, corners_of(source), source)
    x, y, there = seen_of(surface, camera, pose, Bands(threads))
    width, height = source.size
    rows, columns = (np.clip(np.rint(place), 0, last - 1).astype(np.intp) for place, last in ((y, height), (x, width)))
    with np.errstate(divide="ignore"):
        return np.where((there >= 0) & known[rows, columns], 1 / there, np.float32(np.nan))
