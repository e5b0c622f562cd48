"""What the manifest of a recording says of where its cameras stand and what they see through."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from interp.representation.carried import Look, places_of
from vid2ev.recording.manifest import as_stated, read_manifest
from vid2ev.rig.depth import plane_of
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.truth import depth_of_plane


class Calibration:
    """Of the cameras of a rig, by their names; of a recording without a rig all are in one place.

    Its methods raise DataError for a manifest that does not say what it should.
    """

    def __init__(self, manifest: Path):
        self._manifest, said = manifest, read_manifest(manifest)
        with as_stated(manifest):
            self._cameras = {each["name"]: each for each in said.get("rig", {}).get("cameras", [])}
            self._plane_m = plane_of(said.get("depth"))

    def apart(self, one: str, other: str) -> bool:
        """Whether two cameras look from different places, or through different lenses."""
        with as_stated(self._manifest):
            placed = [_sight(self._cameras[name]) for name in (one, other) if name in self._cameras]
            return len(placed) == 2 and not np.allclose(placed[0], placed[1], atol=1e-6)

    def late_us(self, one: str, other: str) -> int:
        """By how much the clock of the second of two cameras is ahead of that of the first [us]."""
        with as_stated(self._manifest):
            first, second = (int(self._cameras.get(name, {}).get("clock_offset_us", 0)) for name in (one, other))
            return second - first

    def look(self, one: str, size: tuple[int, int], other: str) -> Look | None:
        """Where pixels of a camera with pictures of a size (width, height) look in another; None of cameras that are
        not those of a rig.

        By the plane that the recording was made with, or of what is far away, which is rectification: of cameras in one
        place, it says all.
        """
        with as_stated(self._manifest):
            if one not in self._cameras or other not in self._cameras:
                return None
            (lens, pose), (other_lens, other_pose) = (_placed(self._cameras[name]) for name in (one, other))
            if lens.size != size:
                raise ValueError(f"a lens for {lens.size} pixels, and pictures of {size}")
        depth_m = np.inf if self._plane_m is None else depth_of_plane(lens, pose, self._plane_m)
        known = self._plane_m is not None or np.allclose(pose.translation_m, other_pose.translation_m, atol=1e-9)
        return Look(places_of(lens, pose, other_lens, other_pose, depth_m), known)


def _placed(camera: dict[str, Any]) -> tuple[Intrinsics, Pose]:
    place = np.array(camera["rotation"], np.float64), np.array(camera["translation_m"], np.float64)
    return Intrinsics(**camera["intrinsics"]), Pose(*place)


def _sight(camera: dict[str, Any]) -> np.ndarray:
    """Place, direction and lens as numbers: those of the lens in widths of the picture."""
    lens, pose = _placed(camera)
    edge = [*(np.array(lens.centre_px) + 0.5), *lens.focal_px]
    bent = np.zeros(9)  # (of equidistant lenses 0, 0, 0, 0 is a distortion, too)
    bent[: len(lens.distortion)], bent[-1] = lens.distortion, lens.model == "equidistant"
    return np.concatenate([pose.translation_m, *pose.rotation, np.array(edge) / lens.size[0], bent])
