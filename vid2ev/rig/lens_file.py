"""The lens of a folder of pictures: intrinsics.json there, as `vid2ev scene` and truth write it, with the fields of
`Intrinsics`; or what a recording says of the frame camera whose pictures they are.

Others call files so, too, and mean other things: what is none of ours says nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vid2ev.recording.exposures import KINDS
from vid2ev.rig.camera import Source
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.untrusted import json_of, read_text

LENS = "intrinsics.json"


def write_lens(folder: Path, lens: Intrinsics) -> None:
    """Write the lens of a folder's pictures.  Raises OSError from the disk."""
    (folder / LENS).write_text(lens.model_dump_json(indent=2) + "\n")


def lens_in(folder: Path, size: tuple[int, int]) -> Source | None:
    """The camera that took the pictures of a folder, which have this size; None where nothing, or nothing that fits,
    is said of it: by the folder, or by the recording that has them from one of its cameras."""
    for said_in in (_beside, _of_recording):
        try:
            lens = Intrinsics.model_validate(said_in(folder))
            return Source.of(lens) if lens.size == size else None
        except (OSError, ValueError, LookupError, TypeError):
            continue
    return None


def _beside(folder: Path) -> Any:
    return json_of(read_text(folder / LENS))


def _of_recording(folder: Path) -> Any:
    """What DIR/manifest.json says of the camera of DIR/CAMERA/frames, or raw.  Raises LookupError where that is the
    lens of the video around which the cameras were, and it was guessed how wide that one sees."""
    folder = folder.absolute()  # (one may be in it)
    if folder.name not in (KINDS["raw"], KINDS["png"]):
        raise LookupError
    taker = folder.parent
    rig = json_of(read_text(taker.parent / "manifest.json"))["rig"]
    lens = {camera["name"]: camera["intrinsics"] for camera in rig["cameras"]}[taker.name]
    if rig["source"]["assumed"]:
        guessed = Intrinsics.model_validate({key: rig["source"][key] for key in Intrinsics.model_fields})
        own = Intrinsics.model_validate(lens)
        if own == guessed.scaled_to(own.size):
            raise LookupError
    return lens
