"""Stamps of files: what becomes another when a file is written again, so that what was read of it is read anew.

A stamp costs a look at the disk and no reading: names, sizes and times of change, those of all files in a folder.  What
has to be known again on another machine has an identity instead (`recording.manifest`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

Mark = tuple[str, int, int, int]
Stamp = tuple[Mark, ...]


def stamp(*paths: str | Path) -> Stamp:
    """The stamp of files and folders; nothing for what is neither, such as the name of what comes along."""
    return tuple(mark for path in paths for mark in _marks(os.fspath(path)))


def _marks(path: str) -> Iterator[Mark]:
    yield from _mark(path, path)
    try:
        names = sorted(os.listdir(path)) if os.path.isdir(path) else []
    except (OSError, ValueError):  # (whoever reads it says so)
        return
    for name in names:
        yield from _mark(name, os.path.join(path, name))


def _mark(name: str, path: str) -> Iterator[Mark]:
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # (it is gone by now, or its name can be that of no file)
        return
    yield name, found.st_ino, found.st_size, found.st_mtime_ns
