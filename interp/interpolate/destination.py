"""Where frames go: a film or a folder of pictures, and its manifest; checked before anything is made."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.destination import begun_at, check_destination, check_folder, check_place, partial_of
from vid2ev.recording.manifest import read_manifest
from vid2ev.sources.images import FRAMES

Kind = Literal["mp4", "png", "exr"]


def kind_of(output: Path | None, asked: str | None) -> Kind:
    """What is made: as asked, or as the name says.  Raises UsageError if both differ."""
    suffix = "" if output is None or output.is_dir() else output.suffix.lower()
    if asked is None and suffix not in ("", ".mp4"):
        raise UsageError(
            f"{output}: '{suffix}' cannot be made; expected .mp4, or a folder's name without a dot, or --format png"
        )
    if asked is None:
        return "mp4" if output is None or suffix else "png"
    if asked not in ("mp4", "png", "exr") or (output is not None and (asked == "mp4") != (suffix == ".mp4")):
        wanted = "a name that ends in .mp4" if asked == "mp4" else "the name of a folder"
        raise UsageError(f"format {asked} to {output}: expected {wanted}, and mp4, png or exr")
    return asked  # type: ignore[return-value]


def manifest_of(output: Path, kind: str) -> Path:
    """Where the manifest of an output is."""
    return output.with_suffix(".json") if kind == "mp4" else output / FRAMES


def places_of(output: Path, kind: str) -> tuple[Path, ...]:
    """All that is written for an output, while it is made and in the end."""
    return output, partial_of(output), manifest_of(output, kind)


def check_free(output: Path, kind: Kind, overwrite: bool, resume: bool) -> None:
    """Raise UsageError unless frames may be written to `output`, DataError for a name that nothing can have and for
    what has no manifest to go on by; touches nothing."""
    beside = manifest_of(output, kind)
    if kind == "mp4":
        check_destination(output)
        check_place(output)
        if os.path.lexists(beside) and not _is_of_film(beside):
            raise UsageError(f"{beside} is to be the film's manifest, and is another file; choose another name with -o")
    else:
        check_folder(output)
        _check_pictures(output)
    begun = "job.json" in begun_at(output)
    if output.exists() and not (overwrite or resume):
        raise UsageError(f"{output} exists; --overwrite replaces it, -o chooses another place")
    if begun and not (overwrite or resume):
        raise UsageError(f"{output} was begun and not finished; --resume continues it, --overwrite starts again")
    if output.exists() and resume and not overwrite and not begun and not beside.exists():
        raise DataError(f"{output} has no manifest to go on by; --overwrite replaces it")


def _check_pictures(folder: Path) -> None:
    """Raise UsageError for a folder with anything but frames and what belongs to them."""
    held = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    ours = {"timestamps.txt", FRAMES}
    if others := [name for name in held - ours if not (name[:-4].isdecimal() and name[-4:] in (".png", ".exr"))]:
        raise UsageError(f"{folder} holds other files ({min(others)}); choose another folder with -o")


def _is_of_film(path: Path) -> bool:
    """Whether it is a manifest of ours, of frames."""
    try:
        return path.is_file() and "film_rate" in read_manifest(path)
    except DataError:
        return False
