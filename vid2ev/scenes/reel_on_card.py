"""A camera's pictures of a world, painted on a GPU, several at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.details import places_of_details
from vid2ev.scenes.flow import Flow, motions_between
from vid2ev.scenes.on_card import PainterOnCard
from vid2ev.scenes.rays.cuda.easel import STILL
from vid2ev.scenes.rays.layout import World as Numbers
from vid2ev.scenes.render import Picture
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world import World
from vid2ev.scenes.world_numbers import numbers_of


class Sitting(NamedTuple):
    """What a picture is painted after."""

    numbers: Numbers
    details: np.ndarray


class ReelOnCard:
    """`Reel` on a device (`vid2ev.kernels.cuda.memory`): all of each picture is painted, and stays there.

    A world's own renderer is not asked.
    """

    def __init__(self, world: World, memory: Any, intrinsics: Intrinsics | None = None, pose_in_rig: Pose = IDENTITY):
        self.world, self.intrinsics, self.pose_in_rig = world, intrinsics or world.intrinsics, pose_in_rig
        self._painter = PainterOnCard(memory, self.intrinsics, world.scene.scene.samples)

    def pictures(self, instants_ns: Sequence[int]) -> Iterator[Picture]:
        """The pictures at these instants [ns], as arrays of the device."""
        yield from self.render(self._seen(t_ns) for t_ns in instants_ns)

    def render(self, seen: Iterator[tuple[Snapshot, Pose]]) -> Iterator[Picture]:
        """The pictures of any snapshots, and for any poses of the camera (camera to world)."""
        waiting: list[Sitting] = []
        for snapshot, pose in seen:
            numbers = numbers_of(snapshot, pose)
            sitting = Sitting(numbers, places_of_details(snapshot, numbers, self.intrinsics, pose))
            if waiting and not (
                len(waiting) < self._painter.at_a_time(len(numbers.kind)) and go_together(waiting[0].numbers, numbers)
            ):
                yield from self._painted(waiting)
                waiting = []
            waiting.append(sitting)
        if waiting:
            yield from self._painted(waiting)

    def flow(self, t0_ns: int, t1_ns: int, picture: Picture) -> Flow:
        """Where the pixels of the picture at t0 are at t1, as `World.flow` has it; tensors of torch, on the device."""
        return self.flow_between(self._seen(t0_ns), self._seen(t1_ns), picture)

    def flow_between(self, before: tuple[Snapshot, Pose], after: tuple[Snapshot, Pose], picture: Picture) -> Flow:
        """The same between any snapshots and poses of the camera (camera to world)."""
        return self._painter.flow(picture, numbers_of(*after), motions_between(*before, *after))

    def _seen(self, t_ns: int) -> tuple[Snapshot, Pose]:
        return self.world.snapshot(t_ns), self.world.camera_pose(t_ns) @ self.pose_in_rig

    def _painted(self, sittings: list[Sitting]) -> list[Picture]:
        return self._painter.paint([one.numbers for one in sittings], [one.details for one in sittings])


def go_together(one: Numbers, other: Numbers) -> bool:
    """Whether pictures of two worlds can be painted together."""
    return all(
        a is b if name in STILL else np.asarray(a).shape == np.asarray(b).shape
        for name, a, b in zip(Numbers._fields, one, other, strict=True)
    )
