"""Calibration files of the field, read and written: one module each.

    read_calibration("camchain.yaml").rig            a rig with the first camera at its origin
    write_calibration("calib.json", rig, "dv")

The content says which format a file is, never the name; rig files are read as well.  A new format is a module with a
`FORMAT` and a line in `FORMATS`.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.rig.calibration.calibrated import UNITS_M, Calibrated, CalibrationFormat, rig_of
from vid2ev.rig.calibration.node import read_tree
from vid2ev.rig.camera import Camera, Rig, Source, Viewpoint
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.rig_file import is_rig_file, read_rig, write_rig, write_text

__all__ = [
    "FORMATS",
    "UNITS_M",
    "Calibration",
    "calibration_format",
    "left_out",
    "read_calibration",
    "write_calibration",
]

# By name, in the order in which content is looked at: what can be mistaken for nothing else comes first.
FORMATS = {
    "dsec": "vid2ev.rig.calibration.dsec",
    "kalibr": "vid2ev.rig.calibration.kalibr",
    "dv": "vid2ev.rig.calibration.dv",
    "opencv": "vid2ev.rig.calibration.opencv",
}


@dataclass(frozen=True)
class Calibration:
    """What a calibration file holds, and what a person should know of how it was read."""

    format: str
    rig: Rig
    notes: tuple[str, ...] = ()


def calibration_format(name: str) -> CalibrationFormat:
    """The format of a name.  Raises UsageError."""
    if name not in FORMATS:
        raise UsageError(f"calibration format '{name}': expected rig or one of {', '.join(FORMATS)}")
    return importlib.import_module(FORMATS[name]).FORMAT


def read_calibration(path: str | Path, unit: str | None = None) -> Calibration:
    """The cameras of a calibration file or a rig file.

    unit  of the translations, of `UNITS_M`, in files that do not say it; left out: m
    Raises DataError for what is no such file or lacks a key, UsageError for a file that is not there and a unit that it
    contradicts.
    """
    path = Path(path)
    if is_rig_file(path):
        _check_unit(path, "mm", unit)
        return Calibration("rig", read_rig(path))
    tree = read_tree(path)
    kind = next((kind for kind in map(calibration_format, FORMATS) if kind.recognises(tree)), None)
    if kind is None:
        raise DataError(f"{path} is no calibration file of a known format; expected one of {', '.join(FORMATS)}")
    cameras = kind.read(tree)
    if not cameras:
        raise DataError(f"{path} holds no camera; complete or replace the file")
    said = kind.says_unit(tree)
    _check_unit(path, said, unit)
    first = cameras[0].from_first.inverse()  # (of nothing, where files mean it; a set of dv may begin with another one)
    cameras = [_placed(camera, first, UNITS_M[said or unit or "m"]) for camera in cameras]
    notes = [] if said or unit or len(cameras) == 1 else [_guess(cameras)]
    if any(np.abs(camera.from_first.translation_m).max() > 1e6 for camera in cameras):
        raise DataError(f"{path}: cameras stand more than 1000 km apart; correct the translations")
    if "kinds" not in kind.keeps:
        notes.append("the file does not say which cameras give events and which frames: all are dvs")
    return Calibration(kind.name, rig_of(cameras), tuple(notes))


def write_calibration(path: str | Path, rig: Rig, name: str, overwrite: bool = False) -> None:
    """Write the cameras of a rig in a format, or as a rig file (`rig`).

    Raises UsageError for cameras without a size and a focal length, or that the format cannot hold, and where a file is
    in the way; DataError where the disk cannot take it.
    """
    if name == "rig":
        write_rig(path, rig, overwrite)
    else:
        views = [Viewpoint(camera, _lens(rig, camera), camera.pose) for camera in rig.cameras]
        write_text(Path(path), calibration_format(name).write(views), overwrite)


def left_out(rig: Rig, name: str) -> list[str]:
    """What a rig states that a format does not hold, one clause each."""
    if name == "rig":
        return []
    keeps, cameras = calibration_format(name).keeps, rig.cameras
    lost = [
        ("sensor, set and seed", any(camera.sensor or camera.set or camera.seed is not None for camera in cameras)),
        ("clock_offset_us", "clocks" not in keeps and any(camera.clock_offset_us for camera in cameras)),
        ("kind", "kinds" not in keeps and any(camera.kind != "dvs" for camera in cameras)),
        ("[source], the lens of the video", rig.source != Source()),
        ("the camera of the video, from which poses counted", _moves(rig)),
    ]
    return [what for what, so in lost if so]


def _moves(rig: Rig) -> bool:
    pose = rig.cameras[0].pose
    return bool(np.abs(pose.translation_m).max() > 0 or np.abs(pose.rotation - np.eye(3)).max() > 0)


def _lens(rig: Rig, camera: Camera) -> Intrinsics:
    """The intrinsics of a camera, which a calibration file cannot leave to the video.  Raises UsageError."""
    source, size = rig.source, camera.size or rig.source.size
    stated = source.fov_deg or (source.focal_px and source.size)
    if size is None or not (camera.lens(size) or stated):
        raise UsageError(
            f"camera {camera.name} has no size with fov_deg or focal_px, which a calibration file needs; complete"
            " the rig, or state the size and fov_deg of the video in [source]"
        )
    return camera.intrinsics(source.intrinsics(source.size or size))  # (a field in degrees is that of any size)


def _check_unit(path: Path, said: str | None, unit: str | None) -> None:
    """Raise UsageError where a file says another unit than is asked for."""
    if said and unit not in (None, said):
        raise UsageError(f"{path} counts in {said}; leave --unit {unit} out")


def _placed(camera: Calibrated, first: Pose, unit_m: float) -> Calibrated:
    pose = camera.from_first @ first
    return replace(camera, from_first=Pose(pose.rotation, pose.translation_m * unit_m))


def _guess(cameras: list[Calibrated]) -> str:
    apart_m = max(float(np.linalg.norm(camera.from_first.translation_m)) for camera in cameras)
    return f"the file does not say its unit: taken as m, cameras are {apart_m:.6g} m apart; --unit mm if it is mm"
