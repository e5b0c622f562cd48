"""Recordings on disk as sequences of frames and events: own ones, HS-ERGB and BS-ERGB.

What a folder is, its content says.  A new layout is a class that satisfies `Sequence`, and a line in `_kind`.
"""

from __future__ import annotations

from pathlib import Path

from interp.data.layouts.ergb import LAYOUTS, STAMPS, Ergb, Names
from interp.data.layouts.own import MANIFEST, Own
from interp.data.layouts.sequence import Placed, Sequence, Windows, windows
from vid2ev.errors import DataError, UsageError
from vid2ev.sources.many import clips_below

__all__ = [
    "Placed",
    "Sequence",
    "Windows",
    "holds_sequences",
    "is_sequence",
    "open_sequence",
    "opened_in",
    "sequences_in",
    "windows",
]

DEEPEST = 5  # folders below the one that is given


def open_sequence(folder: str | Path) -> Sequence:
    """The sequence in a folder.  Raises UsageError for a folder that is none, DataError for one that is damaged."""
    folder = Path(folder)
    kind = _kind(folder)
    if kind is None:
        raise UsageError(
            f"{folder} is no recording; expected one of vid2ev convert, or in the HS-ERGB or BS-ERGB layout"
        )
    return Own(folder) if kind == "own" else Ergb(folder, kind)


def is_sequence(folder: str | Path) -> bool:
    """Whether a path is a folder in one of the layouts, by what is in it."""
    return _kind(Path(folder)) is not None


def holds_sequences(folder: str | Path) -> bool:
    """Whether there are some in a folder or below it, as far as can be told without opening them."""
    return bool(_below(Path(folder), DEEPEST))


def sequences_in(folder: str | Path) -> tuple[list[Path], dict[str, str]]:
    """The folders of sequences in a folder and below it, in order, and those that cannot be used, with the reason.

    Raises UsageError where there are none.
    """
    found, unusable = opened_in(folder)
    return [sequence.folder for sequence in found], unusable


def opened_in(folder: str | Path) -> tuple[list[Sequence], dict[str, str]]:
    """The sequences in a folder and below it, in order, and the folders that cannot be used, with the reason.

    Raises UsageError where there are none, or no folder.
    """
    found, unusable = list[Sequence](), dict[str, str]()
    if not Path(folder).is_dir():
        raise UsageError(
            f"{folder}: no such folder here; expected one with recordings, where it was when a run with it was begun"
        )
    for path in _below(Path(folder), DEEPEST):
        try:
            found.append(open_sequence(path))
        except DataError as error:
            unusable[str(path)] = str(error)
    if not found and not unusable:
        below = clips_below(Path(folder))
        remedy = "expected some of vid2ev, HS-ERGB or BS-ERGB"
        remedy = f"give one of the folders of clips in it, such as {below}" if below else remedy
        raise UsageError(f"{folder}: no recordings in it; {remedy}")
    return found, unusable


def _kind(folder: Path) -> str | None:
    if (folder / MANIFEST).is_file():
        return "own"
    return next((name for name, of in LAYOUTS.items() if _is_of(folder, of)), None)


def _is_of(folder: Path, of: Names) -> bool:
    """Whether a folder is a sequence of a layout, or what is left of one without its events."""
    images = folder / of.images
    return images.is_dir() and ((folder / of.events).is_dir() or (images / STAMPS[0]).is_file())


def _below(folder: Path, depth: int) -> list[Path]:
    if _kind(folder):
        return [folder]
    if depth == 0 or not folder.is_dir():
        return []
    return [found for child in sorted(folder.iterdir()) if child.is_dir() for found in _below(child, depth - 1)]
