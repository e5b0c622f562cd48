"""Kalibr's camchain.yaml: a chain of cameras, each placed against the one before it.

    cam1:
      camera_model: pinhole
      intrinsics: [fu, fv, pu, pv]            px
      distortion_model: radtan                none, radtan (k1 k2 p1 p2) or equidistant (k1 k2 k3 k4)
      distortion_coeffs: [...]
      T_cn_cnm1: [4 x 4]                      points of the camera before it to this one, m; not in cam0
      T_cam_imu: [4 x 4]                      points of the IMU to this camera; read where T_cn_cnm1 is not there
      timeshift_cam_imu: 0.0                  t_imu = t_cam + shift, s; the IMU's clock is the rig's
      rostopic: /NAME/events                  or /NAME/image_raw, of a frame camera; /ROOM/NAME/events as well
      resolution: [width, height]

Source: Kalibr's wiki, "Yaml formats" and "Supported models".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import yaml

from vid2ev.errors import DataError
from vid2ev.rig.calibration.calibrated import (
    Calibrated,
    CalibrationFormat,
    Kind,
    distortion_of,
    from_first,
    intrinsics_at,
    model_named,
)
from vid2ev.rig.calibration.node import Node
from vid2ev.rig.camera import LATEST_US, Viewpoint
from vid2ev.rig.intrinsics import DistortionModel
from vid2ev.rig.pose import IDENTITY, Pose

MODELS: dict[str, DistortionModel] = {"none": "none", "radtan": "radtan", "equidistant": "equidistant"}
TOPIC = re.compile(r"(?:/[\w-]+)*/([\w-]+)/(events|image_raw)")
TOPICS: dict[str, Kind] = {"events": "dvs", "image_raw": "cis"}


def read(tree: Node) -> list[Calibrated]:
    """The cameras of a chain.  Raises DataError."""
    found: list[Calibrated] = []
    for key in _keys(tree):
        node = tree[key]
        topic = TOPIC.fullmatch(node["rostopic"].text()) if "rostopic" in node else None
        found.append(
            Calibrated(
                name=topic[1] if topic else key,
                intrinsics=_intrinsics(node),
                from_first=_from_first(tree, node, found),
                kind=TOPICS[topic[2]] if topic else "dvs",
                clock_offset_us=_clock_offset_us(node),
            )
        )
    return found


def write(views: Sequence[Viewpoint]) -> str:
    """A chain of the cameras.  Raises UsageError for a distortion that it cannot hold."""
    chain: dict[str, Any] = {}
    poses = from_first(views)
    timed = any(view.camera.clock_offset_us for view in views)
    for index, (view, pose) in enumerate(zip(views, poses, strict=True)):
        lens, camera = view.intrinsics, view.camera
        chain[f"cam{index}"] = {
            "camera_model": "pinhole",
            "intrinsics": [*lens.focal_px, *lens.centre_px],
            "distortion_model": lens.model,
            "distortion_coeffs": list(distortion_of(view, 4, "Kalibr's camchain")),
            **({"T_cn_cnm1": four_by_four(pose @ poses[index - 1].inverse())} if index else {}),
            **({"timeshift_cam_imu": -camera.clock_offset_us / 1e6} if timed else {}),
            "rostopic": f"/{camera.name}/{'events' if camera.kind == 'dvs' else 'image_raw'}",
            "resolution": list(lens.size),
        }
    return yaml.safe_dump(chain, sort_keys=False, default_flow_style=None, width=1 << 16)


def _keys(tree: Node) -> list[str]:
    """Those of cameras, cam0, cam1, ... in order of their numbers."""
    keys = [key for key, _ in tree.items() if re.fullmatch(r"cam\d{1,4}", key)]
    return sorted(keys, key=lambda key: int(key[3:]))


def _intrinsics(node: Node) -> Any:
    projection = node["camera_model"].text() if "camera_model" in node else "pinhole"
    if projection != "pinhole":
        raise DataError(f"{node.file}: {node.place} is an '{projection}' camera; vid2ev knows pinhole cameras")
    model = model_named(node["distortion_model"], MODELS)
    distortion = [] if model == "none" else node["distortion_coeffs"].numbers(4)
    return intrinsics_at(node, node["resolution"].size(), node["intrinsics"].numbers(4), model, distortion)


def _from_first(tree: Node, node: Node, before: list[Calibrated]) -> Pose:
    """By the camera before it, or else by the IMU that both are placed against."""
    if not before:
        return IDENTITY
    first = tree[_keys(tree)[0]]
    if "T_cn_cnm1" not in node and "T_cam_imu" in node and "T_cam_imu" in first:
        return node["T_cam_imu"].rigid() @ first["T_cam_imu"].rigid().inverse()
    return node["T_cn_cnm1"].rigid() @ before[-1].from_first


def _clock_offset_us(node: Node) -> int:
    if "timeshift_cam_imu" not in node:
        return 0
    shift_s = node["timeshift_cam_imu"].number()
    if abs(shift_s) > LATEST_US / 1e6:
        raise node["timeshift_cam_imu"].wrong("a shift of a clock in seconds")
    return round(-shift_s * 1e6)


def four_by_four(pose: Pose) -> list[list[float]]:
    """A rigid motion as rows of a matrix [4, 4]."""
    rows = zip(pose.rotation.tolist(), pose.translation_m.tolist(), strict=True)
    return [*([*row, shift] for row, shift in rows), [0.0, 0.0, 0.0, 1.0]]


def _recognises(tree: Node) -> bool:
    return "cam0" in tree and any(key in tree["cam0"] for key in ("intrinsics", "camera_model", "distortion_model"))


FORMAT = CalibrationFormat(
    "kalibr",
    "Kalibr's camchain.yaml",
    recognises=_recognises,
    read=read,
    write=write,
    keeps=frozenset({"kinds", "clocks"}),
)
