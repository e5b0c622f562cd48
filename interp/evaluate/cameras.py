"""What a recording of vid2ev says of its cameras: exposure, disparity between frames and events, and their clocks.

    disparity = f B / Z        f focal length of the frame camera [px], B distance of the cameras [m], Z depth [m]

The mean over the picture; the depth is that of the plane that was given, or of the rendered scene, rendered again in
small.  Of a video with maps of depth it stays unknown.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from interp.data.layouts.own import MANIFEST, Own
from interp.evaluate.group import Cameras
from vid2ev import open_source
from vid2ev.errors import Vid2evError
from vid2ev.recording.manifest import as_stated, read_manifest
from vid2ev.rig.depth import plane_of
from vid2ev.scenes.scene_file import scene_names
from vid2ev.scenes.source import SceneSource
from vid2ev.untrusted import beside

ACROSS_PX = 80  # of the small picture


class CamerasOf:
    """The cameras of a recording, at any time of it by the clock of its frames."""

    def __init__(self, recording: Own):
        self._path = recording.folder / MANIFEST
        self._manifest = read_manifest(self._path)
        self._exposure_us = recording.exposure_us
        self._world: Any = None
        self._plane_m: float | None = None
        with as_stated(self._path):
            placed = {each["name"]: each for each in self._manifest.get("rig", {}).get("cameras", [])}
            self._pair = (placed.get(recording.keys_folder.parent.name), placed.get(recording.events_folder.name))
            if self._apart_m > 0:
                self._plane_m = plane_of(self._manifest.get("depth"))
                self._world = _world(self._path, self._manifest["source"]) if self._plane_m is None else None

    def at(self, t_us: int, keys: tuple[int, int]) -> Cameras:
        """What is known at a time, between two key frames.  Raises DataError for a manifest that does not say what it
        should."""
        exposure_us = sum(map(self._exposure_us, keys)) / len(keys)
        with as_stated(self._path):
            return Cameras(exposure_us, self._disparity_px(t_us), self._offset_us)

    @property
    def _apart_m(self) -> float:
        frames, events = self._pair
        if frames is None or events is None:
            return math.nan
        return float(np.linalg.norm(np.subtract(frames["translation_m"], events["translation_m"])))

    @property
    def _offset_us(self) -> float:
        frames, events = self._pair
        if frames is None or events is None:
            return math.nan
        return float(events["clock_offset_us"] - frames["clock_offset_us"])

    def _disparity_px(self, t_us: int) -> float:
        frames, _ = self._pair
        if frames is None or not self._apart_m:
            return self._apart_m
        focal_px = frames["intrinsics"]["focal_px"][0]
        if self._plane_m is not None:
            return focal_px * self._apart_m / self._plane_m
        if self._world is None:
            return math.nan
        width, height = self._world.intrinsics.size
        small = self._world.intrinsics.scaled_to((ACROSS_PX, max(1, round(ACROSS_PX * height / width))))
        seen_us = t_us - frames["clock_offset_us"]  # (scenes go by the clock of the rig)
        depth_m = self._world.render(1000 * seen_us, small).depth
        return focal_px * self._apart_m * float((1 / depth_m).mean())


def _world(manifest: Path, source: dict[str, Any]) -> Any:
    """The world of a scene, as the manifest names it; None of anything else, of one that is not there any more, and of
    one that is neither predefined nor beside the manifest (`vid2ev.untrusted`)."""
    if source.get("kind") != "scene" or "slowdown" in source.get("edits", {}):
        return None
    name = source["path"].removeprefix("scene:").partition(",")[0]
    try:
        if name not in scene_names():
            beside(manifest, os.path.abspath(name))
        opened = open_source(source["path"])
    except Vid2evError:
        return None
    return opened.world if isinstance(opened, SceneSource) else None
