"""A file that is on its way to the disk while more of it is made."""

from __future__ import annotations

import ctypes
import functools
import io
import sys
from collections.abc import Callable
from typing import Any

ENOUGH = 1 << 23  # bytes that are written before the disk begins with them
WRITE = 2  # SYNC_FILE_RANGE_WRITE of Linux: begin, and do not wait


class EagerFile(io.FileIO):
    """A file whose bytes the disk begins with soon after they are written, so that little is left to wait for when it
    is brought there.  Where the system cannot do that (Linux can), it is as any other."""

    _waiting = 0

    def write(self, data: Any) -> int:
        written = super().write(data)
        self._waiting += written
        if self._waiting >= ENOUGH and (begin := beginner()):
            self._waiting = 0
            begin(self.fileno(), 0, 0, WRITE)  # (from the first byte to the last)
        return written


@functools.cache
def beginner() -> Callable[[int, int, int, int], int] | None:
    """The system's call that lets the disk begin with a stretch of a file; None if it has none."""
    begin = getattr(ctypes.CDLL(None), "sync_file_range", None) if sys.platform == "linux" else None
    if begin:
        begin.argtypes = ctypes.c_int, ctypes.c_int64, ctypes.c_int64, ctypes.c_uint
    return begin
