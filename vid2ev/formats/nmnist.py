"""N-MNIST and N-Caltech101, .bin (read only): 40 bits for each event, and nothing else.

    column 8 bits, row 8 bits, ON 1 bit, time 23 bits [us], big-endian

An event in row 240 is none: from there on, times are 8192 us later.  There is nothing at the start by which such a file
could be known; it is one if its size is that of whole events, they are on a sensor of 240x180, take time, do not go
back in it, and are not text.  N-MNIST has 34x34 pixels, and the file of an N-Caltech101 picture does not say how many
it has.

Source: Orchard et al., Frontiers in Neuroscience 9:437 (2015), and its Read_Ndataset.m
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import HEAD, Format
from vid2ev.formats.sequential import Sequential, pieces, reading
from vid2ev.stream.events import Events

RECORD = 5  # bytes
FEWEST = 8  # events by which a file is known
SENSOR = (240, 180)
NMNIST = (34, 34)
LATER_ROW, LATER_US = 240, 1 << 13
TEXT = bytes([9, 10, 13, *range(32, 127)])


class NmnistEvents(Sequential):
    """The events of an N-MNIST or N-Caltech101 file.  Raises DataError for a file that does not look like one."""

    def __init__(self, path: Path):
        super().__init__(path)
        with reading(path) as file:
            head = file.read(HEAD)
        if not _recognises(head, path):
            raise DataError(f"{path} does not hold events of 40 bits as N-MNIST does; expected such a file")
        x, y = (np.frombuffer(head, np.uint8)[start::RECORD] for start in (0, 1))
        fits = np.all((x[: len(y)] < NMNIST[0]) & (y < NMNIST[1]) | (y == LATER_ROW))
        self.size = NMNIST if fits else None

    def _decoded(self) -> Iterator[Events]:
        later_us, outside = 0, 0
        with reading(self.path) as file:
            for record in pieces(file, np.dtype((np.uint8, RECORD))):
                x, y, high, middle, low = (record[:, column] for column in range(RECORD))
                later = y == LATER_ROW
                t = later_us + LATER_US * np.cumsum(later) + _time(high, middle, low)
                later_us += LATER_US * int(np.count_nonzero(later))
                events = Events(t, x.astype(np.uint16), y.astype(np.uint16), high >> 7)
                events, left = self._inside(events.select(~later))
                outside += left
                yield events
        self._leave_out(outside, f"{self._outside} are")


def _recognises(head: bytes, path: Path) -> bool:
    if len(head) < FEWEST * RECORD or path.stat().st_size % RECORD or not head.translate(None, TEXT):
        return False
    record = np.frombuffer(head, np.uint8, len(head) // RECORD * RECORD).reshape(-1, RECORD)
    x, y, high, middle, low = (record[:, column] for column in range(RECORD))
    later = y == LATER_ROW
    t = (LATER_US * np.cumsum(later) + _time(high, middle, low))[~later]
    on_sensor = (x < SENSOR[0]) & (y < SENSOR[1]) | later
    return bool(np.all(on_sensor) and np.all(t[1:] >= t[:-1]) and len(t) and t[-1] > t[0])


def _time(high: np.ndarray, middle: np.ndarray, low: np.ndarray) -> np.ndarray:
    return (high & 0x7F).astype(np.int64) << 16 | middle.astype(np.int64) << 8 | low


FORMAT = Format(
    "nmnist",
    "N-MNIST, N-Caltech101",
    ".bin",
    recognises=_recognises,
    open=NmnistEvents,
)
