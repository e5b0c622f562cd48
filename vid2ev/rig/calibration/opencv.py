"""OpenCV's YAML: one camera as ROS and OpenCV's samples write it, two as its stereo sample does, or any number.

    image_width, image_height, camera_matrix,       one camera; without distortion_model the number of coefficients
    distortion_coefficients, [distortion_model]     says which it is (4, 5, 8: radtan), or fisheye_model: 1

    M1, D1, M2, D2, R, T, image_width, ...          two; X_2 = R X_1 + T; what says the model of distortion is for both

    unit: m                                         any number, as vid2ev writes them; with one or two cameras the keys
    cameras: [{camera_name, kind, image_width, ...  above are there as well
               rotation, translation}]              X_camera = R X_first + T

The unit of T is that of the board that was seen, which no file of OpenCV's says; `unit` may be cm or mm, too.

Sources: OpenCV 4.x, samples calibration.cpp and stereo_calib.cpp, `FileStorage`; ROS, camera_calibration_parsers (the
names plumb_bob, rational_polynomial, equidistant).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vid2ev.errors import DataError
from vid2ev.rig.calibration.calibrated import (
    UNITS_M,
    Calibrated,
    CalibrationFormat,
    Kind,
    from_first,
    intrinsics_at,
    model_named,
)
from vid2ev.rig.calibration.node import Node
from vid2ev.rig.camera import Viewpoint
from vid2ev.rig.intrinsics import DistortionModel, Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose

MODELS: dict[str, DistortionModel] = {
    "none": "none",
    "plumb_bob": "radtan",
    "rational_polynomial": "radtan",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
}
MATRICES = ("M{}", "K{}", "cameraMatrix{}", "camera_matrix_{}")  # of the cameras 1 and 2 of a pair
COEFFICIENTS = ("D{}", "distCoeffs{}", "dist_coeffs{}", "distortion_coefficients_{}")
KINDS: dict[str, Kind] = {"dvs": "dvs", "cis": "cis"}


def read(tree: Node) -> list[Calibrated]:
    """The cameras of a file; translations are in its unit.  Raises DataError."""
    if "cameras" in tree:
        return [_entry(node, index) for index, node in enumerate(tree["cameras"].entries())]
    if any(pattern.format(1) in tree for pattern in MATRICES):
        return _pair(tree)
    name = tree["camera_name"].text() if "camera_name" in tree else "camera"
    return [Calibrated(name, _single(tree), IDENTITY)]


def write(views: Sequence[Viewpoint]) -> str:
    """A file of the cameras that `cv2.FileStorage` reads."""
    import cv2

    file = cv2.FileStorage(".yml", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    poses = from_first(views)
    file.write("unit", "m")
    if len(views) == 1:
        _write_lens(file, views[0])
    elif len(views) == 2:
        _write_pair(file, views, poses[1])
    file.startWriteStruct("cameras", cv2.FileNode_SEQ)
    for view, pose in zip(views, poses, strict=True):
        file.startWriteStruct("", cv2.FileNode_MAP)
        file.write("camera_name", view.camera.name)
        file.write("kind", view.camera.kind)
        _write_lens(file, view)
        file.write("rotation", pose.rotation)
        file.write("translation", pose.translation_m[:, None])
        file.endWriteStruct()
    file.endWriteStruct()
    return file.releaseAndGetString()


def _write_lens(file: Any, view: Viewpoint) -> None:
    lens = view.intrinsics
    radtan = "rational_polynomial" if len(lens.distortion) == 8 else "plumb_bob"
    file.write("image_width", lens.size[0])
    file.write("image_height", lens.size[1])
    file.write("camera_matrix", lens.matrix)
    file.write("distortion_model", radtan if lens.model == "radtan" else lens.model)
    file.write("distortion_coefficients", _coefficients(lens))


def _write_pair(file: Any, views: Sequence[Viewpoint], second: Pose) -> None:
    for number, view in enumerate(views, start=1):
        file.write(f"M{number}", view.intrinsics.matrix)
        file.write(f"D{number}", _coefficients(view.intrinsics))
    file.write("R", second.rotation)
    file.write("T", second.translation_m[:, None])


def _coefficients(lens: Intrinsics) -> np.ndarray:
    """As OpenCV takes them: one row; zeros where there is no distortion."""
    return np.array([lens.distortion or (0.0,) * 5], np.float64)


def _entry(node: Node, index: int) -> Calibrated:
    pose = Pose(node["rotation"].rotation(), node["translation"].matrix(3, 1)[:, 0])
    name = node["camera_name"].text() if "camera_name" in node else f"cam{index}"
    kind = KINDS.get(node["kind"].text(), "dvs") if "kind" in node else "dvs"
    return Calibrated(name, _single(node), pose, kind)


def _pair(tree: Node) -> list[Calibrated]:
    """A stereo pair; what two files of OpenCV's sample hold must stand in one."""
    second = Pose(tree["R"].rotation(), tree["T"].matrix(3, 1)[:, 0])
    model = _model(tree)
    lenses = [
        _intrinsics(
            tree.first_of(*(key.format(number) for key in MATRICES)),
            tree.first_of(*(key.format(number) for key in COEFFICIENTS)),
            _size(tree),
            model,
        )
        for number in (1, 2)
    ]
    return [Calibrated("left", lenses[0], IDENTITY), Calibrated("right", lenses[1], second)]


