"""HDF5 files as such: opened so that damage is an error in one sentence, written so that a full disk is one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vid2ev.errors import DataError, read_as
from vid2ev.formats.eager import EagerFile
from vid2ev.terminal import counted
from vid2ev.untrusted import check_bytes

if TYPE_CHECKING:
    import h5py

MAGIC = b"\x89HDF\r\n\x1a\n"
# gzip, shuffle, Fletcher-32, bzip2, LZF, Blosc, LZ4, bitshuffle, Zstandard: others may trust what they unpack
FILTERS = {1: 0, 2: 0, 3: 0, 307: 0, 32000: 0, 32001: 4, 32004: 0, 32008: 3, 32015: 0}  # -> numbers that each reads


MOST_LINKS = 16  # from one to the next, as HDF5 itself follows them


@contextmanager
def opened(path: Path, check: Callable[[h5py.File, Path], None]) -> Iterator[h5py.File]:
    """The file, open and checked; every way in which it is not one becomes a DataError."""
    import h5py
    import hdf5plugin  # noqa: F401  (registers the filters)

    stumbles = (OSError, RuntimeError, KeyError, ValueError, TypeError)
    with read_as(path, "events", stumbles), h5py.File(path, "r") as file:
        check(file, path)
        yield file


def holds_table(path: Path) -> bool:
    """Whether `events` is one dataset, as v2e writes it; a file that cannot be opened holds none."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return not _leads_out(file, "events") and isinstance(file.get("events"), h5py.Dataset)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError):
        return False


def check_links(file: h5py.File, path: Path, names: Iterable[str]) -> None:
    """Raise DataError where one of these names leads into another file: that may be one of which an opening waits for
    ever, such as a pipe, so it is not opened."""
    if outside := [name for name in names if _leads_out(file, name)]:
        raise DataError(f"{path}: {outside[0]} is in another file; expected one file, so copy it into this (h5repack)")


def _leads_out(file: h5py.File, name: str, links: int = MOST_LINKS) -> bool:
    """Whether a name leads into another file, also by links within the file, of which there may be so many."""
    import h5py

    group = file["/"]
    parts = [part for part in name.split("/") if part not in ("", ".")]
    for number, part in enumerate(parts, 1):
        there = group.id.links
        if not there.exists(part.encode()):
            return False
        kind = there.get_info(part.encode()).type
        if kind == h5py.h5l.TYPE_SOFT:
            target = there.get_val(part.encode()).decode()
            begin = "" if target.startswith("/") else f"{group.name}/"
            return links == 0 or _leads_out(file, "/".join([f"{begin}{target}", *parts[number:]]), links - 1)
        if kind != h5py.h5l.TYPE_HARD:
            return True
        if not isinstance(group := group[part], h5py.Group):
            return False
    return False


def is_inside(dataset: h5py.Dataset, path: Path) -> bool:
    """Whether a dataset is in the file itself: links and virtual datasets can name any file that there is."""
    return not (dataset.is_virtual or dataset.external) and Path(dataset.file.filename) == path


def check_chunks(dataset: h5py.Dataset, path: Path) -> None:
    """Raise DataError where a part that is unpacked at a time is too large, or packed in a way that is not safe."""
    packed = dataset.id.get_create_plist()
    for number in range(packed.get_nfilters()):
        code, _, values, _ = packed.get_filter(number)
        if len(values) < FILTERS.get(code, math.inf):
            raise DataError(
                f"{path}: {dataset.name} is packed by HDF5's filter {code} with {counted(len(values), 'number')}, which"
                " is not read; get another copy, or pack it with gzip, Blosc or Zstandard (h5repack)"
            )
    check_bytes(path, math.prod(dataset.chunks or ()) * dataset.dtype.itemsize, f"a chunk of {dataset.name}")


def is_whole(dataset: h5py.Dataset) -> bool:
    """Whether the file holds all of a dataset; what is missing would read as zeros, however much that is."""
    if dataset.chunks:
        return dataset.id.get_num_chunks() * math.prod(dataset.chunks) >= dataset.size
    return dataset.id.get_storage_size() >= dataset.size * dataset.dtype.itemsize


class WholeFile(EagerFile):
    """A file that takes all it is given, and says at the end if the disk did not.

    HDF5 cannot close a file when the disk is full (the process ends in a crash); so it is never told.
    """

    failure: OSError | None = None

    def __init__(self, path: Path):
        super().__init__(path, "w+")

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left and not self.failure:
                left = left[super().write(left) :]
        except OSError as error:
            self.failure = error
        return size

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.failure = self.failure or error
            return size or 0

    def check(self) -> None:
        """Raise what went wrong."""
        if self.failure:
            raise self.failure

    def close(self) -> None:
        super().close()
        self.check()
