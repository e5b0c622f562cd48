"""Scenes that are put somewhere else, with the photographs and meshes that they name beside them."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from vid2ev.scenes.scene_file import LISTS
from vid2ev.scenes.textures import PHOTOGRAPHS

FOLDER = "files"
ALONE = (".ply", ".stl", ".glb")  # meshes that name no other files


def with_own_files(tables: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Path]]:
    """The tables of a scene with its files in the folder beside it, and which files these are.

    Meshes that name further files, and a rig, stay where they are.
    """
    names: dict[Path, str] = {}

    def own(text: Any) -> Any:
        if not isinstance(text, str) or text in PHOTOGRAPHS:
            return text
        file = Path(text)
        return names.setdefault(file, f"{FOLDER}/{len(names) + 1}{file.suffix.lower()}")

    tables = copy.deepcopy(tables)
    for kind in LISTS:
        for thing in tables.get(kind, []):
            own_keys = ("texture", "file") if _is_alone(thing.get("file")) else ("texture",)
            thing |= {key: own(thing[key]) for key in own_keys if key in thing}
    setting = tables.get("scene", {})
    setting |= {key: own(setting[key]) for key in ("environment",) if key in setting}
    return tables, {name: file for file, name in names.items()}


def _is_alone(mesh: str | None) -> bool:
    """Whether a mesh is in one file."""
    if mesh is None:
        return False
    suffix = Path(mesh).suffix.lower()
    return suffix in ALONE or (suffix == ".obj" and b"mtllib" not in Path(mesh).read_bytes())
