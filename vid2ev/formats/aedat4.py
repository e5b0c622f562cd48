"""AEDAT4: the files of iniVation's DV, dv-processing and jAER; events, and frames beside them.

    #!AER-DAT4.0 CR LF
    header   IOHE: how packets are compressed, where the table of packets is (-1: nowhere), and as XML what the streams
             are: number, kind (EVTS, FRME; others are passed over), size in pixels, camera
    packets  int32 stream, int32 size [bytes], and compressed (LZ4 or Zstandard frame) EVTS or FRME:
             EVTS   a vector of int64 t [us], int16 x, int16 y, uint8 p, 3 bytes nothing; y = 0 is top
             FRME   int64 t [us] (of cameras the middle of the exposure), size, format (OpenCV's type: grey, BGR,
                    BGRA), pixels
    table    FTAB: for each packet its place, size, number of events, first and last time [us]

Header, packets and table are FlatBuffers with their size in front (`flatbuffers.py`); the table is compressed as
packets are.  Times are absolute; the instant from which a recording counts is metadata of its own (`startUs`) in the
stream of events, and where that is missing the time of the first event.  The table repeats what the packets say, and is
not read: a recording whose camera was unplugged has none.

Source: https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-4.0.html, and files written by
dv-processing 2.0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree import ElementTree

import numpy as np

from vid2ev.errors import DataError, read_as
from vid2ev.formats.aedat4_writer import EVENT, MAGIC, PACKET, START, write_events
from vid2ev.formats.event_file import PACKETS, Format, Picture, regrouped
from vid2ev.formats.flatbuffers import Table
from vid2ev.formats.sequential import Sequential
from vid2ev.stream.events import Events

LARGEST = 1 << 28  # bytes of a packet; those of cameras have less than a megabyte
PART = 1 << 20  # bytes decompressed at a time
COMPRESSIONS = ("none", "lz4", "lz4", "zstd", "zstd")
CHANNELS = {1: "grey", 3: "BGR", 4: "BGRA"}


@dataclass
class _Stream:
    """What the header says of a stream."""

    number: int
    kind: str = ""
    about: dict[str, str] = field(default_factory=dict)


class Aedat4Events(Sequential):
    """The events and frames of an AEDAT4 file.

    Raises DataError for a file that is not there, has no stream of events, or is damaged.
    """

    def __init__(self, path: Path):
        super().__init__(path)
        with self._opened() as file:
            self._compression, self._table_at, streams = _header(file)
            self._packets_at = file.tell()
        events = [stream for stream in streams if stream.kind == "EVTS"]
        if not events:
            raise DataError(f"{path} has no stream of events; expected an AEDAT4 file with one")
        if len(events) > 1:
            self.warnings.append(f"{path} has {len(events)} streams of events; only the first is read")
        self._events, about = events[0].number, events[0].about
        frames = [stream for stream in streams if stream.kind == "FRME"]
        frames = [stream for stream in frames if stream.about.get("source") == about.get("source")] or frames
        self._frames = frames[0].number if frames else None
        self.has_frames = bool(frames)
        self.size = _size(about)
        self._camera = about.get("source")
        start_us = _number(about.get(START))
        first = next(self._raw_events(), None) if start_us is None else None
        self.start_us = int(first["t"][0]) if first is not None else start_us or 0
        self.says_start = start_us is not None

    def describe(self) -> dict[str, Any]:
        """Camera and compression."""
        return {"camera": self._camera, "compression": self._compression}

    def frames(self) -> Iterator[Picture]:
        """The frames; those of more than 8 bits are cut to 8."""
        with self._opened() as file:
            for content in self._packets(file, self._frames):
                yield _picture(content)

    def _decoded(self) -> Iterator[Events]:
        return self._all_inside(regrouped(map(_columns, self._raw_events()), PACKETS))

    def _raw_events(self) -> Iterator[np.ndarray]:
        with self._opened() as file:
            for content in self._packets(file, self._events):
                events = Table.root(content, b"EVTS").vector(0, EVENT)
                if len(events):
                    yield events

    def _packets(self, file: BinaryIO, stream: int | None) -> Iterator[bytes]:
        """What the packets of a stream hold."""
        size = file.seek(0, 2)
        end = min(self._table_at, size) if self._table_at >= 0 else size
        file.seek(self._packets_at)
        decompress = _decompressor(self._compression)
        while (left := end - file.tell()) > 0:
            number, length = PACKET.unpack(_exactly(file, PACKET.size, left))
            if number == stream:
                yield decompress(_exactly(file, length, left - PACKET.size))
            elif 0 <= length <= left - PACKET.size:
                file.seek(length, 1)
            else:
                raise ValueError("a packet leaves the file")
        if self._table_at > size:
            raise ValueError("the table of packets is missing")

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        """The file, open; every way in which it is not one becomes a DataError."""
        with read_as(self.path, "AEDAT4"), open(self.path, "rb") as file:
            yield file


def _header(file: BinaryIO) -> tuple[str, int, list[_Stream]]:
    """Compression, position of the table of packets (-1: none), and the streams in order of their number."""
    size = file.seek(0, 2)
    file.seek(len(MAGIC))
    prefix = _exactly(file, 4, size)
    header = Table.root(prefix + _exactly(file, int.from_bytes(prefix, "little"), size), b"IOHE")
    compression = header.scalar(0, "i")
    if not 0 <= compression < len(COMPRESSIONS):
        raise ValueError(f"compression {compression}")
    try:
        root = ElementTree.fromstring(header.vector(2, np.dtype("u1")).tobytes())
    except ElementTree.ParseError as error:
        raise ValueError("the description of the streams is no XML") from error
    streams = []
    for node in root.iterfind("node[@name='outInfo']/node"):
        number, about = _number(node.get("name")), _attributes(node) | _attributes(node.find("node[@name='info']"))
        if number is not None:
            streams.append(_Stream(number, about.get("typeIdentifier", ""), about))
    return COMPRESSIONS[compression], header.scalar(1, "q", -1), sorted(streams, key=lambda stream: stream.number)


def _attributes(node: ElementTree.Element | None) -> dict[str, str]:
    return {} if node is None else {attr.get("key", ""): attr.text or "" for attr in node.iterfind("attr")}


def _number(text: str | None) -> int | None:
    """A number of 64 bits, if the text is one."""
    try:
        number = int(text or "")
    except ValueError:
        return None
    return number if -(1 << 63) <= number < 1 << 63 else None


def _size(about: dict[str, str]) -> tuple[int, int] | None:
    width, height = (_number(about.get(key)) or 0 for key in ("sizeX", "sizeY"))
    return (width, height) if 0 < width <= 1 << 15 and 0 < height <= 1 << 15 else None


def _exactly(file: BinaryIO, length: int, left: int) -> bytes:
    if not 0 <= length <= min(left, LARGEST):
        raise ValueError("a packet leaves the file")
    return file.read(length)


def _decompressor(compression: str) -> Callable[[bytes], bytes]:
    """What makes a packet readable; raises ValueError where that cannot be done, or gives more than `LARGEST` bytes."""
    if compression == "none":
        return lambda content: content
    new: Callable[[], Any]
    failures: tuple[type[Exception], ...] = (RuntimeError, EOFError)
    if compression == "lz4":
        import lz4.frame

        new = lz4.frame.LZ4FrameDecompressor
    else:
        from backports import zstd

        new, failures = zstd.ZstdDecompressor, (zstd.ZstdError, EOFError)

    def decompress(content: bytes) -> bytes:
        decompressor = new()
        parts: list[bytes] = []
        try:
            while not decompressor.eof and len(parts) < LARGEST // PART:
                parts.append(decompressor.decompress(b"" if parts else content, PART))
                if decompressor.needs_input:
                    break
        except failures as error:
            raise ValueError("a packet cannot be decompressed") from error
        if not decompressor.eof:
            raise ValueError("a packet is not whole")
        return parts[0] if len(parts) == 1 else b"".join(parts)

    return decompress


def _columns(events: np.ndarray) -> Events:
    x, y = (events[name].astype(np.uint16) for name in "xy")
    return Events(events["t"].astype(np.int64), x, y, (events["p"] != 0).view(np.uint8))


def _picture(content: bytes) -> Picture:
    frame = Table.root(content, b"FRME")
    kind, width, height = frame.scalar(5, "b"), frame.scalar(6, "h"), frame.scalar(7, "h")
    depth, channels = np.dtype({0: "u1", 2: "<u2"}.get(kind & 7, "V4")), (kind >> 3) + 1
    pixels = frame.vector(10, np.dtype("u1"))
    if width < 1 or height < 1 or pixels.size != width * height * channels * depth.itemsize:
        raise ValueError("a frame of another size than its header says")
    if channels not in CHANNELS or depth.kind != "u":
        raise ValueError(f"frames of OpenCV's type {kind}")
    pixels = pixels.view(depth).reshape(height, width, channels)
    pixels = pixels if depth.itemsize == 1 else (pixels >> 8).astype(np.uint8)
    return Picture(frame.scalar(0, "q"), pixels[..., 0] if channels == 1 else pixels[..., 2::-1])


FORMAT = Format(
    "aedat4",
    "AEDAT4, of iniVation's DV",
    ".aedat4",
    recognises=lambda head, path: head.startswith(b"#!AER-DAT4."),
    open=Aedat4Events,
    write=write_events,
    largest=((1 << 15) - 1, (1 << 15) - 1),  # (as the frames beside events, whose sides are int16)
    keeps=frozenset({"frames", "size", "start"}),
)
