"""events.h5: event files in the layout of DSEC.

    events/t   uint32, or uint64 for more than 71 minutes   [us] since t_offset, never decreasing
    events/x   uint16                                       column, 0 is left
    events/y   uint16                                       row, 0 is top
    events/p   uint8                                        1 brighter (ON), 0 darker (OFF)
    events/label  uint8, on request                         why the event was sent (`vid2ev.stream.events.Label`)
    ms_to_idx  uint64                                       [k] = number of events with t < 1000 k
    frames/t, frames/to_idx   int64 [us] since t_offset, uint64   the frames of the source, where known: events of the
               interval that ends with frame k are events[to_idx[k - 1]:to_idx[k]]
    t_offset   int64                                        [us] of t = 0 (the first frame) on the clock of the source
    attributes width, height, version                       size in pixels, version of this layout

`ms_to_idx` has an entry for every whole millisecond that the recording lasts and for the one after it, so that
`events[ms_to_idx[a]:ms_to_idx[b]]` is the window [a, b) ms for any a < b in it.  The layout is that of
https://github.com/uzh-rpg/DSEC (its `EventSlicer` reads these files); readers need `import hdf5plugin`.

The same events give the same bytes: the file holds no times of writing, and is always filled in the same blocks.
Filter: Blosc with LZ4 and bit-shuffling, about 3 bytes per event; Zstandard saves 5 to 8 % in up to twice the time.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.columns import labels, pixels, saved_as_arrays, whole_us
from vid2ev.formats.event_file import BLOCK, Format, Recording, promised, regrouped, within
from vid2ev.formats.frame_index import FrameIndex
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
from vid2ev.stream.ahead import ahead
from vid2ev.stream.events import Events
from vid2ev.untrusted import check_bytes

if TYPE_CHECKING:
    import h5py

VERSION = 1
CHUNK = 1 << 16  # events per compressed chunk
BLOCKS_AHEAD = 1  # read and looked at while those before them are compressed
MS_US = 1000
BESIDE = ("events/label", "frames/t", "frames/to_idx", "ms_to_idx", "t_offset")  # the events


class Hdf5Events(Sequential):
    """The events of an HDF5 file in the layout of DSEC; in order of time, parts of them are looked up.

    Raises DataError for a file that is not there, not an event file in that layout, or damaged.
    """

    def __init__(self, path: Path):
        super().__init__(path)
        with opened(path, _check) as file:
            self.says_start = "t_offset" in file
            self.start_us = whole_us(path, np.ravel(file["t_offset"][()]))[0].item() if self.says_start else 0
            self.size = (int(file.attrs["width"]), int(file.attrs["height"])) if "width" in file.attrs else None
            self.labelled = "label" in file["events"]
            self.frame_us = whole_us(path, file["frames/t"][:], self.start_us) if "frames/t" in file else None
            if self.frame_us is not None and np.any(self.frame_us[1:] < self.frame_us[:-1]):
                raise DataError(f"{path} is damaged: its frames/t go back; make it again or get another copy")
            self._time_type = str(file["events/t"].dtype)
            # (only `write_events` is known to have put them in order, and to have counted them)
            self._indexed = np.array_equal(file.attrs.get("version"), VERSION) and "ms_to_idx" in file
            self._in_order = True if self._indexed else None

    def describe(self) -> dict[str, Any]:
        """How times are stored."""
        return {"time_type": self._time_type}

    def events(self, start_us: int | None = None, stop_us: int | None = None, block: int = BLOCK) -> Iterator[Events]:
        """The events with start_us <= t < stop_us; no more than that is read of files in order of time, but for the
        times of all, once, where another program wrote them."""
        with opened(self.path, _check) as file:
            t = file["events/t"]
            if start_us is None and stop_us is None:
                yield from self._stretch(file, 0, len(t), block)
            elif self._is_in_order(t):
                first = 0 if start_us is None else self._position(file, start_us - self.start_us)
                last = len(t) if stop_us is None else self._position(file, stop_us - self.start_us)
                yield from self._stretch(file, first, last, block)
            else:
                yield from regrouped(within(self._stretch(file, 0, len(t), BLOCK), start_us, stop_us), block)

    def _stretch(self, file: h5py.File, first: int, last: int, block: int) -> Iterator[Events]:
        """Those of the events number first ... last - 1 that are within the sensor."""
        columns, outside = file["events"], 0
        for at in range(first, last, block):
            part = slice(at, min(at + block, last))
            t = whole_us(self.path, columns["t"][part], self.start_us)
            label = labels(self.path, columns["label"][part]) if self.labelled else None
            events = Events(t, *pixels(self.path, *(columns[name][part] for name in "xyp")), label)
            events, left = self._inside(events)
            outside += left
            if len(events):
                yield events
        if last - first == len(columns["t"]):  # (of parts, as many as are asked for, each would say another number)
            self._leave_out(outside, f"{self._outside} are")

    def _is_in_order(self, t: h5py.Dataset) -> bool:
        """Whether no time goes back, without which none can be looked up."""
        if self._in_order is None:
            parts = (t[max(at - 1, 0) : at + BLOCK] for at in range(0, len(t), BLOCK))
            self._in_order = not any(np.any(part[1:] < part[:-1]) for part in parts)
        return self._in_order

    def _position(self, file: h5py.File, t_us: int) -> int:
        """The number of events with t < t_us, t relative to t_offset."""
        t = file["events/t"]
        low, high = 0, len(t)
        if self._indexed and 0 <= t_us // MS_US < len(file["ms_to_idx"]) - 1:
            low, high = (int(k) for k in file["ms_to_idx"][t_us // MS_US : t_us // MS_US + 2])
            if not (
                0 <= low <= high <= len(t) and (low == 0 or t[low - 1] < t_us) and (high == len(t) or t[high] >= t_us)
            ):
                raise DataError(f"{self.path} is damaged: its ms_to_idx is not of its times; get another copy")
        while high - low > BLOCK:
            middle = (low + high) // 2
            low, high = (middle + 1, high) if t[middle] < t_us else (low, middle)
        return low + int(np.searchsorted(t[low:high].astype(np.int64), t_us))


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it, ValueError as `promised` does."""
    import h5py

    offset_us, duration_us = recording.start_us, recording.duration_us
    with WholeFile(path) as raw, h5py.File(raw, "w") as file:
        width, height = recording.size
        file.attrs.update(width=np.uint16(width), height=np.uint16(height), version=np.uint16(VERSION))
        file["t_offset"] = np.int64(offset_us)
        columns = _columns(file, recording.count, np.uint32 if duration_us < 1 << 32 else np.uint64, recording.labelled)
        types = {name: dataset.dtype for name, dataset in columns.items()}
        index = _dataset(file, "ms_to_idx", duration_us // MS_US + 2, np.uint64)
        frames = None if recording.frame_us is None else FrameIndex(recording.frame_us - offset_us)
        indexed = start = 0
        with closing(ahead(_as_stored(recording, types), BLOCKS_AHEAD)) as blocks:
            for t, stored in blocks:
                for name, dataset in columns.items():
                    dataset[start : start + len(t)] = stored[name]
                indexed = _index(index, indexed, int(t[-1]) // MS_US + 1, t, start)
                if frames is not None:
                    frames.add(t, start)
                start += len(t)
                raw.check()
        _index(index, indexed, len(index), np.empty(0, np.int64), start)
        if frames is not None:
            for name, values, dtype in (("t", frames.frame_us, np.int64), ("to_idx", frames.counts, np.uint64)):
                dataset = _dataset(file, f"frames/{name}", len(values), dtype)
                dataset[...] = values
                dataset.flush()  # (now, and not when nobody holds it any more: its place in the file goes by that)


def _as_stored(
    recording: Recording, types: Mapping[str, np.dtype[Any]]
) -> Generator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """The events in blocks: int64 times since the start of the recording, and columns as the file has them."""
    for t, block in promised(recording):
        columns = {name: t if name == "t" else getattr(block, name) for name in types}
        yield t, {name: column.astype(types[name], copy=False) for name, column in columns.items()}


def _columns(file: h5py.File, count: int, time: type, labelled: bool) -> dict[str, h5py.Dataset]:
    types: dict[str, type] = {"t": time, "x": np.uint16, "y": np.uint16, "p": np.uint8}
    types |= {"label": np.uint8} if labelled else {}
    return {name: _dataset(file, f"events/{name}", count, dtype) for name, dtype in types.items()}


def _dataset(file: h5py.File, name: str, length: int, dtype: type) -> h5py.Dataset:
    import hdf5plugin

    blosc = hdf5plugin.Blosc(cname="lz4", clevel=5, shuffle=hdf5plugin.Blosc.BITSHUFFLE)
    return file.create_dataset(name, (length,), dtype, maxshape=(None,), chunks=(CHUNK,), compression=blosc)


def _index(index: h5py.Dataset, first: int, last: int, t: np.ndarray, start: int) -> int:
    """Fill entries first ... last - 1 of ms_to_idx from a block of times that begins at event `start`."""
    for at in range(first, last, BLOCK):
        edges = np.arange(at, min(at + BLOCK, last)) * MS_US
        index[at : at + len(edges)] = start + np.searchsorted(t, edges)
    return max(first, last)


def _check(file: h5py.File, path: Path) -> None:
    import h5py

    check_links(file, path, [*(f"events/{name}" for name in "txyp"), *BESIDE])
    columns = [file.get(f"events/{name}") for name in "txyp"]
    if not all(isinstance(column, h5py.Dataset) and column.ndim == 1 for column in columns):
        how = saved_as_arrays(path, "h5py.File")
        raise DataError(f"{path} has no events/t, x, y, p as DSEC's files have; where it calls events otherwise, {how}")
    if any(column.dtype.kind not in "iufb" for column in columns):
        types = ", ".join(str(column.dtype) for column in columns)
        raise DataError(f"{path} has events/t, x, y, p of types {types}; expected numbers")
    others = [file[name] for name in BESIDE if name in file]
    if not all(isinstance(each, h5py.Dataset) for each in others):
        raise DataError(f"{path} is damaged: {', '.join(BESIDE)} are arrays; make it again or get another copy")
    for each in [*columns, *others]:
        if not is_inside(each, path):
            raise DataError(
                f"{path}: {each.name} is in another file; expected one file, so copy it into this (h5repack)"
            )
        check_chunks(each, path)
    if "frames/t" in file:
        check_bytes(path, file["frames/t"].size * 8, "frames/t")
    shaped = all(each.size == 1 if each.name == "/t_offset" else each.ndim == 1 for each in others)
    if not shaped or not all(is_whole(each) for each in others):
        raise DataError(f"{path} is damaged: parts of {', '.join(BESIDE)} are missing or of no use; get another copy")
    if not all(is_whole(column) for column in columns):
        raise DataError(f"{path} is damaged: parts of events/t, x, y, p are missing; get another copy")
    if len({len(column) for column in [*columns, *(each for each in others if each.name == "/events/label")]}) > 1:
        raise DataError(f"{path} is damaged: its columns of events differ in length; make it again or get another copy")


FORMAT = Format(
    "hdf5",
    "HDF5 in the layout of DSEC",
    ".h5",
    recognises=lambda head, path: head.startswith(MAGIC) and not holds_table(path),
    open=Hdf5Events,
    write=write_events,
    largest=((1 << 16) - 1, (1 << 16) - 1),
    idle_bytes=34,  # the index of milliseconds, packed
    keeps=frozenset({"labels", "frame times", "size", "start"}),
)
