"""Compiled functions on disk are made again when a source of theirs has changed, and processes never mix theirs up.

numba keeps compiled code beside the file of the cached function and looks only at that file's date; the laws that a
kernel calls, and the numbers that any function takes from other files, are in others.  So a function is of one version
of all files beside its own, and of those that all kernels are made of if it is one (`KERNELS`); and where these have
changed, what was compiled of them is deleted.

numba also numbers the files of a function's variants 1, 2, ...: two processes that compile different variants at the
same time both write number 1, and whoever reads the index then runs the wrong code.  A process's own mark in the
names keeps them apart; the variant whose place in the index is lost that way is compiled again.  So is one whose files
are damaged, as after a power failure, where numba would end with what pickle says of them.

numba looks for a folder that can be written: that of NUMBA_CACHE_DIR, the file's own, one in the user's home.  Where
none can, as for a user without a home in an image that is only read, it would refuse to begin; here it keeps what it
compiles for as long as the program runs (`ForThisRun`).
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numba import config, njit
from numba.core.caching import CacheImpl, IndexDataCacheFile, UserProvidedCacheLocator, UserWideCacheLocator

_HERE = Path(__file__).parent
_PACKAGE = _HERE.parent
_CONFIG: Any = config  # (whose attributes are set as numba is imported)
KERNELS = ("physics", "kernels", "scenes/rays", "scenes/rays/cuda", "bounds", "stream", "pictures")
COLOURS = ("pictures",)  # of which functions of many rooms take numbers
_MARK = uuid.uuid4().hex[:8]


_save, _load_index, _load_data = IndexDataCacheFile.save, IndexDataCacheFile._load_index, IndexDataCacheFile._load_data


class InHome(UserWideCacheLocator):  # type: ignore[misc]
    """numba's folder in the user's home; none where nobody knows where that is, and numba would make one called ~."""

    def ensure_cache_path(self) -> None:
        if not os.path.isabs(self.get_cache_path()):
            raise FileNotFoundError("no home")
        super().ensure_cache_path()


class ForThisRun(UserProvidedCacheLocator):  # type: ignore[misc]
    """The last folder that is looked for: one that ends with this process, and that those which it begins find by
    NUMBA_CACHE_DIR.  Where there can be none either, each process compiles for itself."""

    _folder: TemporaryDirectory[str] | None = None

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> Any:
        with contextlib.suppress(OSError):
            ForThisRun._folder = TemporaryDirectory(prefix="vid2ev_", ignore_cleanup_errors=True)
            _CONFIG.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = ForThisRun._folder.name
        _CONFIG.CACHE_DIR = _CONFIG.CACHE_DIR or os.devnull  # (in which no folder is, nor can be)
        return super().from_function(py_func, py_file)

    def ensure_cache_path(self) -> None:
        with contextlib.suppress(OSError):
            super().ensure_cache_path()


def cached(function: Callable) -> Any:
    """A function of arrays: compiled when it is first called, cached, and without the lock of the interpreter."""
    return cached_with()(function)


def cached_with(**options: Any) -> Callable[[Callable], Any]:
    """The same, by more of numba's options."""
    compiled = njit(cache=True, nogil=True, error_model="numpy", **options)
    return lambda function: of_this_version(compiled(function), COLOURS)


def of_this_version(dispatcher: Any, rooms: Iterable[str] = KERNELS) -> Any:
    """A cached function; what was compiled of other files in these rooms, or its own, is compiled again."""
    own = Path(dispatcher.py_func.__code__.co_filename).parent
    dispatcher._cache._cache_file._source_stamp = _versions(own, *(_PACKAGE / room for room in rooms))
    return dispatcher


@functools.cache
def _versions(*rooms: Path) -> tuple[tuple[str, int, int], ...]:
    """Names, times and sizes of the files in rooms, and of what compiles them."""
    files = {*_HERE.glob("*.py"), *(file for room in rooms for file in room.glob("*.py"))}
    return tuple(
        sorted((f"{file.parent.name}/{file.name}", (stat := file.stat()).st_mtime_ns, stat.st_size) for file in files)
    )


def _mark_ours() -> None:
    """Let what this process compiles have names that no other process writes; where it cannot be written, as on a full
    disk, or is not whole, it is compiled again the next time."""
    IndexDataCacheFile._data_name = lambda cache, number: f"{Path(cache._index_name).stem}.{_MARK}.{number}.nbc"  # type: ignore[method-assign]
    IndexDataCacheFile.save = _save_if_possible  # type: ignore[method-assign]
    IndexDataCacheFile._load_index = _index_if_whole  # type: ignore[method-assign]
    IndexDataCacheFile._load_data = _data_if_whole  # type: ignore[method-assign]


def _save_if_possible(cache: IndexDataCacheFile, key: Any, data: Any) -> None:
    with contextlib.suppress(OSError):
        _save(cache, key, data)


def _index_if_whole(cache: IndexDataCacheFile) -> dict[Any, str]:
    with contextlib.suppress(Exception):  # (what a damaged pickle raises may be anything)
        return _load_index(cache)  # type: ignore[no-any-return]
    return {}


def _data_if_whole(cache: IndexDataCacheFile, name: str) -> Any:
    try:
        return _load_data(cache, name)
    except Exception as error:
        raise OSError(f"{name} is damaged") from error  # (as numba takes what is not there)


def drop_stale_kernels() -> None:
    """Delete the cached kernels if the sources are not those that they were compiled from; never fails."""
    folders = [_PACKAGE / room for room in KERNELS]
    stamp = hashlib.sha256(repr(_versions(*folders)).encode()).hexdigest().encode()
    stamp_file = _PACKAGE / KERNELS[0] / "__pycache__" / "kernels.stamp"
    # A folder that cannot be written is not one in which sources change: numba then keeps its cache elsewhere.
    with contextlib.suppress(OSError):
        if stamp_file.exists() and stamp_file.read_bytes() == stamp:
            return
        for folder in folders:
            for cached in (*folder.glob("__pycache__/*.nbi"), *folder.glob("__pycache__/*.nbc")):
                cached.unlink(missing_ok=True)
        stamp_file.parent.mkdir(exist_ok=True)
        stamp_file.write_bytes(stamp)


_mark_ours()
CacheImpl._locator_classes = [
    *(InHome if each is UserWideCacheLocator else each for each in CacheImpl._locator_classes), ForThisRun
]  # fmt: skip
