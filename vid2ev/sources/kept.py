"""`Kept`: a stream of bytes that passes once, such as standard input, kept for as long as it may be read again.

What is read of it goes into memory, and beyond `IN_MEMORY` into a file that has no name and vanishes with the process,
however that ends; where such files are, TMPDIR says.
"""

from __future__ import annotations

import threading
import weakref
from tempfile import SpooledTemporaryFile, gettempdir
from typing import Protocol

from vid2ev.errors import DataError, UsageError

IN_MEMORY = 1 << 26  # bytes


class Bytes(Protocol):
    """A stream of bytes."""

    def read(self, size: int, /) -> bytes:
        """The next bytes, at most `size`; none at the end."""


class Kept:
    """The bytes of a stream, from its first one on for every reader.  Readers may be in different threads.

    name    what a person calls the stream
    wanted  whether it may be read again; where it may not, all that was kept goes as soon as a reader is beyond it
    size    bytes that were read so far
    """

    def __init__(self, stream: Bytes, name: str):
        self.name, self.wanted, self.size = name, True, 0
        self._stream, self._lock = stream, threading.Lock()
        self._file = SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115 (closed by `_drop`)
        self._drop = weakref.finalize(self, self._file.close)

    def reader(self, remembers: int = 0) -> Reader:
        """The stream from its beginning; it remembers so many of the last bytes that it has read.  Raises UsageError if
        that is not kept any more."""
        self._still()
        return Reader(self, remembers)

    def at(self, place: int, size: int) -> bytes:
        """At most `size` bytes from a place on, which is not beyond what was read so far.

        Raises DataError if they cannot be kept, UsageError if they are not kept any more.
        """
        with self._lock:
            if place < self.size:
                self._still()
                self._file.seek(place)
                return self._file.read(size)
            new = self._stream.read(size)
            self.size += len(new)
            if not self.wanted:
                self._drop()
            elif self._drop.alive:
                self._keep(new)
            return new

    def _still(self) -> None:
        if not self._drop.alive:
            raise UsageError(f"{self.name}: can be read once only; save it as a file to read it again")

    def _keep(self, new: bytes) -> None:
        try:
            self._file.seek(0, 2)
            self._file.write(new)
        except OSError as error:
            raise DataError(
                f"{self.name}: {self.size:,} bytes do not fit into {gettempdir()}, where they are kept to be read again"
                f" ({error.strerror}); set TMPDIR to where there is room, or give a file"
            ) from error


class Reader:
    """One reading of a stream that is kept."""

    def __init__(self, kept: Kept, remembers: int = 0):
        self._kept, self._place, self._remembers = kept, 0, remembers
        self.tail = b""

    def read(self, size: int) -> bytes:
        """The next bytes, at most `size`; none at the end."""
        found = self._kept.at(self._place, size)
        self._place += len(found)
        if self._remembers:
            self.tail = (self.tail + found)[-self._remembers :]
        return found
