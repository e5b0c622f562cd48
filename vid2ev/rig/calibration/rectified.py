"""Rectified cameras: turned, without distortion, so that rows of a pair show the same.

    x_rectified = R x_camera,   [X, Y, Z, W] = Q [u, v, disparity, 1]

Where a rig has exactly two cameras of a kind, of one size and beside each other, they are rectified together, and
turned as little as can be; the others keep their direction, and lose their distortion.

Source: OpenCV 4.x, `stereoRectify` and `fisheye::stereoRectify`, after J.-Y. Bouguet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vid2ev.rig.camera import Viewpoint
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose

APART_M = 1e-9  # cameras at one place have no rows in common


@dataclass(frozen=True)
class Rectified:
    """A rectified camera: its rotation [3, 3] from the camera as it is, and fx, fy, cx, cy [px]."""

    rotation: np.ndarray
    four: list[float]


def rectify(
    views: Sequence[Viewpoint], from_first: Sequence[Pose]
) -> tuple[list[Rectified], dict[tuple[int, int], np.ndarray]]:
    """All cameras rectified, and Q [4, 4] of each pair, by the numbers of its cameras; disparities are in pixels."""
    made = [Rectified(np.eye(3), [*view.intrinsics.focal_px, *view.intrinsics.centre_px]) for view in views]
    depths: dict[tuple[int, int], np.ndarray] = {}
    for left, right in _pairs(views):
        between = from_first[right] @ from_first[left].inverse()
        one, other = views[left].intrinsics, views[right].intrinsics
        found = _together(one, other, between) if np.linalg.norm(between.translation_m) > APART_M else None
        if found is None:
            continue
        for index, turn, projection in ((left, found[0], found[2]), (right, found[1], found[3])):
            made[index] = Rectified(turn, projection[[0, 1, 0, 1], [0, 1, 2, 2]].tolist())
        depths[left, right] = found[4]
    return made, depths


def _pairs(views: Sequence[Viewpoint]) -> list[tuple[int, int]]:
    """The two cameras of a kind, where there are two and they are of one size."""
    found = []
    for kind in ("dvs", "cis"):
        same = [index for index, view in enumerate(views) if view.camera.kind == kind]
        if len(same) == 2 and views[same[0]].intrinsics.size == views[same[1]].intrinsics.size:
            found.append((same[0], same[1]))
    return found


def _together(one: Intrinsics, other: Intrinsics, between: Pose) -> tuple[Any, ...] | None:
    """What OpenCV says of a pair: two rotations, two projections, Q; None if it cannot rectify the two."""
    import cv2

    fisheye = [lens.model == "equidistant" for lens in (one, other)]
    if any(fisheye) and not all(fisheye):
        return None
    d1, d2 = (np.array(lens.distortion or (0.0,) * 4) for lens in (one, other))
    stated = (one.matrix, d1, other.matrix, d2, one.size, between.rotation, between.translation_m[:, None])
    function: Any = cv2.fisheye.stereoRectify if all(fisheye) else cv2.stereoRectify
    border = {} if all(fisheye) else {"alpha": 0}  # (no pixels without light)
    try:
        found = function(*stated, flags=cv2.CALIB_ZERO_DISPARITY, **border)
    except cv2.error:
        return None
    # (turned so far that both see backwards, as where one stands before the other)
    return found if all(projection[0, 0] > 0 for projection in found[2:4]) else None
