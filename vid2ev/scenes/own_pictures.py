"""Scenes that are put somewhere else, with the photographs that they name beside them."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from vid2ev.scenes.scene_file import LISTS
from vid2ev.scenes.textures import PHOTOGRAPHS

PICTURES = "pictures"  # the folder


def with_own_pictures(tables: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Path]]:
    """The tables of a scene with its photographs in the folder beside it, and which files these are."""
    names: dict[Path, str] = {}

    def own(text: Any) -> Any:
        if not isinstance(text, str) or text in PHOTOGRAPHS:
            return text
        file = Path(text)
        return names.setdefault(file, f"{PICTURES}/{len(names) + 1}{file.suffix.lower()}")

    tables = copy.deepcopy(tables)
    for kind in LISTS:
        for thing in tables.get(kind, []):
            thing |= {key: own(thing[key]) for key in ("texture",) if key in thing}
    setting = tables.get("scene", {})
    setting |= {key: own(setting[key]) for key in ("environment",) if key in setting}
    return tables, {name: file for file, name in names.items()}
