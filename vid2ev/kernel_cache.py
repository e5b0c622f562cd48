"""Compiled kernels on disk are dropped when any of their sources has changed.

numba keeps compiled code beside the file of the cached function and looks only at that file's date; the laws that a
kernel calls are in other files.  So the dates of all of them are stamped into one file, and a new stamp empties the
caches.
"""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

_HERE = Path(__file__).parent
_COMPILED = ("physics", "kernels")


def drop_stale_kernels() -> None:
    """Delete the cached kernels if the sources are not those that they were compiled from; never fails."""
    folders = [_HERE / name for name in _COMPILED]
    sources = sorted(path for folder in folders for path in folder.glob("*.py"))
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
