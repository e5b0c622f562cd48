"""AEDAT 3.1: the files of iniVation's cAER (DAVIS and DVS cameras of 2016 to 2019, DVS128 Gesture); read, not written.

    #!AER-DAT3.1 CR LF, #Format: RAW, #Source 0: DAVIS240C, #Start-Time: ..., #!END-HEADER, each a line with CR LF
    packets  int16 type, int16 source, int32 size of an event [bytes], where its time is, overflows, capacity,
             number of events, number of valid events; then so many events, little-endian
    type 1   polarity: uint32 [0] valid, [1] p, [2:17] y, [17:32] x; int32 t [us]; y = 0 is top
    type 2   frame: uint32 [0] valid, [1:4] channels; int32 t [us] of the frame's start and end, of the exposure's start
             and end; int32 width, height, x, y; uint16 pixels, their 16 bits all used

    t = overflows * 2^31 + time of the event [us]

Other packets (special, IMU, ...) are passed over, and so are events that a filter of the camera marked as not valid.
A frame's instant is the middle of its exposure, as in libcaer.  Sizes in pixels are not stored; they are those of the
camera.

Source: https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-3.1.html
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from vid2ev.errors import DataError, read_as
from vid2ev.formats.event_file import PACKETS, Format, Picture, regrouped
from vid2ev.formats.sequential import Sequential
from vid2ev.stream.events import Events

PACKET = struct.Struct("<hhiiiiii")
LARGEST = 1 << 28  # bytes of a packet
LINES, LINE = 1000, 4096  # of the header, and bytes of each
START = 1000  # packets among which frames are looked for
POLARITY, FRAME = 1, 2
COMPRESSED = -0x8000  # the highest bit of the type
FRAME_HEAD = np.dtype([("info", "<u4"), ("t", "<i4", 4), ("size", "<i4", 2), ("place", "<i4", 2)])
CAMERAS = {
    "DVS128": (128, 128),
    "DAVIS208": (208, 192),
    "DAVIS240": (240, 180),
    "DAVIS346": (346, 260),
    "DAVIS640": (640, 480),
    "DAVISHET640": (640, 480),
    "DAVISRGB": (640, 480),
    "DVS132S": (132, 104),
}


class Aedat3Events(Sequential):
    """The events and frames of an AEDAT 3.1 file.

    Raises DataError for a file that is not there, is compressed, or is damaged.
    """

    def __init__(self, path: Path):
        super().__init__(path)
        with self._opened() as file:
            self._header = _header(file)
            self._packets_at = file.tell()
            if self._header.get("Format", "RAW") != "RAW":
                raise DataError(f"{path} is stored as {self._header['Format']}; expected RAW, so save it again as that")
            sources = sorted((int(key[7:]), name) for key, name in self._header.items() if key.startswith("Source "))
            self._source = sources[0][0] if len(sources) > 1 else None
            self._camera = sources[0][1] if sources else None
            self.has_frames = next(self._packets(file, FRAME, START), None) is not None
        if len(sources) > 1:
            self.warnings.append(f"{path} has {len(sources)} cameras; only {self._camera}, the first, is read")
        name = re.sub("[^0-9A-Z]", "", (self._camera or "").upper())
        self.size = next((size for camera, size in CAMERAS.items() if name.startswith(camera)), None)

    def describe(self) -> dict[str, Any]:
        """Camera and time of writing."""
        return {"camera": self._camera, "written": self._header.get("Start-Time")}

    def frames(self) -> Iterator[Picture]:
        """The frames, cut to 8 bits."""
        with self._opened() as file:
            for size, overflows, content in self._packets(file, FRAME):
                for at in range(0, len(content), size):
                    yield from _picture(content[at : at + size], overflows)

    def _decoded(self) -> Iterator[Events]:
        return self._all_inside(regrouped(self._polarity(), PACKETS))

    def _polarity(self) -> Iterator[Events]:
        with self._opened() as file:
            for size, overflows, content in self._packets(file, POLARITY):
                if size != 8:
                    raise ValueError(f"events of {size} bytes")
                words = np.frombuffer(content, "<u4").reshape(-1, 2)
                data, t = words[:, 0], words[:, 1].view(np.int32).astype(np.int64)
                if len(t) and t.min() < 0:
                    raise ValueError("a time below 0")
                x, y = (data >> 17).astype(np.uint16), (data >> 2 & 0x7FFF).astype(np.uint16)
                events = Events(t + (overflows << 31), x, y, (data >> 1 & 1).astype(np.uint8))
                valid = (data & 1).astype(bool)
                yield events if valid.all() else events.select(valid)

    def _packets(self, file: BinaryIO, kind: int, first: int | None = None) -> Iterator[tuple[int, int, bytes]]:
        """The packets of a kind (among so many first ones): size of an event [bytes], overflows of its time, events."""
        left = file.seek(0, 2) - self._packets_at
        file.seek(self._packets_at)
        for number in count():
            if left <= 0 or number == first:
                return
            header = file.read(PACKET.size)
            found, source, size, _, overflows, _, events, _ = PACKET.unpack(header.ljust(PACKET.size, b"\xff"))
            left -= PACKET.size + size * events
            if size <= 0 or events < 0 or overflows < 0 or left < 0:
                raise ValueError("a packet leaves the file")
            if found & COMPRESSED:
                raise ValueError("a packet is compressed")
            if found == kind and self._source in (None, source) and events:
                if size * events > LARGEST:
                    raise ValueError("a packet is too large")
                yield size, overflows, file.read(size * events)
            else:
                file.seek(size * events, 1)

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        """The file, open; every way in which it is not one becomes a DataError."""
        with read_as(self.path, "AEDAT 3.1"), open(self.path, "rb") as file:
            yield file


def _header(file: BinaryIO) -> dict[str, str]:
    """The lines of the header, by what stands before the colon."""
    found: dict[str, str] = {}
    for _ in range(LINES):
        line = file.readline(LINE).decode("latin-1").strip()
        if line == "#!END-HEADER":
            return found
        key, _, value = line.removeprefix("#").partition(":")
        if not key.startswith("Source ") or re.fullmatch("Source [0-9]{1,5}", key):
            found[key] = value.strip()
    raise ValueError("the header does not end")


def _picture(content: bytes, overflows: int) -> Iterator[Picture]:
    """The frame, unless it is marked as not valid."""
    if len(content) < FRAME_HEAD.itemsize:
        raise ValueError("a frame without a header")
    head = np.frombuffer(content, FRAME_HEAD, 1)[0]
    channels, (width, height) = int(head["info"]) >> 1 & 7, head["size"].tolist()
    if not head["info"] & 1:
        return
    if width < 1 or height < 1 or channels not in (1, 3, 4):
        raise ValueError(f"a frame of {width}x{height} pixels of {channels} channels")
    count = width * height * channels
    if FRAME_HEAD.itemsize + 2 * count > len(content):
        raise ValueError("a frame leaves its packet")
    pixels = (np.frombuffer(content, "<u2", count, FRAME_HEAD.itemsize) >> 8).astype(np.uint8)
    pixels = pixels.reshape(height, width, channels)
    start_us, end_us = head["t"][2:].tolist()
    t_us = (overflows << 31) + start_us + (end_us - start_us) // 2
    yield Picture(t_us, pixels[..., 0] if channels == 1 else pixels[..., :3])


FORMAT = Format(
    "aedat3",
    "AEDAT 3.1, of iniVation's cAER",
    ".aedat",
    recognises=lambda head, path: head.startswith(b"#!AER-DAT3.1"),
    open=Aedat3Events,
    largest=(1 << 15, 1 << 15),
    keeps=frozenset({"frames"}),
)
