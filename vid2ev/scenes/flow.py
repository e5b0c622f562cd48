"""True optical flow between two instants, from depth and poses.

    X(t0) = depth (ray of the pixel)                         in camera 0
    X(t1) = camera1^-1  object1  object0^-1  camera0  X(t0)    in camera 1
    flow  = pixel of X(t1) - pixel

What is nothing but background is infinitely far away: only the turn of the camera moves it (and that of the
environment).  A pixel is co-visible if its point is within the other picture and nothing stands before it there, which
is asked with a ray through the very place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixels_of
from vid2ev.rig.pose import Pose
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.rays.scratch import scratch_for
from vid2ev.scenes.rays.walk import cast
from vid2ev.scenes.render import Picture
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world_numbers import numbers_of

SAME_DEPTH = 1e-4  # of the depth
BACKGROUND = -1


class Flow(NamedTuple):
    """Where the points of the first picture's pixels are in the second.

    shift      float32 [H, W, 2], x and y [px]; NaN where a point is not in front of the second camera
    covisible  bool [H, W], whether both cameras see the point
    """

    shift: np.ndarray
    covisible: np.ndarray


def flow(
    snapshot0: Snapshot, pose0: Pose, snapshot1: Snapshot, pose1: Pose, intrinsics: Intrinsics, picture0: Picture
) -> Flow:
    """The flow from the picture of snapshot0 with camera pose0 to snapshot1 with pose1 (camera to world).

    Things are matched by their place in the snapshots.  Raises UsageError if those hold different things.
    """
    names0, names1 = ([thing.name for thing in snapshot.things] for snapshot in (snapshot0, snapshot1))
    if names0 != names1:
        raise UsageError(f"flow needs the same things at both instants, not {len(names0)} and {len(names1)} others")
    width, height = intrinsics.size
    points, far = _points_then(snapshot0, pose0, snapshot1, pose1, intrinsics, picture0)
    with np.errstate(invalid="ignore"):
        there = pixels_of(points.reshape(-1, 3), intrinsics).reshape(height, width, 2)
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    within = (np.abs(there[..., 0] - (width - 1) / 2) <= width / 2) & (
        np.abs(there[..., 1] - (height - 1) / 2) <= height / 2
    )
    covisible = within & _in_sight(snapshot1, pose1, points, np.where(far, BACKGROUND, picture0.thing))
    return Flow((there - np.stack([x, y], axis=-1)).astype(np.float32), covisible)


def _points_then(
    snapshot0: Snapshot, pose0: Pose, snapshot1: Snapshot, pose1: Pose, intrinsics: Intrinsics, picture: Picture
) -> tuple[np.ndarray, np.ndarray]:
    """The pixels' points [H, W, 3] in coordinates of the second camera, and which are infinitely far (directions)."""
    rays = rays_of_pixels(intrinsics)[1:-1, 1:-1]
    rays = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)
    back, far = pose1.inverse(), ~np.isfinite(picture.depth)
    sky = snapshot1.environment_pose.rotation @ snapshot0.environment_pose.rotation.T
    points = rays @ (back.rotation @ sky @ pose0.rotation).T
    for number, (thing0, thing1) in enumerate(zip(snapshot0.things, snapshot1.things, strict=True)):
        here = (picture.thing == number) & ~far
        if here.any():
            motion = back @ thing1.pose @ thing0.pose.inverse() @ pose0
            points[here] = motion.apply(picture.depth[here][:, None] * rays[here])
    return points, far


def _in_sight(snapshot: Snapshot, pose: Pose, points: np.ndarray, things: np.ndarray) -> np.ndarray:
    """Whether rays to points meet the thing at this depth; those to the background (-1), nothing."""
    world, flat = numbers_of(snapshot, pose), points.reshape(-1, 3)
    depth, thing = np.empty(len(flat), np.float32), np.empty(len(flat), np.int32)
    with np.errstate(divide="ignore", invalid="ignore"):
        rays = flat[:, :2] / flat[:, 2:]
        cast(world, np.ascontiguousarray(rays), depth, thing, scratch_for(len(world.kind), 1))
        same = np.abs(depth - flat[:, 2]) <= SAME_DEPTH * flat[:, 2]
    seen = (thing == things.reshape(-1)) & (same | (thing == BACKGROUND)) & (flat[:, 2] > 0)
    return seen.reshape(things.shape)
