"""Where events go and come from: the event files of the field, one module each.

Writing is one call, `write(path, recording)`: all that a file may need to know of its events before the first one is in
the `Recording`.  Reading is `open_events(path)`: the content says which format it is, never the name.

A new format is a module with a `FORMAT` and a line in `FORMATS`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.formats.event_file import BLOCK, HEAD, EventFile, Format, Recording, regrouped
from vid2ev.formats.matlab import refuse_mat
from vid2ev.formats.order import Disorder, ordered
from vid2ev.stream.events import Events
from vid2ev.terminal import counted
from vid2ev.untrusted import check_file, limit_for, most_bytes

__all__ = [
    "FORMATS",
    "check_holds",
    "describe_events",
    "event_cameras",
    "format_named",
    "holds_events",
    "of_only_camera",
    "open_events",
    "read_events",
    "recognise",
    "survey",
]

# By name, in the order in which content is looked at: what can be mistaken for nothing else comes first.
FORMATS = {
    "hdf5": "vid2ev.formats.hdf5",
    "aedat4": "vid2ev.formats.aedat4",
    "aedat3": "vid2ev.formats.aedat3",
    "ros1": "vid2ev.formats.ros1",
    "ros2": "vid2ev.formats.ros2",
    "evt3": "vid2ev.formats.evt3",
    "evt2": "vid2ev.formats.evt2",
    "dat": "vid2ev.formats.dat",
    "npz": "vid2ev.formats.npz",
    "v2e-hdf5": "vid2ev.formats.v2e_hdf5",
    "es": "vid2ev.formats.es",
    "aedat2": "vid2ev.formats.aedat2",
    "csv": "vid2ev.formats.csv_text",
    "rpg": "vid2ev.formats.rpg",
    "nmnist": "vid2ev.formats.nmnist",
}


LONG_SILENCE_US = 3_600_000_000  # before the first event: the file counts from another instant than it begins
LARGEST_SIDE = 1 << 16  # pixels of a sensor, as columns and rows are uint16
LATEST_US = 1 << 62  # which times are nearer to 0 than: differences of two, and twice as much, still fit into 64 bits
DEEPEST_US = 60_000_000  # how far times may go back; events of so long are held in memory


def format_named(name: str) -> Format:
    """The format of a name.  Raises UsageError."""
    if name not in FORMATS:
        raise UsageError(f"format '{name}': expected one of {', '.join(FORMATS)}")
    return importlib.import_module(FORMATS[name]).FORMAT


def open_events(path: str | Path) -> EventFile:
    """The event file at a path, or the one in a recording's folder; raises as `read_events` does."""
    return _opened(path)[1]


def read_events(
    path: str | Path, start_us: int | None = None, stop_us: int | None = None, *, block: int = BLOCK
) -> Iterator[Events]:
    """The events of a file or recording folder with start_us <= t < stop_us, at most `block` at a time.

    Times are absolute, on the clock of the source.  Raises UsageError for a file that is not there, times that are no
    whole numbers or blocks of no events, DataError for a file that is no event file, or damaged.
    """
    for name, t_us in (("start_us", start_us), ("stop_us", stop_us)):
        if not isinstance(t_us, (int, np.integer, type(None))):
            raise UsageError(f"{name} {t_us!r}: expected a whole number of microseconds")
    if block < 1:
        raise UsageError(f"block {block}: expected at least 1 event at a time")
    # (unsigned numbers of numpy have no differences below 0)
    first_us, end_us = (None if t_us is None else int(t_us) for t_us in (start_us, stop_us))
    yield from open_events(path).events(first_us, end_us, block)


def describe_events(path: str | Path) -> dict[str, Any]:
    """What is in an event file: format, counts, the earliest and the latest time [us], size [pixels] where it is
    stated.  Raises as `read_events` does."""
    kind, file = _opened(path)
    count, on, disorder = 0, 0, Disorder()
    first: int | None = None
    for events in file.events():
        if not len(events):
            continue
        disorder.add(events.t)
        count, on = count + len(events), on + int(np.count_nonzero(events.p))
        earliest = int(events.t.min())
        first = earliest if first is None else min(first, earliest)
    return {
        "kind": "events",
        "format": kind.name,
        "path": str(path),
        "size": list(file.size) if file.size else None,
        "events": count,
        "on": on,
        "off": count - on,
        "start_us": file.start_us,
        "first_us": first,
        "last_us": disorder.latest_us,
        "times_going_back": disorder.places,
        "labels": file.labelled,
        "frames": file.has_frames,
        "bytes": sum(part.stat().st_size for part in _parts_of(kind, file.path)),
        "stored": file.describe(),
        "warnings": file.warnings,
    }


