"""Files that a person opens: those of rigs, sensors and scenes, told apart by their tables."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from vid2ev.errors import DataError, UsageError, Vid2evError
from vid2ev.gui.setup import Setup
from vid2ev.rig.rig_file import read_rig, write_text
from vid2ev.scenes.scene_file import read_scene
from vid2ev.sensors.presets import CIS, DVS, load
from vid2ev.toml_text import parsed_toml
from vid2ev.untrusted import read_text

WANTED = "a TOML file of a sensor, a rig or a scene"
TABLES = ("dvs", "cis", "source", "camera", "scene", "objects", "lights")


def loaded(setup: Setup, text: str, name: str) -> Setup:
    """The setup with what a text says that a browser sends: its rig, the sensor of all cameras of its kind, or its
    scene.

    Raises UsageError, DataError.
    """
    tables = _tables(text, name)
    with TemporaryDirectory(prefix="vid2ev-gui-") as folder:
        path = Path(folder) / "given.toml"  # (what a browser calls it may be no name for a file here)
        write_text(path, text, overwrite=True)
        try:
            return _taken(setup, path, tables)
        except Vid2evError as error:  # (where it is kept is nobody's concern)
            why = str(error).replace(str(path), name)
            if folder in why or "no such file" in why:
                why = why.replace(f"{folder}{os.sep}", "").replace(f" in {folder}", "").rstrip(".")
                why = f"{why}; a browser sends no other files along: give the path of {name} instead"
            raise type(error)(why) from error


def loaded_from(setup: Setup, path: Path) -> Setup:
    """The same of a file on this machine, which may name others beside it.  Raises UsageError, DataError."""
    if not os.path.isfile(path):
        raise UsageError(f"{path}: no such file; give {WANTED}")
    try:
        text = read_text(path)
    except UnicodeDecodeError as error:
        raise DataError(f"{path} is not a text; give {WANTED}") from error
    return _taken(setup, path, _tables(text, str(path)))


def _tables(text: str, name: str) -> dict[str, Any]:
    try:
        tables = parsed_toml(text)
    except ValueError as error:
        raise DataError(f"{name} is not valid TOML: {error}; correct that line") from error
    if not any(table in tables for table in TABLES):
        raise DataError(f"{name} has none of the tables {', '.join(TABLES)}; give {WANTED}")
    return tables


def _taken(setup: Setup, path: Path, tables: dict[str, Any]) -> Setup:
    if "source" in tables or isinstance(tables.get("camera"), list):
        setup = replace(setup, rig=read_rig(path), own_rig=False)
        for number in range(len(setup.rig.cameras)):
            setup.spec(number)
        return setup
    kinds = [kind for kind in (DVS, CIS) if kind.table in tables]
    for kind in kinds:
        spec = load(kind, path)
        for number, camera in enumerate(setup.rig.cameras):
            if camera.kind == kind.table:
                setup = setup.with_spec(number, spec)
    if kinds:
        return setup
    scene = read_scene(path).resolved()
    return setup.with_scene(scene) if setup.is_scene else replace(setup, source="scene:room", scene=scene)
