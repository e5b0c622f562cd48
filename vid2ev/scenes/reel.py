"""A camera's pictures of a world, one after the other: what cannot have changed since the last one is kept.

A picture is the same, to the bit, as if it were rendered by itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.details import details_of
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.moves import balls_between
from vid2ev.scenes.rays.layout import World as Numbers
from vid2ev.scenes.rays.tiles import TILE
from vid2ev.scenes.rays.touch import touch
from vid2ev.scenes.render import Canvas, Picture, canvas_of, paint, tiles_of
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world import World
from vid2ev.scenes.world_numbers import numbers_of
from vid2ev.stream.still import BRIGHTEST, STRIP, strip_count


class Seen(NamedTuple):
    """What a picture was made of, and is."""

    numbers: Numbers
    details: np.ndarray
    canvas: Canvas


class Reel:
    """The pictures that a camera of a world takes; `pose_in_rig` leads from its coordinates to the reference camera's.

    A world's own renderer renders all of each picture.
    """

    def __init__(self, world: World, intrinsics: Intrinsics | None = None, pose_in_rig: Pose = IDENTITY):
        self.world, self.intrinsics, self.pose_in_rig = world, intrinsics or world.intrinsics, pose_in_rig
        self._last: Seen | None = None

    def picture(self, t_ns: int) -> tuple[Picture, np.ndarray | None]:
        """The picture at t_ns, and which of its strips are those of the last one, as of `stream.still`; None where that
        is not known."""
        if self.world.renderer or self.world.afresh:
            return self.world.render(t_ns, self.intrinsics, self.pose_in_rig), None
        return self.render(self.world.snapshot(t_ns), self.world.camera_pose(t_ns) @ self.pose_in_rig)

    def render(self, snapshot: Snapshot, pose: Pose) -> tuple[Picture, np.ndarray | None]:
        """The same of any snapshot, and for any pose of the camera (camera to world)."""
        numbers, last = numbers_of(snapshot, pose), self._last
        details = details_of(snapshot, numbers, self.intrinsics, pose)
        wanted = self._wanted(numbers, details)
        canvas = canvas_of(self.intrinsics.size) if last is None or wanted.all() else after(last.canvas, wanted)
        paint(canvas, numbers, details, self.intrinsics, wanted, self.world.scene.scene.samples, self.world.threads)
        self._last = Seen(numbers, details, canvas)
        return canvas.picture(), None if last is None else still_of(canvas.light, wanted)

    def _wanted(self, numbers: Numbers, details: np.ndarray) -> np.ndarray:
        """The tiles of which the picture may be another than the last."""
        tiles, last = tiles_of(self.intrinsics.size), self._last
        balls = None if last is None else balls_between(last.numbers, numbers)
        if last is None or balls is None:
            return np.ones(tiles, np.uint8)
        wanted = np.zeros(tiles, np.uint8)
        touch(rays_of_pixels(self.intrinsics), balls, wanted)
        if (other := details != last.details).any():
            lines, columns = np.nonzero(other)
            wanted[lines // TILE, columns // TILE] = 1
        return wanted


def after(last: Canvas, wanted: np.ndarray) -> Canvas:
    """A canvas with the last picture on it, which may be painted on: what pictures share with it is copied."""
    return last._replace(light=last.light.copy(), thing=last.thing.copy()) if wanted.any() else last


def still_of(light: np.ndarray, painted: np.ndarray) -> np.ndarray:
    """The strips of a picture in which no pixel is of a tile that was painted, and all are fit for a sensor."""
    height, width = light.shape[:2]
    pixels = np.repeat(np.repeat(painted, TILE, axis=0), TILE, axis=1)[1 : height + 1, 1 : width + 1]
    changed = np.zeros(strip_count(width, height) * STRIP, np.uint8)
    changed[: height * width] = pixels.reshape(-1)
    return (changed.reshape(-1, STRIP).max(axis=1) == 0) & fit(light)


def fit(light: np.ndarray) -> bool:
    """Whether all light is between 0 and what sensors take."""
    return bool(light.min() >= 0 and light.max() <= BRIGHTEST)