def survey(file: EventFile) -> Recording:
    """An event file as a recording to be written anew; reads all of it once.

    Where the file does not state its size, that is the smallest that holds all events; where it counts from an instant
    long before its first event (such as 1970), the recording begins with that.  Times that go back are put in order,
    with a warning.  Raises DataError for events outside of the size stated, minutes out of order, or further away than
    any year.
    """
    count, first_us, width, height, disorder = 0, None, 0, 0, Disorder()
    for events in file.events():
        if len(events):
            disorder.add(events.t)
            earliest_us = int(events.t.min())
            first_us = earliest_us if first_us is None else min(first_us, earliest_us)
            width, height = max(width, int(events.x.max()) + 1), max(height, int(events.y.max()) + 1)
            count += len(events)
    size = file.size or (max(width, 1), max(height, 1))
    if width > size[0] or height > size[1]:
        raise DataError(
            f"{file.path}: an event at column {width - 1} or row {height - 1} of a {size[0]}x{size[1]} sensor;"
            " the file is damaged"
        )
    _note_disorder(file, disorder)
    if max(abs(file.start_us), abs(first_us or 0), abs(disorder.latest_us or 0)) >= LATEST_US:
        raise DataError(f"{file.path}: times beyond 146,000 years; the file is damaged")
    start_us = file.start_us if first_us is None else min(file.start_us, first_us)
    if first_us is not None and first_us - start_us > LONG_SILENCE_US:
        start_us = first_us
    frame_us = getattr(file, "frame_us", None)
    ends = [
        start_us,
        start_us if disorder.latest_us is None else disorder.latest_us,
        *(frame_us[-1:].tolist() if frame_us is not None else ()),
    ]

    def blocks() -> Iterator[Events]:
        return regrouped(ordered(file.events(), disorder.depth_us))

    frames = file.frames if file.has_frames else None
    return Recording(size, start_us, max(ends) - start_us, count, blocks, file.labelled, frames, frame_us)


def _note_disorder(file: EventFile, disorder: Disorder) -> None:
    """Warn of times that go back, or refuse them."""
    if disorder.depth_us > DEEPEST_US:
        raise DataError(
            f"{file.path}: times go back by {disorder.depth_us / 1e6:.6g} s, more than {DEEPEST_US // 10**6} s: it"
            " holds several recordings, or is damaged; take a part of it"
        )
    if disorder.places:
        said = f"times go back at {counted(disorder.places, 'place')}, by at most {disorder.depth_us} us: put in order"
        file.warnings.extend([said] if said not in file.warnings else [])


def check_holds(
    kind: Format, size: tuple[int, int], duration_us: int | None = None, start_us: int | None = None
) -> None:
    """Raise UsageError, which names a format that can, unless a format can hold pixels and times as these; DataError
    where times are so far apart that files would be full of nothing: a single damaged one is enough for that."""
    choose = f"choose --format {_holding(size, duration_us or 0)}"
    _check_idle(kind, duration_us or 0, choose)
    if kind.clock_us and start_us is not None:
        _check_clock(kind, kind.clock_us, start_us, start_us + (duration_us or 0), choose)
    if kind.largest and not _has_room(kind, size):
        what, most = f"{size[0]}x{size[1]} pixels", f"{kind.largest[0]}x{kind.largest[1]}"
    elif kind.longest_us is not None and duration_us is not None and duration_us > kind.longest_us:
        what, most = f"{duration_us / 1e6:.10g} s", f"{kind.longest_us / 1e6:.10g} s"
    else:
        return
    raise UsageError(f"format {kind.name} cannot hold {what}, at most {most}; {choose}")


def _holding(size: tuple[int, int], duration_us: int) -> str:
    """The name of a format that holds such pixels and times."""
    kinds = (format_named(name) for name in ("hdf5", "aedat4"))
    fitting = (kind.name for kind in kinds if _has_room(kind, size) and _idle_bytes(kind, duration_us) <= most_bytes())
    return next(fitting, "npz")


def _has_room(kind: Format, size: tuple[int, int]) -> bool:
    return kind.largest is None or (size[0] <= kind.largest[0] and size[1] <= kind.largest[1])


