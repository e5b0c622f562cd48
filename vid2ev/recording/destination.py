"""Where what is made is put when it is whole, and where it is kept until then; checked before anything is made."""

from __future__ import annotations

import os
from pathlib import Path

from vid2ev.errors import DataError, UsageError
from vid2ev.recording.held import LOCK
from vid2ev.untrusted import possible


def partial_of(path: Path) -> Path:
    """Where a folder or a file is kept while it is made."""
    return path.parent / f"{path.name}.partial"


def check_destination(path: Path) -> None:
    """Raise UsageError for a link and for a place that nothing can be renamed to, DataError within a file and for a
    name that no file can have; touches nothing."""
    if not possible(str(path)):
        raise DataError(f"{str(path)[:80]!r}: File name too long; give one that a folder can have with -o")
    if path.name in ("", "..") or path.is_mount() or os.path.realpath(path) == os.getcwd():
        raise UsageError(f"{path} cannot be renamed into place; give a folder within it, such as {path / 'events'}")
    _check_link(path)
    _check_above(path)


def check_folder(folder: Path) -> None:
    """`check_destination` of what becomes a folder, for which a file is in the way."""
    check_destination(folder)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; choose a folder with -o")


def check_place(path: Path) -> None:
    """Raise UsageError where something else than a file, and no folder, would be replaced by one: a link, a pipe or a
    device."""
    _check_link(path)
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise UsageError(f"{path} is no file but a pipe or a device, which one would replace; give another place")


def check_new(path: Path, overwrite: bool) -> None:
    """Raise UsageError where a file would have to be replaced, or something else, DataError where it cannot be
    written."""
    check_place(path)
    if path.is_dir() or (path.exists() and not overwrite):
        remedy = "give a file's name" if path.is_dir() else "--overwrite replaces it"
        raise UsageError(f"{path} exists; {remedy}")
    above = _check_above(path)
    if not os.access(above, os.W_OK | os.X_OK):
        raise DataError(f"{path} cannot be written: {above} may not be written to; choose another place")


def _check_link(path: Path) -> None:
    if path.is_symlink():
        raise UsageError(f"{path} is a link, which would be replaced; give what it leads to, or another place")


def _check_above(path: Path) -> Path:
    above = next(each for each in path.absolute().parents if os.path.exists(each))
    if not os.path.isdir(above):
        raise DataError(f"{path} cannot be written: {above} is a file; choose another place")
    return above


def check_apart(source: str | Path, output: Path) -> None:
    """Raise UsageError where what is made would take the place of a file or folder that it is made of."""
    made, of = (Path(os.path.realpath(path)) for path in (output, source))  # (of links in a ring, Path's raises)
    if os.path.exists(source) and made in (of, *of.parents):
        raise UsageError(f"{output} holds what it is to be made of, {source}; choose another place with -o")


def begun_at(path: Path) -> set[str]:
    """The names of what is there of something that was begun.  Raises UsageError where others have that folder."""
    partial = partial_of(path)
    begun = {each.name for each in partial.iterdir()} if partial.is_dir() else set()
    if begun and not begun & {"job.json", LOCK}:
        raise UsageError(f"{partial} is needed to work in, and holds other files; choose another folder with -o")
    return begun
