"""jAER's AEDAT 2.0 (read only): lines of text that begin with #, then 8 bytes for each event, big-endian.

    "#!AER-DAT2.0"   the first line; another may name the camera: "# AEChip: eu.seebetter.ini.chips.davis.Davis346blue"
    address          uint32, by camera as below
    time             int32 [us]; followed beyond its end

    DVS128          row [14:8], column [7:1], 1 is OFF [0]; other bits: no pixel
    DAVIS           row [30:22], column [21:12], 1 is ON [11], special [10]; [31]: a sample of a frame, or of motion
    640x480 (v2e)   row [20:11], column [10:1], 1 is ON [0]

Among the lines are all settings of the camera, 186 kB of them, and names in whatever letters; newer files say which is
the last.

jAER mirrors columns, and its rows count from the bottom, so both are turned here: x = width - 1 - column and
y = height - 1 - row are upright.  Where no line names the camera, the first addresses tell: a DVS128 has 15 bits,
v2e's 640x480 has 21; else it is a DAVIS of 240x180 if all fit, and of 346x260 if not.

Sources: jAER, AEChip.java, AEFileInputStream.java, DavisChip.java, DavisBaseCamera.java, DVS128.java and
SecDvs640Gen2.java (https://github.com/SensorsINI/jaer); v2e, v2ecore/output/aedat2_output.py;
https://docs.inivation.com/software/software-advanced-usage/file-formats/aedat-2.0.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import Format
from vid2ev.formats.sequential import Sequential, Unwrapped, pieces, reading
from vid2ev.stream.events import Events

MAGIC = b"#!AER-DAT2.0"
RECORD = np.dtype([("address", ">u4"), ("t", ">i4")])
HEAD = 1 << 20  # bytes among which the lines end
LINE = re.compile(rb"#[\t\x20-\x7e]{0,16000}\r?\n")
LAST = re.compile(rb"^#[# ]*end of ascii header[^\r\n]*\r?\n", re.IGNORECASE | re.MULTILINE)


class Camera(NamedTuple):
    """What an address means: first bit and number of bits of row and column, the polarity's bit, what it is if ON, and
    bits that no event of a pixel has."""

    size: tuple[int, int]
    row: tuple[int, int]
    column: tuple[int, int]
    polarity: int
    on: int
    special: int


DVS128 = Camera((128, 128), (8, 7), (1, 7), 0, 0, 0xFFFF8000)
DVS640 = Camera((640, 480), (11, 10), (1, 10), 0, 1, 0xFFE00000)
DAVIS240 = Camera((240, 180), (22, 9), (12, 10), 11, 1, 1 << 31 | 1 << 10)
DAVIS346 = DAVIS240._replace(size=(346, 260))
NAMED = {"dvs128": DVS128, "tmpdiff128": DVS128, "davis240": DAVIS240, "sbret10": DAVIS240, "davis346": DAVIS346}


class Aedat2Events(Sequential):
    """The events of an AEDAT 2.0 file.  Raises DataError for a file that is none, or of a camera that is not known."""

    def __init__(self, path: Path):
        super().__init__(path)
        with reading(path) as file:
            head = file.read(HEAD)
        if not head.startswith(MAGIC):
            raise DataError(f"{path} does not begin as an AEDAT 2.0 file does; expected one")
        self._lines, self._begin = _header(head)
        whole = (len(head) - self._begin) // RECORD.itemsize
        addresses = np.frombuffer(head, RECORD, max(whole, 0), min(self._begin, len(head)))["address"]
        chip = next((line for line in self._lines if "aechip" in line.lower()), "")
        named = next((camera for name, camera in NAMED.items() if name in chip.lower()), None)
        if chip and named is None:
            raise DataError(f"{path} is of an unknown camera ({chip}); expected a DVS128, DAVIS240 or DAVIS346")
        self._camera = named or _camera_of(addresses.astype(np.int64))
        self.size = self._camera.size
        if not named:
            self.warnings.append(f"no line names the camera; by its events it is one of {self.size[0]}x{self.size[1]}")

    def describe(self) -> dict[str, Any]:
        """The lines at the start."""
        return {"header": self._lines}

    def _decoded(self) -> Iterator[Events]:
        camera, clock, special, outside = self._camera, Unwrapped(), 0, 0
        with reading(self.path) as file:
            file.seek(self._begin)
            for records in pieces(file, RECORD):
                address, t = records["address"].astype(np.uint32), clock(records["t"])
                if np.any(unwanted := address & camera.special):
                    address, t = address[unwanted == 0], t[unwanted == 0]
                special += len(records) - len(t)
                # (what is outside of the sensor wraps around to beyond its other side)
                x = (camera.size[0] - 1 - _field(address, camera.column)).astype(np.uint16)
                y = (camera.size[1] - 1 - _field(address, camera.row)).astype(np.uint16)
                p = ((address >> camera.polarity & 1) == camera.on).astype(np.uint8)
                events, left = self._inside(Events(t, x, y, p))
                outside += left
                yield events
        self._leave_out(special, "special events and samples of frames and motion are")
        self._leave_out(outside, f"{self._outside} are")
        cut = max(self.path.stat().st_size - self._begin, 0) % RECORD.itemsize
        self._leave_out(cut, "bytes at the end, where the file is cut within an event, are")


def _header(head: bytes) -> tuple[list[str], int]:
    """The lines at the start, and the bytes that they are.

    Where no line says that it is the last, a first address can begin with the byte of #, too; it is told from a line by
    what follows.
    """
    last, at = LAST.search(head), 0
    while not last and (line := LINE.match(head, at)):
        at = line.end()
    at = last.end() if last else at
    return [line.strip() for line in head[:at].decode("latin-1").split("\n")[:-1]], at


def _camera_of(address: np.ndarray) -> Camera:
    if not np.any(address >> 15):
        return DVS128
    if not np.any(address >> 21):
        return DVS640
    pixels = address[address & DAVIS240.special == 0]
    fits = not np.any((_field(pixels, DAVIS240.column) >= 240) | (_field(pixels, DAVIS240.row) >= 180))
    return DAVIS240 if fits else DAVIS346


def _field(address: np.ndarray, bits: tuple[int, int]) -> np.ndarray:
    return (address >> bits[0] & ((1 << bits[1]) - 1)).astype(np.int64)


FORMAT = Format(
    "aedat2",
    "jAER's AEDAT 2.0",
    ".aedat",
    recognises=lambda head, path: head.startswith(MAGIC),
    open=Aedat2Events,
)
