"""True optical flow between two instants, from depth and poses.

    X(t0) = depth (ray of the pixel)                         in camera 0
    X(t1) = camera1^-1  object1  object0^-1  camera0  X(t0)    in camera 1
    flow  = pixel of X(t1) - pixel

What is nothing but background is infinitely far away: only the turn of the camera moves it (and that of the
environment).  A pixel is co-visible if its point is within the other picture and nothing stands before it there, which
is asked with a ray through the very place.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import bent, pixel_grid
from vid2ev.rig.pose import Pose
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.rays.layout import STACK
from vid2ev.scenes.rays.walk import carry_all
from vid2ev.scenes.render import Picture
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world_numbers import numbers_of


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
    motions, (width, height) = motions_between(snapshot0, pose0, snapshot1, pose1), intrinsics.size
    plane, seen = np.empty((height, width, 2)), np.empty((height, width), np.uint8)
    carry_all(
        numbers_of(snapshot1, pose1), rays_of_pixels(intrinsics), picture0.depth, picture0.thing, motions, plane, seen,
        np.empty(STACK, np.int64),
    )  # fmt: skip
    return flow_to(bent(plane, intrinsics), seen, pixel_grid(intrinsics.size))


def motions_between(snapshot0: Snapshot, pose0: Pose, snapshot1: Snapshot, pose1: Pose) -> np.ndarray:
    """How the points of each thing, and last directions of the background, go from one camera's coordinates at its
    instant to the other's: float64 [n + 1, 3, 4].  Raises UsageError for different things."""
    names0, names1 = ([thing.name for thing in snapshot.things] for snapshot in (snapshot0, snapshot1))
    if names0 != names1:
        raise UsageError(f"flow needs the same things at both instants, not {len(names0)} and {len(names1)} others")
    back = pose1.inverse()
    sky = snapshot1.environment_pose.rotation @ snapshot0.environment_pose.rotation.T
    both = zip(snapshot0.things, snapshot1.things, strict=True)
    motions = [back @ thing1.pose @ thing0.pose.inverse() @ pose0 for thing0, thing1 in both]
    motions.append(Pose(back.rotation @ sky @ pose0.rotation, np.zeros(3)))
    return np.array([np.column_stack([motion.rotation, motion.translation_m]) for motion in motions])


def flow_to(there: Any, seen: Any, grid: Any) -> Flow:
    """The flow to places [H, W, 2 px] of which some are `seen`, from all pixels: arrays of numpy, or tensors."""
    height, width = seen.shape
    inside = abs(there[..., 0] - (width - 1) / 2) <= width / 2
    inside = inside & (abs(there[..., 1] - (height - 1) / 2) <= height / 2)
    shift = there - grid
    single = shift.astype(np.float32) if isinstance(shift, np.ndarray) else shift.float()
    return Flow(single, inside & (seen != 0))
