"""Cameras as calibration files have them: lenses, and rigid motions from the first camera to each.

    X_camera = R X_first + t

That is how OpenCV, Kalibr, DSEC and dv-processing all write it, one camera after another or all from the first.  In a
rig the first camera then stands at the origin, and the others where the inverse puts them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import ValidationError

from vid2ev.errors import DataError, UsageError, clause
from vid2ev.rig.calibration.node import Node
from vid2ev.rig.camera import Camera, Rig, Viewpoint
from vid2ev.rig.intrinsics import DistortionModel, Intrinsics
from vid2ev.rig.pose import Pose, rotation_vector_deg

Kind = Literal["dvs", "cis"]
UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True)
class Calibrated:
    """A camera of a calibration file; `from_first` takes points of the first camera to this one's coordinates."""

    name: str
    intrinsics: Intrinsics
    from_first: Pose
    kind: Kind = "dvs"
    clock_offset_us: int = 0


@dataclass(frozen=True)
class CalibrationFormat:
    """A kind of calibration file.

    name        of `--as`
    title       what it is, in a line
    recognises  whether a file is of this kind
    read        its cameras, the first one first, placed against any of them; raises DataError
    write       the text of a file with these cameras; raises UsageError for a lens that it cannot hold
    keeps       what it holds beside lenses, poses and names: of "kinds", "clocks"
    says_unit   in which unit, of `UNITS_M`, a file says that its translations are; None where it says nothing
    """

    name: str
    title: str
    recognises: Callable[[Node], bool]
    read: Callable[[Node], list[Calibrated]]
    write: Callable[[Sequence[Viewpoint]], str]
    keeps: frozenset[str] = frozenset()
    says_unit: Callable[[Node], str | None] = lambda tree: "m"


def intrinsics_at(
    place: Node, size: tuple[int, int], four: Sequence[float], model: DistortionModel, distortion: Sequence[float]
) -> Intrinsics:
    """The intrinsics of fx, fy, cx, cy and coefficients that stand at a place.  Raises DataError."""
    fx, fy, cx, cy = four
    try:
        return Intrinsics(size=size, focal_px=(fx, fy), centre_px=(cx, cy), model=model, distortion=tuple(distortion))
    except ValidationError as error:
        why = clause(error.errors()[0]["msg"])
        raise DataError(f"{place.file}: {place.place or 'the camera'}: {why}; correct that value") from error


def model_named(place: Node, models: dict[str, DistortionModel]) -> DistortionModel:
    """The distortion model that is named at a place.  Raises DataError for one that is not known."""
    name = place.text()
    if name not in models:
        known = ", ".join(repr(known) for known in models if known)
        raise DataError(f"{place.file}: {place.place} is '{name}'; vid2ev knows {known}")
    return models[name]


def rig_of(cameras: Sequence[Calibrated]) -> Rig:
    """A rig of the cameras, with the first at its origin, and names that folders can have."""
    made: list[Camera] = []
    for camera in cameras:
        lens, pose = camera.intrinsics, camera.from_first.inverse()
        made.append(
            Camera(
                name=_free_name(camera.name, camera.kind, {other.name.casefold() for other in made}),
                kind=camera.kind,
                size=lens.size,
                focal_px=lens.focal_px,
                centre_px=lens.centre_px,
                distortion_model=lens.model,
                distortion=lens.distortion,
                rotation_deg=tuple(rotation_vector_deg(pose.rotation).tolist()),
                translation_mm=tuple((pose.translation_m * 1000).tolist()),
                clock_offset_us=camera.clock_offset_us,
            )
        )
    return Rig(cameras=tuple(made))


def from_first(views: Sequence[Viewpoint]) -> list[Pose]:
    """The rigid motions from the first camera's coordinates to those of each."""
    return [_exact_if_same(views[0], view) for view in views]


def distortion_of(view: Viewpoint, most: int, format_name: str) -> tuple[float, ...]:
    """The coefficients of a camera's distortion, of which a format can hold so many at most.  Raises UsageError."""
    held = view.intrinsics.distortion
    if any(held[most:]):
        raise UsageError(
            f"{format_name} holds {most} coefficients of distortion, and camera {view.camera.name} has"
            f" {len(held)}; choose --as opencv"
        )
    return held[:most]


def _exact_if_same(first: Viewpoint, view: Viewpoint) -> Pose:
    if view is first:
        return Pose.of()
    return view.pose.inverse() @ first.pose


def _free_name(text: str, kind: Kind, taken: set[str]) -> str:
    """A name for a folder, as near to a text as can be, that no other camera has."""
    base = re.sub(r"[^\w-]+", "_", text).strip("_-")[:48] or kind
    names = text, base, *(f"{base}_{number}" for number in range(2, len(taken) + 3))
    return next(name for name in names if name.casefold() not in taken and _can_be(name, kind))


def _can_be(name: str, kind: Kind) -> bool:
    try:
        Camera(name=name, kind=kind)
    except ValidationError:
        return False
    return True
