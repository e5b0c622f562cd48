"""The writer of AEDAT4 (`aedat4.py` has the layout of the file, `flatbuffers.py` that of what is in it).

All offsets below are laid out once, with numbers aligned to their size from the start of the buffer as FlatBuffers
asks; only counts, times and sizes change from packet to packet.  Packets are LZ4 frames of at most `EVENTS` events;
Zstandard makes them a third smaller, takes twice the time to write and to read, and not every reader knows it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import BinaryIO
from xml.etree import ElementTree

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.formats.event_file import Picture, Recording, promised

MAGIC = b"#!AER-DAT4.0\r\n"
EVENT = np.dtype(
    {"names": list("txyp"), "formats": ["<i8", "<i2", "<i2", "u1"], "offsets": [0, 8, 10, 12], "itemsize": 16}
)
START = "startUs"  # metadata of the stream of events: the instant from which the recording counts
EVENTS = 1 << 14  # events per packet
CAMERA = "vid2ev"
LZ4 = 1
GRAY, BGR = 0, 16

# size, root, name | vtable: size, size of table, field 0 | table: to its vtable, field 0 = vector | number of items
VECTOR = struct.Struct("<II4s 2x3H iI I")
# as above, for five fields: compression, position of the table of packets, text
HEADER = struct.Struct("<II4s 6x5H iiIq 4x I")
TABLE_AT = len(MAGIC) + 40  # in the file, the position of the table of packets
# as above, for eleven fields: pixels, time, start and end of exposure, width, height, format
FRAME = struct.Struct("<II4s 2x13H iIqqqhhb 3x I")
PACKET = struct.Struct("<ii")
# The table of packets has one vtable for all of its rows.
ROW_VTABLE = struct.pack("<7H", 14, 44, 12, 4, 20, 28, 36)
ROW = np.dtype("i4, i4, i4, i8, i8, i8, i8, i4")  # to its vtable, stream, size, place, events, first and last time


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it, ValueError for times out of order, UsageError
    for frames that are no 8-bit pictures."""
    pictures = recording.frames() if recording.frames else iter(())
    first = next(pictures, None)
    with open(path, "wb") as file:
        file.write(_header(recording, None if first is None else first.pixels.shape))
        packets = _Packets(file)
        for part in _by_time(recording, chain(() if first is None else (first,), pictures)):
            packets.add_frame(part) if isinstance(part, Picture) else packets.add_events(part)
        packets.finish()


def _by_time(recording: Recording, pictures: Iterator[Picture]) -> Iterator[np.ndarray | Picture]:
    """The events, as they are stored, and the pictures, each picture after the last event up to its instant, or after
    the picture before it where its time goes back."""
    picture = next(pictures, None)
    for _, block in promised(recording):
        stored = np.zeros(len(block), EVENT)
        for name in "txyp":
            stored[name] = getattr(block, name)
        at = 0
        while picture is not None and picture.t_us < block.t[-1]:
            until = max(at, int(np.searchsorted(block.t, picture.t_us, side="right")))
            yield stored[at:until]
            yield picture
            at, picture = until, next(pictures, None)
        yield stored[at:]
    while picture is not None:
        yield picture
        picture = next(pictures, None)


