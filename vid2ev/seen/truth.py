"""What is known for certain of what the cameras see, at some instants of a recording.

    depth    how far what a pixel sees is, along the camera's axis [m]
    flow     where that is at the next such instant, less where it is now [px]; of scenes only
    mask     what the source sees as well; elsewhere a view is made up; of scenes, what the lens sees
    map      where each pixel is in each of the other cameras [px]
    poses    where the camera is: in the world of a scene, otherwise in the rig

The instants are the first frames of the source in each period of 1 / rate, which begins a little early, so that times
that are rounded count where they belong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.truth import depth_of_plane, depth_seen, pixel_map
from vid2ev.rig.views import is_same
from vid2ev.scenes.render import Picture
from vid2ev.scenes.world import World
from vid2ev.seen.mounts import Mount
from vid2ev.stream.frames import Frame

EARLY = 0.05  # of a period
NOTHING = np.zeros((0, 0), np.float32)
KINDS = ("depth", "flow", "mask", "map", "poses")
USUAL_HZ = 30.0


class Truth(NamedTuple):
    """What is known of what a camera sees; what was not asked for is None."""

    t_ns: int  # on the camera's own clock
    pose: Pose
    depth: np.ndarray | None = None
    flow: np.ndarray | None = None
    mask: np.ndarray | None = None
    maps: dict[str, np.ndarray] | None = None


@dataclass(frozen=True)
class Wanted:
    """What is asked for: some of `KINDS`, so many times a second.  Raises UsageError for what cannot be meant."""

    kinds: tuple[str, ...]
    rate_hz: float = USUAL_HZ

    def __post_init__(self) -> None:
        unknown = [kind for kind in self.kinds if kind not in KINDS]
        if unknown:
            raise UsageError(f"truth '{unknown[0]}': expected some of {', '.join(KINDS)}")
        if not 0 < self.rate_hz <= 1e6:
            raise UsageError(f"truth at {self.rate_hz:g} Hz: expected a rate above 0, at most 1e6")

    def due(self, before_ns: int | None, t_ns: int) -> bool:
        """Whether the frame at t_ns, after the one at before_ns, is one of the instants."""
        return before_ns is None or self._period(t_ns) > self._period(before_ns)

    def of_views(
        self,
        frame: Frame,
        source: Intrinsics,
        plane_m: float | None,
        mounts: Sequence[Mount],
        masks: Sequence[np.ndarray],
    ) -> tuple[Truth, ...]:
        """What is known of the views of a frame; `masks` [h, w] are those of the views."""
        needed = {"depth", "map"} & {*self.kinds}
        depths = [_depth_of_view(frame, source, plane_m, mount) if needed else NOTHING for mount in mounts]
        return tuple(
            self._truth(mounts, k, frame.t_ns, [mount.pose for mount in mounts], depths, mask=masks[k])
            for k, mount in enumerate(mounts)
        )

    def of_pictures(
        self, world: World, t_ns: int, next_ns: int | None, pictures: Sequence[Picture], mounts: Sequence[Mount]
    ) -> tuple[Truth, ...]:
        """What is known of the pictures of a world at an instant; the flow is that to the next one."""
        poses = [world.camera_pose(t_ns) @ mount.pose for mount in mounts]
        depths = [picture.depth for picture in pictures]
        flows = [
            world.flow(t_ns, next_ns, picture, mount.intrinsics, mount.pose).shift
            if next_ns is not None and "flow" in self.kinds
            else None
            for picture, mount in zip(pictures, mounts, strict=True)
        ]
        masks = [~np.isnan(depth) for depth in depths]
        return tuple(
            self._truth(mounts, k, t_ns, poses, depths, flow=flows[k], mask=masks[k]) for k in range(len(mounts))
        )

    def _truth(
        self, mounts: Sequence[Mount], k: int, t_ns: int, poses: list[Pose], depths: list[np.ndarray], **rest: Any
    ) -> Truth:
        mount = mounts[k]
        maps = {
            other.name: pixel_map(mount.intrinsics, poses[k], depths[k], other.intrinsics, poses[other.number])
            for other in mounts
            if "map" in self.kinds and other is not mount
        }
        asked = {name: value for name, value in rest.items() if name in self.kinds}
        depth = depths[k] if "depth" in self.kinds else None
        return Truth(t_ns + 1000 * mount.clock_offset_us, poses[k], depth, maps=maps or None, **asked)

    def _period(self, t_ns: int) -> int:
        return math.floor(t_ns * self.rate_hz / 1e9 + EARLY)


def _depth_of_view(frame: Frame, source: Intrinsics, plane_m: float | None, mount: Mount) -> np.ndarray:
    if plane_m is not None:
        return depth_of_plane(mount.intrinsics, mount.pose, plane_m)
    if frame.depth is None:
        return np.full(mount.size[::-1], np.nan, np.float32)
    if is_same(source, mount.intrinsics, mount.pose):
        return frame.depth
    return depth_seen(source, frame.depth, mount.intrinsics, mount.pose)


def with_next(instants_ns: Sequence[int], wanted: Wanted) -> dict[int, int | None]:
    """Of the instants of a scene [ns] those at which truth is due, each with the one that follows it."""
    before = [None, *instants_ns[:-1]]
    due = [t_ns for before_ns, t_ns in zip(before, instants_ns, strict=True) if wanted.due(before_ns, t_ns)]
    return dict(zip(due, [*due[1:], None], strict=True))
