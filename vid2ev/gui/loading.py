"""Files that a person opens: those of rigs, sensors and scenes, told apart by their tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from vid2ev.errors import DataError, Vid2evError
from vid2ev.gui.setup import Setup
from vid2ev.rig.rig_file import read_rig, write_text
from vid2ev.scenes.scene_file import read_scene
from vid2ev.sensors.presets import CIS, DVS, load
from vid2ev.toml_text import parsed_toml


def loaded(setup: Setup, text: str, name: str, folder: Path) -> Setup:
    """The setup with what a file says: its rig, the sensor of all cameras of its kind, or its scene.

    The text is kept in `folder` while it is read.  Raises UsageError, DataError.
    """
    try:
        tables = parsed_toml(text)
    except ValueError as error:
        raise DataError(f"{name} is not valid TOML: {error}; correct that line") from error
    path = folder / "given.toml"  # (what a browser calls it may be no name for a file here)
    write_text(path, text, overwrite=True)
    try:
        return _taken(setup, path, tables)
    except Vid2evError as error:  # (where it is kept is nobody's concern)
        raise type(error)(str(error).replace(str(path), name)) from error


def _taken(setup: Setup, path: Path, tables: dict[str, Any]) -> Setup:
    if isinstance(tables.get("camera"), list):
        return replace(setup, rig=read_rig(path), own_rig=False)
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