def _single(node: Node) -> Intrinsics:
    coefficients = node.first_of("distortion_coefficients", "dist_coeffs", "distCoeffs")
    return _intrinsics(node.first_of("camera_matrix", "cameraMatrix", "K"), coefficients, _size(node), _model(node))


def _model(node: Node) -> DistortionModel | None:
    """What the coefficients are of, where the file says it."""
    if "distortion_model" in node:
        return model_named(node["distortion_model"], MODELS)
    return "equidistant" if "fisheye_model" in node and node["fisheye_model"].number() else None


def _size(node: Node) -> tuple[int, int]:
    for key in ("image_size", "imageSize", "resolution", "size"):
        if key in node:
            return node[key].size()
    return node["image_width"].side(), node["image_height"].side()


def _intrinsics(matrix: Node, coefficients: Node, size: tuple[int, int], model: DistortionModel | None) -> Intrinsics:
    (fx, skew, cx), (below, fy, cy), last = matrix.matrix(3, 3).tolist()
    if skew or below or last != [0, 0, 1]:
        raise matrix.wrong("a camera matrix of fx, 0, cx, 0, fy, cy, 0, 0, 1")
    values = coefficients.numbers()
    if model == "none":
        values = []
    elif model is None and not any(values):
        model, values = "none", []
    elif model != "equidistant" and len(values) > 8:
        values = _first_eight(coefficients, values)
    return intrinsics_at(coefficients, size, (fx, fy, cx, cy), model or "radtan", values)


def _first_eight(place: Node, values: list[float]) -> list[float]:
    """Without what OpenCV has beyond: thin prisms and tilted sensors."""
    if any(values[8:]):
        raise DataError(f"{place.file}: {place.place} has a thin prism or a tilt; vid2ev knows k1 ... k6, p1 and p2")
    return values[:8]


def _unit(tree: Node) -> str | None:
    """That of the translations, where the file says it."""
    if "unit" in tree and tree["unit"].text() not in UNITS_M:
        raise tree["unit"].wrong(f"one of {', '.join(UNITS_M)}")
    return tree["unit"].text() if "unit" in tree else None


def _recognises(tree: Node) -> bool:
    cameras = tree["cameras"].value if "cameras" in tree else None
    keys = ["camera_matrix", "cameraMatrix", "K", *(pattern.format(1) for pattern in MATRICES)]
    return bool(cameras and isinstance(cameras, list)) or any(key in tree for key in keys)


FORMAT = CalibrationFormat(
    "opencv",
    "OpenCV's YAML",
    recognises=_recognises,
    read=read,
    write=write,
    keeps=frozenset({"kinds"}),
    says_unit=_unit,
)
