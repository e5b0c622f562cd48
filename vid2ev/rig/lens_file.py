"""intrinsics.json: the lens of a folder of pictures, as `vid2ev scene` and truth write it: the fields of `Intrinsics`.

Others call files so, too, and mean other things: what is none of ours says nothing.
"""

from __future__ import annotations

from pathlib import Path

from vid2ev.rig.camera import Source
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.untrusted import json_of, read_text

LENS = "intrinsics.json"


def write_lens(folder: Path, lens: Intrinsics) -> None:
    """Write the lens of a folder's pictures.  Raises OSError from the disk."""
    (folder / LENS).write_text(lens.model_dump_json(indent=2) + "\n")


def lens_in(folder: Path, size: tuple[int, int]) -> Source | None:
    """The camera that took the pictures of a folder, which have this size; None where nothing, or nothing that fits,
    is said of it."""
    try:
        lens = Intrinsics.model_validate(json_of(read_text(folder / LENS)))
        return Source.of(lens) if lens.size == size else None
    except (OSError, ValueError):
        return None
