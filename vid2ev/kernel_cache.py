"""Compiled kernels on disk are dropped when any of their sources has changed, and two processes never mix theirs up.

numba keeps compiled code beside the file of the cached function and looks only at that file's date; the laws that a
kernel calls are in other files.  So the dates of all of them are stamped into one file, and a new stamp empties the
caches.

numba also numbers the files of a function's variants 1, 2, ...: two processes that compile different variants at the
same time both write number 1, and whoever reads the index then runs the wrong code.  A process's own mark in the
names keeps them apart; the variant whose place in the index is lost that way is compiled again.
"""

from __future__ import annotations

import contextlib
import hashlib
import uuid
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile

_HERE = Path(__file__).parent
_COMPILED = ("physics", "kernels", "scenes/rays", "scenes/rays/cuda", "stream")
_MARK = uuid.uuid4().hex[:8]


_save = IndexDataCacheFile.save


def mark_our_kernels() -> None:
    """Let this process's compiled kernels have names that no other process writes; where they cannot be written, as on
    a full disk, they are compiled again the next time."""
    IndexDataCacheFile._data_name = lambda cache, number: f"{Path(cache._index_name).stem}.{_MARK}.{number}.nbc"  # type: ignore[method-assign]
    IndexDataCacheFile.save = _save_if_possible  # type: ignore[method-assign]


def _save_if_possible(cache: IndexDataCacheFile, key: Any, data: Any) -> None:
    with contextlib.suppress(OSError):
        _save(cache, key, data)


def drop_stale_kernels() -> None:
    """Delete the cached kernels if the sources are not those that they were compiled from; never fails."""
    folders = [_HERE / name for name in _COMPILED]
    sources = sorted([*_HERE.glob("kernel_*.py"), *(path for folder in folders for path in folder.glob("*.py"))])
    dates = [(str(path), path.stat().st_mtime_ns, path.stat().st_size) for path in sources]
    stamp = hashlib.sha256(repr(dates).encode()).hexdigest()
    stamp_file = _HERE / _COMPILED[0] / "__pycache__" / "kernels.stamp"
    # A folder that cannot be written is not one in which sources change: numba then keeps its cache elsewhere.
    with contextlib.suppress(OSError):
        if stamp_file.exists() and stamp_file.read_text() == stamp:
            return
        for folder in folders:
            for cached in (*folder.glob("__pycache__/*.nbi"), *folder.glob("__pycache__/*.nbc")):
                cached.unlink(missing_ok=True)
        stamp_file.parent.mkdir(exist_ok=True)
        stamp_file.write_text(stamp)
