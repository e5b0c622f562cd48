"""Scenes that are put somewhere else, with the photographs and meshes that they name beside them."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from vid2ev.scenes.scene_file import files_named
from vid2ev.scenes.textures import PHOTOGRAPHS

FOLDER = "files"
ALONE = (".ply", ".stl", ".glb")  # meshes that name no other files


def with_own_files(tables: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Path]]:
    """The tables of a scene with its files in the folder beside it, and which files these are.

    Meshes that name further files, and a rig, stay where they are.
    """
    names: dict[Path, str] = {}
    tables = copy.deepcopy(tables)
    for table, key, _ in files_named(tables):
        text = table[key]
        if text not in PHOTOGRAPHS and (key in ("texture", "environment") or (key == "file" and _is_alone(text))):
            file = Path(text)
            table[key] = names.setdefault(file, f"{FOLDER}/{len(names) + 1}{file.suffix.lower()}")
    return tables, {name: file for file, name in names.items()}


def _is_alone(mesh: str) -> bool:
    """Whether a mesh is in one file."""
    suffix = Path(mesh).suffix.lower()
    return suffix in ALONE or (suffix == ".obj" and b"mtllib" not in Path(mesh).read_bytes())
