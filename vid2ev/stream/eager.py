"""What is written, on its way to the disk while more is made."""

from __future__ import annotations

import ctypes
import sys
from typing import IO

ENOUGH = 1 << 23  # bytes that are written before the disk begins with them
BEGIN = 2  # SYNC_FILE_RANGE_WRITE of Linux: begin, and do not wait


class Eager:
    """Lets the disk begin with what is written to a file, so that little is left to wait for at the end.

    `wrote` comes after each write.  Where the system cannot do that (Linux can), nothing happens: it is only sooner.
    """

    def __init__(self) -> None:
        self._begin = getattr(ctypes.CDLL(None), "sync_file_range", None) if sys.platform == "linux" else None
        if self._begin:
            self._begin.argtypes = ctypes.c_int, ctypes.c_int64, ctypes.c_int64, ctypes.c_uint
        self._waiting = 0

    def wrote(self, file: IO[bytes], size: int) -> None:
        """`size` more bytes were written to the file."""
        self._waiting += size
        if self._begin and self._waiting >= ENOUGH:
            self._waiting = 0
            file.flush()
            self._begin(file.fileno(), 0, 0, BEGIN)  # (from the first byte to the last)
