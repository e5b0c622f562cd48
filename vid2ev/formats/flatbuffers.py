"""FlatBuffers, as far as event files need them: fields of tables, read where nothing is to be trusted.

    size    uint32    of what follows
    root    uint32    where the first table is, from here
    name    4 bytes   what the buffer is, such as "EVTS"

    table   int32     how far before it its vtable is; then the fields
    vtable  uint16    its size; size of the table; for each field where it is in the table, 0 if it is not

A field that is a vector or a string holds how far behind it that is: a uint32 with the number of items, then the items.
Source: https://flatbuffers.dev/internals.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

U16, U32, I32 = struct.Struct("<H"), struct.Struct("<I"), struct.Struct("<i")


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a buffer.  All that it answers lies within the buffer; what does not raises ValueError."""

    buffer: bytes
    at: int

    @staticmethod
    def root(buffer: bytes, name: bytes) -> Table:
        """The first table of a buffer of a name, with its size in front."""
        if _read(buffer, 0, U32) + 4 > len(buffer) or buffer[8:12] != name:
            raise ValueError(f"no whole buffer of kind {name.decode()}")
        return Table(buffer, 4 + _read(buffer, 4, U32))

    def scalar(self, field: int, kind: str, default: Any = 0) -> Any:
        """A number, its kind in the letters of `struct`."""
        at = self._place(field)
        return _read(self.buffer, at, struct.Struct(f"<{kind}")) if at else default

    def vector(self, field: int, dtype: np.dtype) -> np.ndarray:
        """An array of numbers or structs; empty if it is not there."""
        at = self._place(field)
        if not at:
            return np.empty(0, dtype)
        at += _read(self.buffer, at, U32)
        count = _read(self.buffer, at, U32)
        if at + 4 + count * dtype.itemsize > len(self.buffer):
            raise ValueError("a vector leaves its buffer")
        return np.frombuffer(self.buffer, dtype, count, at + 4)

    def _place(self, field: int) -> int:
        """Where a field is in the buffer; 0 if it is not there."""
        vtable = self.at - _read(self.buffer, self.at, I32)
        entry = 4 + 2 * field
        if entry >= _read(self.buffer, vtable, U16):
            return 0
        offset = _read(self.buffer, vtable + entry, U16)
        return self.at + offset if offset else 0


def _read(buffer: bytes, at: int, kind: struct.Struct) -> Any:
    if at < 0 or at + kind.size > len(buffer):
        raise ValueError("an offset leaves its buffer")
    return kind.unpack_from(buffer, at)[0]
