"""Files and folders that survive: written as a whole, brought to the disk."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np

from vid2ev.errors import DataError, DiskError, UsageError
from vid2ev.recording.held import Held, undisturbed

THEN_RESUME = "make room or access there, then --resume"  # where there is something to go on with


@contextmanager
def whole_file(path: Path) -> Iterator[IO[bytes]]:
    """A file to write that is there as a whole or not at all, whenever the process or the machine stops."""
    with whole_path(path) as beside, open(beside, "wb") as file:
        yield file


@contextmanager
def whole_path(path: Path) -> Iterator[Path]:
    """`whole_file` for what others write: the path that they write to, which takes the place of `path`."""
    beside = path.with_name(f"{path.name}.new")
    try:
        yield beside
        sync(beside)
        beside.replace(path)
    except BaseException:
        _remove(beside)
        raise
    sync(path.parent)


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A path for a new file or folder, which takes the place of `path` at the end; what goes wrong changes nothing.

    Raises UsageError if another process is at it.
    """
    aside = path.with_name(f"{path.name}.new")
    made, replaced = aside / path.name, aside / "replaced"
    held = Held(aside)
    try:
        held.take()
        _remove(made)
        yield made
        for file in [*made.rglob("*"), made]:
            sync(file)
        put_in_place(made, path, replaced)
        sync(path.absolute().parent)
    finally:
        with undisturbed():  # (Ctrl-C twice leaves nothing, either)
            if held:
                _remove(made)
                _remove(replaced)
                held.close()
            with suppress(OSError):
                aside.rmdir()


@contextmanager
def writing(path: Path, remedy: str = "make room or access there") -> Iterator[None]:
    """What goes wrong with the disk within becomes one sentence: DiskError, with the remedy."""
    try:
        yield
    except (DataError, UsageError):
        raise
    except OSError as error:
        raise DiskError(f"{path} cannot be written: {error.strerror or error}; {remedy}") from error


def sync(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    if os.name == "nt" and path.is_dir():
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_npz(path: Path | IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
    """An npz file; the same arrays give the same bytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy")  # (without a time, which would be another at every run)
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def write_npy(file: IO[bytes], array: np.ndarray) -> None:
    """An array as an npy file.  Raises OSError where the disk does not take it, which says why: numpy, straight into a
    file, does not."""
    content = BytesIO()
    np.lib.format.write_array(content, array, allow_pickle=False)
    with content.getbuffer() as written:
        file.write(written)


def put_in_place(made: Path, path: Path, replaced: Path) -> None:
    """Rename what was made to `path`, and what was there to `replaced`, which is not there.

    At each instant there is one of both at `path`, where the system can exchange names; elsewhere for a moment none.
    """
    if not path.is_dir():
        made.replace(path)
        return
    if _swapped(made, path):
        made.rename(replaced)
        return
    path.rename(replaced)
    try:
        made.rename(path)
    except OSError:
        replaced.rename(path)
        raise


def _swapped(one: Path, other: Path) -> bool:
    """Exchange two names at once; False where the system cannot (Linux can, on most file systems)."""
    if sys.platform != "linux":
        return False
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    here, exchange = -100, 2  # AT_FDCWD, RENAME_EXCHANGE
    return rename is not None and rename(here, os.fsencode(one), here, os.fsencode(other), exchange) == 0


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)