def _check_clock(kind: Format, clock_us: tuple[int, int], first_us: int, last_us: int, choose: str) -> None:
    """Raise UsageError where times are beyond those that a format has."""
    if first_us < clock_us[0] or last_us > clock_us[1]:
        raise UsageError(
            f"format {kind.name} cannot hold times from {first_us / 1e6:.10g} to {last_us / 1e6:.10g} s, at least"
            f" {clock_us[0] / 1e6:.10g} and at most {clock_us[1] / 1e6:.10g} s; {choose}"
        )


def _idle_bytes(kind: Format, duration_us: int) -> int:
    """What times when nothing happens take."""
    return kind.idle_bytes * duration_us // 10**6


def _check_idle(kind: Format, duration_us: int, choose: str) -> None:
    """Raise DataError where that would be more than files may take."""
    claimed = _idle_bytes(kind, duration_us)
    if claimed > most_bytes():
        raise DataError(
            f"{duration_us / 8.64e10:,.0f} days as {kind.name} would take {-(-claimed >> 20):,} MB for times when"
            f" nothing happens; {choose}, take a part of it, or if that is meant set {limit_for(claimed)}"
        )


def recognise(path: str | Path) -> Format | None:
    """The format of a file, by its content; None if that is no event file.  Raises UsageError if it is not there,
    DataError if it cannot be read."""
    path = Path(path)
    check_file(path)
    try:
        with open(path, "rb") as file:
            head = file.read(HEAD)
    except FileNotFoundError as error:
        raise UsageError(
            f"{path}: no such file; give an event file, or a folder that `vid2ev convert` wrote"
        ) from error
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}; give an event file") from error
    kinds = (format_named(name) for name in FORMATS)
    return next((kind for kind in kinds if kind.open and kind.recognises(head, path)), None)


def holds_events(folder: Path) -> bool:
    """Whether a folder has events itself, as that of a recording or of a ROS 2 bag has."""
    return (folder / "metadata.yaml").exists() or any(folder.glob("events.*"))


def event_cameras(folder: Path) -> list[Path]:
    """The folders of the event cameras in a recording of several cameras; none in a folder that has events itself."""
    return [] if holds_events(folder) else [camera for camera in _cameras(folder) if any(camera.glob("events.*"))]


def of_only_camera(path: str | Path) -> Path:
    """The folder of the event camera in a recording of several cameras, if there is no other; or the path itself."""
    cameras = event_cameras(Path(path))
    return cameras[0] if len(cameras) == 1 else Path(path)


def _cameras(folder: Path) -> list[Path]:
    return sorted(path.parent for path in folder.glob("*/manifest.json"))


def _opened(path: str | Path) -> tuple[Format, EventFile]:
    path = Path(path)
    path = _within(path) if os.path.isdir(path) else path  # (Path.is_dir raises OSError for a name that is too long)
    kind = recognise(path)
    if kind is None or kind.open is None:
        refuse_mat(path)
        raise DataError(f"{path} is no event file of a known format; expected one of {', '.join(FORMATS)}")
    file = kind.open(path)
    if file.size is not None and not 1 <= min(file.size) <= max(file.size) <= LARGEST_SIDE:
        width, height = file.size
        raise DataError(
            f"{path} says {width}x{height} pixels, expected 1 to {LARGEST_SIDE} a side; it is damaged: get another copy"
        )
    return kind, file


def _parts_of(kind: Format, path: Path) -> list[Path]:
    """The file and those in which it goes on, or all files of the bag that a metadata.yaml speaks for."""
    if path.name == "metadata.yaml":
        return [part for part in path.parent.iterdir() if part.is_file()]
    return [path, *(kind.further(path) if kind.further else ())]


def _within(folder: Path) -> Path:
    """The event file of a recording's folder: the first of `FORMATS` that is there; or what tells a bag of ROS 2."""
    for name in FORMATS:
        path = folder / f"events{format_named(name).suffix}"
        if path.exists():
            return path
    bag = folder / "metadata.yaml"
    cameras = _cameras(folder)
    if cameras and not bag.exists():
        names, seen = ", ".join(camera.name for camera in cameras), event_cameras(folder)
        if not seen:
            raise UsageError(f"{folder} holds frames of {names} and no events; give a recording of an event camera")
        raise UsageError(f"{folder} is a recording of the cameras {names}; give one: {' or '.join(map(str, seen))}")
    if (folder / "timestamps.txt").exists() or any((folder / name).exists() for name in ("raw", "frames.mp4")):
        raise UsageError(f"{folder} holds frames and no events; give the folder of an event camera")
    return bag if bag.exists() else folder / "events.h5"
