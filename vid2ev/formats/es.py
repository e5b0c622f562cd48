"""Event Stream, .es (read only).

    "Event Stream"   12 bytes
    version          3 bytes; this is version 2
    type             1 byte: 1 DVS, 2 ATIS (0 generic and 4 colour are not read)
    width, height    uint16 each, little-endian

    DVS   time since the event before [7:1], ON [0]; column uint16; row uint16.  FF: 127 us pass, FE: nothing
    ATIS  time [7:2], ON [1], exposure measurement [0]; column; row.  FD, FE, FF: 63, 126, 189 us pass

Rows count from the bottom; here they are turned to count from the top.  ATIS's exposure measurements are passed over.
Source: https://github.com/neuromorphic-paris/event_stream
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import Format
from vid2ev.formats.sequential import Sequential, pieces, reading
from vid2ev.stream.events import Events

MAGIC = b"Event Stream"
HEADER = struct.Struct("<12s3BBHH")
TYPES = {1: "DVS", 2: "ATIS"}
TIME, OUTSIDE, EXPOSURES = range(3)  # of the state


class EsEvents(Sequential):
    """The events of an Event Stream.  Raises DataError for a file that is none, or has none of a sensor."""

    def __init__(self, path: Path):
        super().__init__(path)
        with reading(path) as file:
            head = file.read(HEADER.size)
        if len(head) < HEADER.size or not head.startswith(MAGIC):
            raise DataError(f"{path} does not begin as an Event Stream does; expected one that is whole")
        _, *version, kind, width, height = HEADER.unpack(head)
        if version[0] != 2 or kind not in TYPES:
            raise DataError(f"{path} is Event Stream {version[0]}, type {kind}; expected version 2 with DVS or ATIS")
        self.size, self._kind, self._version = (width, height), TYPES[kind], ".".join(map(str, version))

    def describe(self) -> dict[str, Any]:
        """Version and type."""
        return {"version": self._version, "type": self._kind}

    def _decoded(self) -> Iterator[Events]:
        from vid2ev.formats import es_bytes

        decode: Callable = es_bytes.decode_dvs if self._kind == "DVS" else es_bytes.decode_atis
        width, height = self.size or (0, 0)
        state, rest = np.zeros(3, np.int64), np.empty(0, np.uint8)
        with reading(self.path) as file:
            file.seek(HEADER.size)
            for piece in pieces(file, np.uint8):
                data = np.concatenate([rest, piece])
                count = len(data) // es_bytes.EVENT + 1
                t, x, y, p = (np.empty(count, dtype) for dtype in (np.int64, np.uint16, np.uint16, np.uint8))
                used, found = decode(state, data, width, height, t, x, y, p)
                rest = data[used:]
                yield Events(t[:found], x[:found], y[:found], p[:found])
        self._leave_out(int(state[OUTSIDE]), f"{self._outside} are")
        self._leave_out(int(state[EXPOSURES]), "exposure measurements are")
        self._leave_out(len(rest), "bytes at the end, where the file is cut within an event, are")


FORMAT = Format(
    "es",
    "Event Stream",
    ".es",
    recognises=lambda head, path: head.startswith(MAGIC),
    open=EsEvents,
    keeps=frozenset({"size"}),
)
