"""What is written for Blender: a folder of plain files.

    KEY.json              a request: a camera, and things, lamps and sky in its coordinates
    KEY.npz               a mesh: triangles with (u, v), normals and colours of their corners (`corners.py`)
    KEY.npy               a picture, linear light [H, W, 3], float32
    KEY.geometry.exr      the answers (`answer.py`)
    KEY.light-0.exr ...

A key is a digest of what it stands for: nothing is written or rendered twice, and answers that are there already are
those to the same request.

The light of a scene is that of `scenes.snapshot`, as near as Cycles has it.  Ambient light and a background of one
colour reach every surface unhindered, as part of its `light`; a picture as environment lights as it does in nature.
Every lamp has a pass of its own, and light adds up: of several lamps Cycles would draw one for each sample, and an
event camera would see that noise.

Where surfaces of two things are one, the embedded renderer shows the thing that begins nearer to the camera, and
float32 would show specks of both.  So the things are enlarged a little around the camera, one after the other: that
changes nothing in the picture but who stands before whom.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.recording.disk import whole_file, write_npz
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.scenes.blender.corners import corners_of
from vid2ev.scenes.snapshot import Lamp, Shape, Snapshot, Texture, Thing
from vid2ev.scenes.world_numbers import numbers_of, texture_on, wraps_on

APART = 3e-6  # by which a thing is larger than the one before it: some 20 steps of float32
APART_ALL = 3e-4  # of many, at most


class Request(NamedTuple):
    """A request and what comes of it.

    path     of the request; `answers`, of the geometry and of each light, once Blender has made them
    larger   how many times larger each thing is than it should be, [things]
    """

    path: Path
    answers: list[Path]
    larger: np.ndarray


class Exchange:
    """The files for Blender in a folder.

    samples  of each pixel's light; `threads` that render, None for all
    """

    def __init__(self, folder: Path, samples: int, threads: int | None = None):
        self.folder, self.samples, self.threads = folder, samples, threads
        self._meshes: dict[Shape, str] = {}
        self._pictures: dict[tuple[Texture, bool, bool], str] = {}

    def request(self, snapshot: Snapshot, intrinsics: Intrinsics, pose: Pose) -> Request:
        """Write what a camera with this pose (camera to world) is to see.

        Raises UsageError for a lens with distortion.
        """
        if intrinsics.model != "none":
            raise UsageError(
                f"Blender renders no lens with distortion '{intrinsics.model}'; give a camera without, or render with"
                " the embedded renderer"
            )
        larger = _larger(snapshot, pose)
        asked = self._asked(snapshot, intrinsics, pose.inverse(), larger)
        key = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:32]
        for render in asked["passes"]:
            render["answer"] = f"{key}.{render['kind']}.exr"
        path = self.folder / f"{key}.json"
        with whole_file(path) as file:
            file.write(json.dumps(asked, indent=1).encode())
        return Request(path, [self.folder / render["answer"] for render in asked["passes"]], larger)

    def _asked(self, snapshot: Snapshot, intrinsics: Intrinsics, to_camera: Pose, larger: np.ndarray) -> dict[str, Any]:
        sky, everywhere = self._sky(snapshot, to_camera)
        everywhere = everywhere + sum(np.array(lamp.colour) for lamp in snapshot.lamps if lamp.kind == "ambient")
        lamps = [_lamp(lamp, to_camera) for lamp in snapshot.lamps if lamp.kind != "ambient" and any(lamp.colour)]
        return {
            "size": intrinsics.size,
            "focal_px": intrinsics.focal_px,
            "centre_px": intrinsics.centre_px,
            "samples": self.samples,
            "threads": self.threads or 0,
            "things": [
                self._thing(thing, everywhere, to_camera, times)
                for thing, times in zip(snapshot.things, larger, strict=True)
            ],
            "lamps": lamps,
            "sky": sky,
            "passes": _passes(len(lamps), sky["texture"] is not None),
        }

    def _thing(self, thing: Thing, everywhere: np.ndarray, to_camera: Pose, larger: float) -> dict[str, Any]:
        surface, texture = thing.surface, texture_on(thing)
        wraps = wraps_on(thing)
        scale, offset = _placed(texture, surface.repeat, wraps)
        matrix = np.eye(4)
        there = to_camera @ thing.pose
        matrix[:3, :3], matrix[:3, 3] = larger * there.rotation, larger * there.translation_m
        return {
            "mesh": self._mesh(thing.shape),
            "texture": None if texture is None else self._picture(texture, *wraps),
            "scale": scale,
            "offset": offset,
            "colour": list(surface.colour),
            "specular": surface.specular,
            "shininess": surface.shininess,
            "light": (everywhere + surface.emission).tolist(),
            "pose": matrix.tolist(),
        }

    def _sky(self, snapshot: Snapshot, to_camera: Pose) -> tuple[dict[str, Any], np.ndarray]:
        """The background, and the light that it sends to every surface unhindered."""
        around, gain = snapshot.environment, snapshot.environment_gain
        if around is None:
            return {"texture": None, "light": [0.0, 0.0, 0.0]}, np.zeros(3)
        colour = gain * around.pixels[0, 0].astype(np.float64)
        if (around.pixels == around.pixels[0, 0]).all():
            return {"texture": None, "light": colour.tolist()}, colour
        turn = snapshot.environment_pose.rotation.T @ to_camera.rotation.T
        name = self._picture(around, True, True)
        return {"texture": name, "light": [gain] * 3, "turn": turn.tolist()}, np.zeros(3)

    def _mesh(self, shape: Shape) -> str:
        if shape not in self._meshes:
            made = corners_of(shape)._asdict()
            arrays = {name: np.asarray(array, np.float64) for name, array in made.items()}
            self._meshes[shape] = self._stored(arrays, "npz", lambda file: write_npz(file, arrays))
        return self._meshes[shape]

    def _picture(self, texture: Texture, wraps_u: bool, wraps_v: bool) -> str:
        """A texture, with its border once more around it where it is held instead of repeated."""
        key = texture, wraps_u, wraps_v
        if key not in self._pictures:
            margins = ((1 - wraps_v,) * 2, (1 - wraps_u,) * 2, (0, 0))
            pixels = np.pad(texture.pixels, margins, mode="edge")
            self._pictures[key] = self._stored({"pixels": pixels}, "npy", lambda file: np.save(file, pixels))
        return self._pictures[key]

    def _stored(self, arrays: dict[str, np.ndarray], suffix: str, write: Callable[[Any], None]) -> str:
        """Write a file that is called by what is in it; its name."""
        digest = hashlib.sha256()
        for name, array in arrays.items():
            digest.update(f"{name} {array.shape}".encode())
            digest.update(np.ascontiguousarray(array).data)
        path = self.folder / f"{digest.hexdigest()[:32]}.{suffix}"
        if not path.exists():
            with whole_file(path) as file:
                write(file)
        return path.name


def _larger(snapshot: Snapshot, pose: Pose) -> np.ndarray:
    """The factors of the things, in the order in which the embedded renderer meets them."""
    order = numbers_of(snapshot, pose).order
    factors = np.empty(len(order))
    factors[order] = 1 + np.arange(len(order)) * min(APART, APART_ALL / max(len(order), 1))
    return factors


def _placed(
    texture: Texture | None, repeat: tuple[float, float], wraps: tuple[bool, bool]
) -> tuple[list[float], list[float]]:
    """How (u, v) of a shape become those of Blender's picture, with v up: (u, v) * scale + offset."""
    if texture is None:
        return [1.0, 1.0], [0.0, 0.0]
    height, width = texture.pixels.shape[:2]
    scale, offset = [], []
    for length, times, around in zip((width, height), repeat, wraps, strict=True):
        inside = 1.0 if around else length / (length + 2)
        scale.append(inside * times)
        offset.append((1 - inside) / 2 + inside * (times < 0))
    return [scale[0], -scale[1]], [offset[0], 1 - offset[1]]


def _lamp(lamp: Lamp, to_camera: Pose) -> dict[str, Any]:
    if lamp.kind == "point":
        place = to_camera.apply(np.array(lamp.position_m))
    else:
        place = to_camera.rotation @ np.array(lamp.direction) / np.linalg.norm(lamp.direction)
    return {
        "kind": lamp.kind,
        "colour": list(lamp.colour),
        "place": place.tolist(),
        "reach_m": lamp.reach_m,
        "shadows": lamp.shadows,
    }


def _passes(lamps: int, lit_by_sky: bool) -> list[dict[str, Any]]:
    """The geometry, and the light of each lamp; what is everywhere comes with the first, a sky that lights alone."""
    groups: list[list[int]] = [[lamp] for lamp in range(lamps)]
    if lit_by_sky or not groups:
        groups.insert(0, [])
    light = [{"kind": f"light-{k}", "around": k == 0, "lamps": group} for k, group in enumerate(groups)]
    return [{"kind": "geometry", "around": False, "lamps": []}, *light]
