"""The view of a camera of a rig in a plan: nothing, a homography, or depth, and what less of it would change.

    nothing       the camera's picture is the source's, to the bit
    homography    exact for a turn, for other intrinsics, and for a scene that is a plane
    depth         of a map; a homography of the mean inverse depth instead would be off by up to

                  max |p(Z) - p(Z_0)|,   1/Z_0 = (1/Z_min + 1/Z_max)/2     ~ f |t| (1/Z_min - 1/Z_max)/2  px

p(Z) is where in the source a pixel of the camera looks if the scene is a plane at Z (`rig/homography.py`).  It moves
along a straight line without turning back while 1/Z grows, so its ends have the greatest distances; through a lens that
bends the line that is an estimate.  All pixels are looked at, with the least and the greatest depth of all frames.
Pixels are no light, and what a hole shows is made up: there is no bound on what a recording would change, and depth
stays.  Views that need nothing, or a homography alone, are never given more.
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev.bounds.scene import Kind, Omission
from vid2ev.plan.plan import Row
from vid2ev.rig.homography import places_on_plane
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid
from vid2ev.rig.pose import Pose
from vid2ev.rig.views import NEAREST_M, is_same
from vid2ev.seen.mounts import Mount
from vid2ev.seen.recipe import Recipe

HOMOGRAPHY_NS, DEPTH_NS = 12.0, 60.0  # per pixel of the view, luminance, of one thread; 15 while depth stays


class DepthRange:
    """The least and the greatest inverse depth [1/m] of a clip, where it is known; `see` each frame's map."""

    def __init__(self) -> None:
        self.near, self.far = 0.0, math.inf

    def see(self, depth_m: np.ndarray | None) -> None:
        """The next map [H, W] m, or none."""
        if depth_m is None:
            return
        known = depth_m >= NEAREST_M  # (NaN is not)
        if known.any():
            least, most = float(depth_m[known].min()), float(depth_m[known].max())
            self.near, self.far = max(self.near, 1 / least), min(self.far, 1 / most)


def view_row(mount: Mount, recipe: Recipe, depth: DepthRange) -> Row:
    """The row of the view of one of the recipe's cameras; a scene has pictures rendered in place of views."""
    (camera, pose), source, plane_m = mount.view, recipe.rig.source, recipe.plane_m
    if is_same(source, camera, pose):
        return _row("dropped", Omission(0.0, "exact", "the source's picture", "nothing lies between the two"), 0.0)
    if recipe.source.dense:
        return _row("kept", Omission(None, "no bound yet", "a picture of its own", "scenes are rendered"), 0.0)
    moved = pose.translation_m.any()
    if not moved or plane_m is not None:
        away = _away(_places(source, camera, pose, math.inf if plane_m is None else plane_m), source)
        why = "exact for a scene that is a plane" if moved else "exact for a camera that is turned only"
        return _row("replaced", Omission(0.0, "exact", f"a homography{away}", why), HOMOGRAPHY_NS)
    if depth.far == math.inf:
        return _row("kept", Omission(None, "no bound yet", "of depth maps", "no depth is known"), DEPTH_NS)
    off = homography_error_px(source, camera, pose, depth)
    kind: Kind = "bound" if source.model == "none" else "estimate"
    near_m, far_m = _metres(depth.near), _metres(depth.far)
    figure = f"{off:.2g} px"
    why = f"what one homography would be off; depth {near_m:.3g} to {far_m:.3g} m, holes"
    return _row("kept", Omission(None, kind, figure, why), DEPTH_NS)


def homography_error_px(source: Intrinsics, camera: Intrinsics, pose: Pose, depth: DepthRange) -> float:
    """How far from where it looks at the scene's depth a pixel looks at most by the homography of the mean inverse
    depth [px of the source]; inf if the camera stands beyond the nearest of the scene."""
    if _metres(depth.near) <= pose.translation_m[2]:
        return math.inf
    inverses = (depth.near + depth.far) / 2, depth.near, depth.far
    middle, *ends = (_places(source, camera, pose, _metres(inverse)) for inverse in inverses)
    return float(np.nanmax([np.hypot(*(place - middle)) for place in ends]))


def _metres(inverse: float) -> float:
    """The depth [m] of an inverse depth [1/m], 0 for what is infinitely far."""
    return 1 / inverse if inverse else math.inf


def _places(source: Intrinsics, camera: Intrinsics, pose: Pose, plane_m: float) -> np.ndarray:
    """Where the pixels of a camera look [2, h, w], px of the source."""
    places = places_on_plane(source, camera, pose, plane_m)
    return np.stack([places.x, places.y])


def _away(places: np.ndarray, source: Intrinsics) -> str:
    """How far the view is from the source's picture, where their pixels are as many."""
    width, height = source.size
    if places.shape[1:] != (height, width):
        return ""
    away = np.hypot(*(places - np.moveaxis(pixel_grid(source.size), -1, 0)))
    return f", up to {float(np.nanmax(away)):.2g} px from the source's"


def _row(fate: str, said: Omission, ns: float) -> Row:
    return Row("view", fate, said, ns, 0.0)  # type: ignore[arg-type]
