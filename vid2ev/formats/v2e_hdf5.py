"""The HDF5 of v2e: one table.

    events   uint32 [N, 4]   t [us], x, y, p: 1 brighter (ON), 0 darker (OFF)
    attributes width, height [pixels], start_us: the instant of t = 0 on the clock of the source

The attributes are ours; v2e does not write them, and who reads its files passes over them.  32 bits of microseconds are
71 minutes.  Files that have label in a fifth column are read, too.

Nothing is compressed: this is for programs that read v2e's files, with or without plug-ins.  (v2e's own are gzipped,
4.8 bytes per event instead of 16, at a fifteenth of the speed; `hdf5` takes 3.4.)
Source: https://github.com/SensorsINI/v2e, v2ecore/emulator.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.columns import pixels, saved_as_arrays, whole_us
from vid2ev.formats.event_file import Format, Recording, promised
from vid2ev.formats.hdf5_file import (
    MAGIC,
    WholeFile,
    check_chunks,
    check_links,
    holds_table,
    is_inside,
    is_whole,
    opened,
)
from vid2ev.formats.sequential import Sequential
from vid2ev.stream.events import Events

if TYPE_CHECKING:
    import h5py

COLUMNS = 4
CHUNK = 1 << 14  # events per chunk
PART = 1 << 18  # events read at a time


class V2eEvents(Sequential):
    """The events of v2e's HDF5.  Raises DataError for a file that is not one, or damaged."""

    def __init__(self, path: Path):
        super().__init__(path)
        with opened(path, _check) as file:
            self.says_start = "start_us" in file.attrs
            self.start_us = whole_us(path, np.ravel(file.attrs.get("start_us", 0)))[0].item()
            self.size = (int(file.attrs["width"]), int(file.attrs["height"])) if "width" in file.attrs else None
            self._shape = file["events"].shape
            self._dtype = str(file["events"].dtype)

    def describe(self) -> dict[str, Any]:
        """How the table is stored."""
        return {"columns": self._shape[1], "type": self._dtype}

    def _decoded(self) -> Iterator[Events]:
        outside = 0
        with opened(self.path, _check) as file:
            table = file["events"]
            for at in range(0, len(table), PART):
                rows = table[at : at + PART]
                t, x, y, p = (rows[:, k] for k in range(COLUMNS))
                events = Events(whole_us(self.path, t, self.start_us), *pixels(self.path, x, y, p, named=False))
                events, left = self._inside(events)
                outside += left
                yield events
        self._leave_out(outside, f"{self._outside} are")


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it."""
    import h5py

    with WholeFile(path) as raw, h5py.File(raw, "w") as file:
        (width, height), at = recording.size, 0
        file.attrs.update(width=np.uint32(width), height=np.uint32(height), start_us=np.int64(recording.start_us))
        shape, whole = (recording.count, COLUMNS), (None, COLUMNS)
        table = file.create_dataset("events", shape, np.uint32, maxshape=whole, chunks=(CHUNK, COLUMNS))
        for t, events in promised(recording):
            rows = np.empty((len(t), COLUMNS), np.uint32)
            for column, values in enumerate((t, events.x, events.y, events.p)):
                rows[:, column] = values
            table[at : at + len(t)] = rows
            at += len(t)
            raw.check()


def _check(file: h5py.File, path: Path) -> None:
    import h5py

    check_links(file, path, ["events"])
    table = file.get("events")
    if not isinstance(table, h5py.Dataset) or table.ndim != 2 or not COLUMNS <= table.shape[1] <= COLUMNS + 1:
        how = saved_as_arrays(path, "h5py.File")
        raise DataError(f"{path} has events that are no table of 4 columns, as v2e's are; {how}")
    if not is_inside(table, path):
        raise DataError(f"{path}: its events are in another file; expected one file, so copy them into it (h5repack)")
    check_chunks(table, path)
    if not is_whole(table):
        raise DataError(f"{path} is damaged: parts of its events are missing; get another copy")
    if table.dtype.kind not in "iu":
        how = saved_as_arrays(path, "h5py.File")
        raise DataError(f"{path} has events that are no whole numbers, as v2e's are, but {table.dtype}; {how}")


FORMAT = Format(
    "v2e-hdf5",
    "HDF5 of v2e",
    ".h5",
    recognises=lambda head, path: head.startswith(MAGIC) and holds_table(path),
    open=V2eEvents,
    write=write_events,
    largest=(1 << 16, 1 << 16),
    longest_us=(1 << 32) - 1,
    keeps=frozenset({"size", "start"}),
)
