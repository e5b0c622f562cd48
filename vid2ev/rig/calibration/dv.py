"""dv-processing's CalibrationSet: JSON of iniVation's cameras.

    {"version": "2.0",
     "cameras": {"C0": {"name", "position", "master",
                        "resolution": [width, height],          px; numbers are texts, as Boost writes them
                        "principalPoint": [cx, cy], "focalLength": [fx, fy],
                        "distortionCoefficients": [...],        of "distortionModel":
                        "distortionModel": "radialTangential",  "none", "radialTangential" (4 or 5), "equidistant" (4)
                        "transformationToC0": [16 numbers]},    by rows, m
                 "C1": ...}}

In spite of its name, transformationToC0 takes points of C0 to the camera: so says the comment in the sources, and
so does `StereoGeometry` use it to rectify.

Source: dv-processing 2.0, `dv::camera::calibrations::CameraCalibration`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from vid2ev.rig.calibration.calibrated import (
    Calibrated,
    CalibrationFormat,
    distortion_of,
    from_first,
    intrinsics_at,
    model_named,
)
from vid2ev.rig.calibration.node import Node
from vid2ev.rig.camera import Viewpoint
from vid2ev.rig.intrinsics import DistortionModel
from vid2ev.rig.pose import Pose

NAMES: dict[DistortionModel, str] = {"none": "none", "radtan": "radialTangential", "equidistant": "equidistant"}
MODELS: dict[str, DistortionModel] = {name: model for model, name in NAMES.items()} | {"": "none"}


def read(tree: Node) -> list[Calibrated]:
    """The cameras of a set, in the order of their keys.  Raises DataError."""
    cameras = dict(tree["cameras"].items())
    return [_camera(cameras[key], key) for key in sorted(cameras, key=_number)]


def write(views: Sequence[Viewpoint]) -> str:
    """A set of the cameras.  Raises UsageError for a distortion that it cannot hold."""
    cameras: dict[str, Any] = {}
    for index, (view, pose) in enumerate(zip(views, from_first(views), strict=True)):
        lens = view.intrinsics
        distortion = distortion_of(view, 5, "dv-processing")
        cameras[f"C{index}"] = {
            "name": view.camera.name,
            "position": view.camera.name,
            "master": "true" if index == 0 else "false",
            "resolution": _texts(lens.size),
            "principalPoint": _texts(lens.centre_px),
            "focalLength": _texts(lens.focal_px),
            "distortionCoefficients": _texts(distortion) or "",  # (Boost has no empty list)
            "distortionModel": NAMES[lens.model],
            "transformationToC0": _texts(_sixteen(pose)),
        }
    return json.dumps({"version": "2.0", "cameras": cameras}, indent=4, ensure_ascii=False) + "\n"


def _number(key: str) -> int:
    """Of C0, C1, ...; other keys come last."""
    return int(key[1:]) if re.fullmatch(r"C\d{1,6}", key) else 10**6


def _camera(node: Node, key: str) -> Calibrated:
    model = model_named(node["distortionModel"], MODELS)
    coefficients = node["distortionCoefficients"]
    distortion = coefficients.numbers() if coefficients.value != "" else []
    four = [*node["focalLength"].numbers(2), *node["principalPoint"].numbers(2)]
    name = node["name"].text() if "name" in node else ""
    lens = intrinsics_at(node, node["resolution"].size(), four, model, distortion)
    return Calibrated(name or key, lens, node["transformationToC0"].rigid())


def _sixteen(pose: Pose) -> list[float]:
    rows = zip(pose.rotation.tolist(), pose.translation_m.tolist(), strict=True)
    return [*(number for row, shift in rows for number in (*row, shift)), 0, 0, 0, 1]


def _texts(numbers: Sequence[float]) -> list[str]:
    return [repr(number) for number in numbers]


def _recognises(tree: Node) -> bool:
    cameras = tree["cameras"].value if "cameras" in tree else None
    entries = cameras.values() if isinstance(cameras, dict) else []
    return any(isinstance(held, dict) and ("focalLength" in held or "resolution" in held) for held in entries)


FORMAT = CalibrationFormat(
    "dv",
    "dv-processing's calibration set, JSON",
    recognises=_recognises,
    read=read,
    write=write,
)
