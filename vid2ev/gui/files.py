"""What the files say that a setup names: sensors, scenes and what these name, read again when they are written again.

A page is open for hours while files are edited beside it, and its conversions read them as they are then; what is shown
before has to be the same.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from vid2ev.errors import Vid2evError
from vid2ev.scenes.mesh_files import named_by
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.scene_file import SceneFile, files_named, read_scene
from vid2ev.scenes.source import Request
from vid2ev.sensors.presets import Kind, SensorFile, load, read_sensor
from vid2ev.stamps import Stamp, stamp

_beside_meshes: dict[str, tuple[Stamp, tuple[Path, ...]]] = {}  # what a mesh named, and the stamp of all that then


def sensor_file(name: str, kind: Kind) -> SensorFile:
    """A preset or a sensor file, with the source of each of its numbers.  Raises UsageError, DataError."""
    return _sensor_file(name, kind, stamp(name))


def specification(kind: Kind, name: str, texts: tuple[str, ...]) -> Any:
    """A preset or a sensor file, changed by `key=value` texts.  Raises UsageError, DataError."""
    return _specification(kind, name, texts, stamp(name))


def settled(request: Request) -> Scene:
    """A scene with every number settled, a photograph of each folder that it names among them.  Raises UsageError,
    DataError."""
    name, settings = request.name, tuple(request.settings)
    file = _scene_file(name, settings, written := stamp(name))
    named = (file.path.parent / text for text in _texts(file.tables))
    drawn = stamp(*(folder for folder in named if os.path.isdir(folder)))
    return _settled(name, settings, request.seed, written, drawn)


def stamp_of_scene(scene: Scene) -> Stamp:
    """What becomes another when a texture, a mesh, what that names, or a rig of a scene is written again."""
    names = [(key, table[key]) for table, key, _ in files_named(scene.tables())]
    meshes = (_stamp_of_mesh(name) for key, name in names if key == "file")
    return stamp(*(name for key, name in names if key != "file")) + tuple(mark for mesh in meshes for mark in mesh)


def _stamp_of_mesh(name: str) -> Stamp:
    """That of a mesh, its materials and their pictures; only its reader knows which these are."""
    before, files = _beside_meshes.get(name, ((), ()))
    if (now := stamp(name, *files)) != before or not now:
        try:
            files = tuple(named_by(Path(name)).values())
        except Vid2evError:  # (which is said when the scene is opened)
            files = ()
        now = stamp(name, *files)
        _beside_meshes[name] = now, files
    return now


def _texts(node: Any) -> Iterator[str]:
    """All texts in a tree, names of files among them, those of choices too."""
    if isinstance(node, str):
        yield node
    elif isinstance(node, Mapping):
        for value in node.values():
            yield from _texts(value)
    elif isinstance(node, list):
        for value in node:
            yield from _texts(value)


@lru_cache(maxsize=32)
def _sensor_file(name: str, kind: Kind, written: Stamp) -> SensorFile:
    return read_sensor(name, kind)


@lru_cache(maxsize=64)
def _specification(kind: Kind, name: str, texts: tuple[str, ...], written: Stamp) -> Any:
    return load(kind, name, texts)


@lru_cache(maxsize=16)
def _scene_file(name: str, settings: tuple[str, ...], written: Stamp) -> SceneFile:
    return read_scene(name, settings)


@lru_cache(maxsize=16)
def _settled(name: str, settings: tuple[str, ...], seed: int, written: Stamp, drawn: Stamp) -> Scene:
    return _scene_file(name, settings, written).resolved(seed)
