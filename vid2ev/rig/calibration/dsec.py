"""DSEC's cam_to_cam.yaml: event cameras and frame cameras, as they are and rectified.

    intrinsics:
      cam0: {camera_type: event|frame, camera_location, is_rectified: false, camera_model: pinhole,
             camera_matrix: [fx, fy, cx, cy], distortion_model: radtan, distortion_coeffs: [k1, k2, p1, p2],
             resolution: [width, height]}
      camRect0: ...                       the same camera rectified: its camera_matrix, without distortion
    extrinsics:
      T_10, T_21, T_32: [4 x 4]           T_XY takes points of camera Y to camera X, m
      R_rect0: [3 x 3]                    takes points of camera 0 to the rectified camera 0
    disparity_to_depth:
      cams_03, cams_12: [4 x 4]           Q of the event cameras, and of the frame cameras

In DSEC, cameras 0 and 3 are the event cameras on the left and on the right (640x480), 1 and 2 the frame cameras
(1440x1080).  Read are the cameras as they are; what is written beside them is made by `rectified`.

Sources: M. Gehrig et al., "DSEC: A stereo event camera dataset for driving scenarios", RA-L 2021, and its page "Data
format".
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
    from_first,
    intrinsics_at,
    model_named,
)
from vid2ev.rig.calibration.kalibr import MODELS, four_by_four
from vid2ev.rig.calibration.node import Node
from vid2ev.rig.calibration.rectified import rectify
from vid2ev.rig.camera import Viewpoint
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose

TYPES: dict[str, Kind] = {"event": "dvs", "frame": "cis"}
UNSAID: dict[str, Kind] = {"cam1": "cis", "cam2": "cis"}  # where a file has no camera_type: as they are in DSEC
KINDS = {kind: name for name, kind in TYPES.items()}


def read(tree: Node) -> list[Calibrated]:
    """The cameras as they are.  Raises DataError."""
    keys = sorted(
        (key for key, _ in tree["intrinsics"].items() if re.fullmatch(r"cam\d{1,4}", key)), key=lambda key: int(key[3:])
    )
    locations = [_location(tree["intrinsics"][key]) for key in keys]
    named = all(locations) and len(set(locations)) == len(keys)  # (DSEC's say left twice, and right twice)
    found: list[Calibrated] = []
    for index, key in enumerate(keys):
        node = tree["intrinsics"][key]
        name = locations[index] if named else key
        found.append(Calibrated(name, _intrinsics(node), _from_first(tree, key, keys, found), _kind(node, key)))
    return found


def write(views: Sequence[Viewpoint]) -> str:
    """A file of the cameras, with those that make a pair rectified."""
    poses = from_first(views)
    rectified, depths = rectify(views, poses)
    intrinsics: dict[str, Any] = {}
    for index, view in enumerate(views):
        about = {"camera_type": KINDS[view.camera.kind], "camera_location": view.camera.name}
        intrinsics[f"cam{index}"] = {
            **about,
            "is_rectified": False,
            "camera_model": "pinhole",
            "distortion_coeffs": list(view.intrinsics.distortion),
            "distortion_model": view.intrinsics.model,
            "resolution": list(view.intrinsics.size),
            "camera_matrix": [*view.intrinsics.focal_px, *view.intrinsics.centre_px],
        }
        intrinsics[f"camRect{index}"] = {
            **about,
            "is_rectified": True,
            "camera_model": "pinhole",
            "camera_matrix": rectified[index].four,
            "resolution": list(view.intrinsics.size),
        }
    steps = {_step(index): four_by_four(poses[index] @ poses[index - 1].inverse()) for index in range(1, len(views))}
    turns = {f"R_rect{index}": one.rotation.tolist() for index, one in enumerate(rectified)}
    q = {f"cams_{left}{right}": depth.tolist() for (left, right), depth in depths.items()}
    tree = {"intrinsics": intrinsics, "extrinsics": steps | turns, "disparity_to_depth": q}
    return yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, width=1 << 16)


def _step(index: int) -> str:
    """T_10, T_21, ... up to T_109 of the tenth camera to the next, as no file of DSEC has to say."""
    return f"T_{index}{index - 1}"


def _intrinsics(node: Node) -> Intrinsics:
    projection = node["camera_model"].text() if "camera_model" in node else "pinhole"
    if projection != "pinhole":
        raise DataError(f"{node.file}: {node.place} is an '{projection}' camera; vid2ev knows pinhole cameras")
    numbers = node["camera_matrix"].numbers(4, 9)
    four = numbers if len(numbers) == 4 else [numbers[0], numbers[4], numbers[2], numbers[5]]
    model = model_named(node["distortion_model"], MODELS)
    distortion = [] if model == "none" else node["distortion_coeffs"].numbers()
    return intrinsics_at(node, node["resolution"].size(), four, model, distortion)


def _from_first(tree: Node, key: str, keys: list[str], before: list[Calibrated]) -> Pose:
    """By the camera before it."""
    if not before:
        return IDENTITY
    one, other = int(key[3:]), int(keys[len(before) - 1][3:])
    return tree["extrinsics"][f"T_{one}{other}"].rigid() @ before[-1].from_first


def _location(node: Node) -> str:
    return node["camera_location"].text() if "camera_location" in node else ""


def _kind(node: Node, key: str) -> Kind:
    return TYPES.get(node["camera_type"].text(), "dvs") if "camera_type" in node else UNSAID.get(key, "dvs")


def _recognises(tree: Node) -> bool:
    return "intrinsics" in tree and "cam0" in tree["intrinsics"]


FORMAT = CalibrationFormat(
    "dsec",
    "DSEC's cam_to_cam.yaml",
    recognises=_recognises,
    read=read,
    write=write,
    keeps=frozenset({"kinds"}),
)
