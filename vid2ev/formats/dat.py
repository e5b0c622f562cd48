"""Prophesee DAT: 8 bytes for each event (CD).

    header     lines of text (see `prophesee`), with Version, Width, Height
    2 bytes    kind of the events: 12 (CD), or 0 in old files; 8, the size of an event
    time       uint32, little-endian [us] since start_us
    address    uint32: column [13:0], row [27:14], polarity [28]

32 bits of microseconds are 71.6 minutes.  What is longer goes on in more files, NAME_1.dat to NAME_9998.dat at most,
each with its own start_us, a line that says which of how many it is, and one with the number of events and the length
of them all, by which parts of other recordings are known; each can be read alone, and the first is read with those that
follow.  Times that start anew within one file are followed, too.  Version 1, where the address is column [8:0], row
[16:9], polarity [17], is read.  Source: https://docs.prophesee.ai/stable/data/file_formats/dat.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import HEAD, Format, Recording, promised
from vid2ev.formats.prophesee import Header, read_header
from vid2ev.formats.sequential import Sequential, Unwrapped, pieces, reading
from vid2ev.stream.events import Events

PART_US, MOST_PARTS = 1 << 32, 9999
KINDS = (b"\x0c\x08", b"\x00\x08")
RECORD = np.dtype([("t", "<u4"), ("address", "<u4")])
BITS = {"2": (14, 14), "1": (9, 8)}  # of column and row, by version


class DatEvents(Sequential):
    """The events of a DAT file, and of those in which its recording goes on.  Raises DataError."""

    def __init__(self, path: Path):
        super().__init__(path)
        with reading(path) as file:
            head = file.read(HEAD)
        header = _header(head)
        if header is None:
            raise DataError(f"{path} does not begin as a DAT file of CD events does; expected one")
        self.size, self.start_us, self.says_start = header.size, header.start_us or 0, header.start_us is not None
        self._header = header
        self._bits = BITS.get(header.fields.get("version", "2"), BITS["2"])

    def describe(self) -> dict[str, Any]:
        """The lines of the header."""
        return {"header": self._header.fields}

    def _decoded(self) -> Iterator[Events]:
        yield from self._alone()
        there = self.further()
        missing = len(self._further()) - len(there)
        what = f"further files of the recording are not there ({self.path.stem}_*), or of another one, and are"
        self._leave_out(missing, what)
        for path in there:
            part = DatEvents(path)
            yield from part._alone()
            self.warnings += [text for text in part.warnings if text not in self.warnings]

    def further(self) -> list[Path]:
        """Those files in which the recording goes on that are there, and say themselves that they are its parts."""
        files = self._further()
        return [path for k, path in enumerate(files, 2) if self._goes_on(path, k, len(files) + 1)]

    def _goes_on(self, path: Path, k: int, parts: int) -> bool:
        """Whether a file is part k of this recording: it says so, and agrees with this one in all else."""
        found = _read_header(path)
        return found is not None and (
            found.fields.get("part") == f"{k}/{parts}"
            and found.size == self.size
            and found.start_us == self.start_us + (k - 1) * PART_US
            and found.fields.get("recording") == self._header.fields.get("recording")
        )

    def _further(self) -> list[Path]:
        """The files in which the recording goes on."""
        found = re.fullmatch(r"1/([1-9]\d{0,3})", self._header.fields.get("part", ""))
        return [_part(self.path, k) for k in range(1, int(found[1]) if found else 1)]

    def _alone(self) -> Iterator[Events]:
        column_bits, row_bits = self._bits
        clock, outside, begin = Unwrapped(), 0, self._header.length + 2
        with reading(self.path) as file:
            file.seek(begin)
            for records in pieces(file, RECORD):
                address = records["address"]
                x = (address & ((1 << column_bits) - 1)).astype(np.uint16)
                y = (address >> column_bits & ((1 << row_bits) - 1)).astype(np.uint16)
                p = (address >> (column_bits + row_bits) & 1).astype(np.uint8)
                events, left = self._inside(Events(clock(records["t"]) + self.start_us, x, y, p))
                outside += left
                yield events
        self._leave_out(outside, f"{self._outside} are")
        cut = (self.path.stat().st_size - begin) % RECORD.itemsize
        self._leave_out(cut, "bytes at the end, where the file is cut within an event, are")


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording into as many files as it takes.  Raises OSError where the disk cannot take it."""
    width, height = recording.size
    fields = ["Data file containing CD events", "Version 2", f"Width {width}", f"Height {height}"]
    parts = recording.duration_us // PART_US + 1
    whole = f"recording {recording.count} events in {recording.duration_us} us"
    for number in range(parts):
        own = [f"start_us {recording.start_us + number * PART_US}", f"part {number + 1}/{parts}", whole]
        _part(path, number).write_bytes("".join(f"% {line}\n" for line in fields + own).encode() + KINDS[0])
    for number, pieces_of_it in groupby(_parted(recording), itemgetter(0)):
        with open(_part(path, number), "ab") as file:
            for _, t, events in pieces_of_it:
                file.write(_records(t, events).data.cast("B"))


def _parted(recording: Recording) -> Iterator[tuple[int, np.ndarray, Events]]:
    """The number of the file, the times in it, and the events."""
    for t, events in promised(recording):
        first = 0
        while first < len(t):
            number = int(t[first]) // PART_US
            last = int(np.searchsorted(t, (number + 1) * PART_US))
            yield number, t[first:last] - number * PART_US, events.stretch(first, last)
            first = last


def _records(t: np.ndarray, events: Events) -> np.ndarray:
    records = np.empty((len(t), 2), "<u4")
    records[:, 0] = t
    records[:, 1] = events.x | events.y.astype(np.uint32) << 14 | events.p.astype(np.uint32) << 28
    return records


def _part(path: Path, number: int) -> Path:
    return path.with_name(f"{path.stem}_{number}{path.suffix}") if number else path


def _read_header(path: Path) -> Header | None:
    if not path.is_file():
        return None
    with reading(path) as file:
        return _header(file.read(HEAD))


def _header(head: bytes) -> Header | None:
    header = read_header(head)
    kind = head[header.length : header.length + 2] if header else b""
    return header if header and header.version is None and kind in KINDS else None


FORMAT = Format(
    "dat",
    "Prophesee DAT (CD)",
    ".dat",
    recognises=lambda head, path: _header(head) is not None,
    open=DatEvents,
    write=write_events,
    further=lambda path: DatEvents(path).further(),
    largest=(1 << 14, 1 << 14),
    longest_us=MOST_PARTS * PART_US - 1,  # (what goes on in more files than are counted is damage)
    keeps=frozenset({"size", "start"}),
)
