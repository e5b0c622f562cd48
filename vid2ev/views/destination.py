"""Where pictures go: a film (.mp4), a picture (.png) or a folder; checked before anything is made."""

from __future__ import annotations

from pathlib import Path

from vid2ev.errors import UsageError
from vid2ev.recording.destination import check_folder, check_place
from vid2ev.views.on_disk import SLICES


def kind_of(output: Path) -> str:
    """mp4, png or folder; raises UsageError for a name that says none of these."""
    suffix = output.suffix.lower()
    if output.is_dir() or not suffix:
        return "folder"
    if suffix not in (".mp4", ".png"):
        raise UsageError(f"{output}: '{suffix}' cannot be made; expected .mp4, .png, or a folder's name without a dot")
    return suffix[1:]


def check_free(output: Path, overwrite: bool = False) -> None:
    """Raise UsageError unless pictures may be written to `output`; touches nothing."""
    if kind_of(output) == "folder":
        _check_replaceable(output)
        taken = output.exists() and any(output.iterdir()) if output.is_dir() else output.exists()
    else:
        check_place(output)
        taken = output.exists()
    if taken and not overwrite:
        raise UsageError(f"{output} exists; --overwrite replaces it, -o chooses another name")


def _check_replaceable(folder: Path) -> None:
    check_folder(folder)
    held = {path.name for path in folder.iterdir()} if folder.exists() else set()
    others = {name for name in held if name != SLICES and not (name.endswith(".png") and name[:-4].isdigit())}
    if others:
        raise UsageError(f"{folder} holds other files ({min(others)}); choose another folder with -o")
