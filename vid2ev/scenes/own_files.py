"""Scenes that are put somewhere else, with the files that they name beside them: photographs, meshes with all that
these name, and the rig with its sensors.
"""

from __future__ import annotations

import copy
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import Any

from vid2ev.rig.rig_file import is_file, read_rig, rig_text, write_text
from vid2ev.scenes.mesh_files import SUFFIXES, named_by
from vid2ev.scenes.scene_file import PREDEFINED, files_named

FOLDER = "files"
RIG = "rig.toml"


def with_own_files(tables: dict[str, Any], into: str = FOLDER) -> tuple[dict[str, Any], dict[str, Path]]:
    """The tables of a scene with its files in the folder `into` beside it, and which files these are, for `copy_files`.

    What is named already as seen from there (`named_from`) stays as it is.
    """
    tables = copy.deepcopy(tables)
    named = [(table, key) for table, key, _ in files_named(tables)]
    taken = tuple(table[key] for table, key in named)
    numbers = (n for n in count(1) if not any(re.match(rf"{re.escape(into)}/{n}([./]|$)", name) for name in taken))
    names: dict[Path, str] = {}
    for table, key in named:
        file = Path(table[key])
        if file.is_absolute():
            table[key] = names[file] = names.get(file) or f"{into}/{_name(file, key, numbers)}"
    return tables, {name: file for file, name in names.items()}


def named_from(tables: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene with the files that are in a folder, or below it, named as seen from there; those that come
    along with vid2ev as scene files name them."""
    tables = copy.deepcopy(tables)
    for table, key, _ in files_named(tables):
        for place in (PREDEFINED, Path(os.path.abspath(folder))):
            if Path(table[key]).is_relative_to(place):
                table[key] = Path(table[key]).relative_to(place).as_posix()
    return tables


def copy_files(files: Mapping[str, Path], folder: Path) -> None:
    """Copy the files of `with_own_files` into the folder of their scene.  Raises DataError, OSError, and UsageError for
    a mesh that finds two files under one name."""
    for name, file in files.items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if place.name == RIG:
            _copy_rig(file, place)
            continue
        shutil.copyfile(file, place)
        for beside, part in named_by(file).items() if file.suffix.lower() in SUFFIXES else ():
            (place.parent / beside).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(part, place.parent / beside)


def _name(file: Path, key: str, numbers: Iterator[int]) -> str:
    if key == "rig":
        return RIG
    # (a mesh has a folder of its own, as it may name other files)
    return f"{next(numbers)}/{file.name}" if key == "file" else f"{next(numbers)}{file.suffix.lower()}"


def _copy_rig(file: Path, place: Path) -> None:
    """A rig, with the files of its cameras' sensors beside it."""
    rig, cameras = read_rig(file, to_use=False), []
    for camera in rig.cameras:
        if camera.sensor is not None and is_file(camera.sensor):
            sensor, name = Path(camera.sensor), f"rig.{camera.name}.toml"
            if sensor.is_file():  # (pictures are made without)
                shutil.copyfile(sensor, place.with_name(name))
            camera = camera.model_copy(update={"sensor": name})
        cameras.append(camera)
    write_text(place, rig_text(rig.model_copy(update={"cameras": tuple(cameras)})), overwrite=True)