class _Packets:
    """The packets of a file that is being written, and the table of them at its end."""

    def __init__(self, file: BinaryIO):
        self.file = file
        self.rows: list[tuple[int, ...]] = []

    def add_events(self, events: np.ndarray) -> None:
        for at in range(0, len(events), EVENTS):
            part = events[at : at + EVENTS]
            head = VECTOR.pack(28 + part.nbytes, 16, b"EVTS", 6, 8, 4, 6, 4, len(part))
            self._add(0, head + part.tobytes(), len(part), int(part["t"][0]), int(part["t"][-1]))

    def add_frame(self, picture: Picture) -> None:
        pixels = picture.pixels
        if pixels.dtype != np.uint8 or pixels.shape[2:] not in ((), (3,)) or max(pixels.shape[:2]) >= 1 << 15:
            raise UsageError(
                f"a frame of {pixels.dtype} {pixels.shape}: AEDAT4 takes uint8, gray [H, W] or colour [H, W, 3], of at"
                " most 32767 pixels a side; leave the frames out"
            )
        height, width = pixels.shape[:2]
        kind, pixels = (GRAY, pixels) if pixels.ndim == 2 else (BGR, pixels[..., ::-1])
        vtable = (26, 40, 8, 0, 0, 16, 24, 36, 32, 34, 0, 0, 4)
        t = picture.t_us
        head = FRAME.pack(80 + pixels.size, 36, b"FRME", *vtable, 26, 36, t, t, t, width, height, kind, pixels.size)
        self._add(1, head + pixels.tobytes(), 1, t, t)

    def finish(self) -> None:
        """Write the table of packets, and at the start of the file where it is."""
        rows_at = 32 + 4 * len(self.rows) + len(ROW_VTABLE)
        rows_at += -(rows_at + 4) % 8
        rows = np.zeros(len(self.rows), ROW)
        if self.rows:
            rows[["f1", "f2", "f3", "f4", "f5", "f6"]] = self.rows
        at = rows_at + ROW.itemsize * np.arange(len(rows))
        entries = 32 + 4 * np.arange(len(rows))
        rows["f0"] = at - (32 + 4 * len(rows))
        content = (at - entries).astype("<u4").tobytes() + ROW_VTABLE
        content += bytes(rows_at - 32 - len(content)) + rows.tobytes()
        head = VECTOR.pack(28 + len(content), 16, b"FTAB", 6, 8, 4, 6, 4, len(rows))
        table_at = self.file.tell()
        self.file.write(_compressed(head + content))
        self.file.seek(TABLE_AT)
        self.file.write(struct.pack("<q", table_at))

    def _add(self, stream: int, content: bytes, count: int, first_us: int, last_us: int) -> None:
        stored = _compressed(content)
        self.file.write(PACKET.pack(stream, len(stored)))
        self.rows.append((stream, len(stored), self.file.tell(), count, first_us, last_us))
        self.file.write(stored)


def _compressed(content: bytes) -> bytes:
    import lz4.frame

    return lz4.frame.compress(content)


def _header(recording: Recording, frame: tuple[int, ...] | None) -> bytes:
    """The start of the file: what the streams are."""
    root = ElementTree.Element("dv", version="2.0")
    streams = _node(root, "outInfo", "/outInfo/")
    _stream(streams, 0, "events", "EVTS", recording.size, {START: str(recording.start_us)})
    if frame is not None:
        _stream(streams, 1, "frames", "FRME", (frame[1], frame[0]), {})
    text = ElementTree.tostring(root)
    size = HEADER.size + len(text) + 1
    end = bytes(1 + -size % 8)
    head = HEADER.pack(size + -size % 8 - 4, 24, b"IOHE", 10, 24, 4, 12, 8, 10, LZ4, 16, -1, len(text))
    return MAGIC + head + text + end


def _stream(
    streams: ElementTree.Element, number: int, name: str, kind: str, size: tuple[int, int], more: dict[str, str]
) -> None:
    path = f"/outInfo/{number}/"
    node = _node(streams, str(number), path)
    about = {"compression": "LZ4", "originalModuleName": CAMERA, "originalOutputName": name, "typeIdentifier": kind}
    for key, value in about.items():
        _attribute(node, key, "string", value)
    info = _node(node, "info", f"{path}info/")
    for key, pixels in zip(("sizeX", "sizeY"), size, strict=True):
        _attribute(info, key, "int", str(pixels))
    for key, value in {"source": CAMERA, **more}.items():
        _attribute(info, key, "string", value)


def _node(parent: ElementTree.Element, name: str, path: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, "node", name=name, path=path)


def _attribute(parent: ElementTree.Element, key: str, kind: str, value: str) -> None:
    ElementTree.SubElement(parent, "attr", key=key, type=kind).text = value
