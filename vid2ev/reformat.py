"""Event files of one format into another: every event, at its own microsecond."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.formats import (
    FORMATS,
    LATEST_US,
    check_holds,
    format_named,
    of_only_camera,
    open_events,
    recognise,
    survey,
)
from vid2ev.formats.event_file import Format, Recording
from vid2ev.formats.frame_index import frame_times_beside
from vid2ev.recording.destination import check_place
from vid2ev.recording.disk import sync, writing
from vid2ev.recording.held import Held, undisturbed
from vid2ev.stream.events import Events
from vid2ev.views.window import beginning_us, window

KEPT = ("labels", "frames", "frame times")  # what events may have beside t, x, y, p

Report = Callable[[Recording, int], object]


def reformat(
    source: str | Path,
    target: str | Path,
    name: str | None = None,
    *,
    start_s: float | None = None,
    stop_s: float | None = None,
    overwrite: bool = False,
    report: Report | None = None,
) -> dict[str, Any]:
    """Write an event file anew in another format; `target` is there as a whole or not at all.

    source           an event file of any format, or a recording's folder
    target           the file to make; DAT makes more of them where one cannot hold the times.  Those of a recording
                     that is replaced go with it
    name             of the format; by default what the suffix of target says
    start_s, stop_s  the part to take [s after the beginning, see `window.beginning_us`]
    report           called with the recording and the number of events done

    Returns what was made, ready for JSON.  Raises UsageError for what a format cannot hold and for a target that is
    taken, or being written by another, DataError for a source that cannot be read and a target that cannot be written.
    """
    target = Path(target)
    kind = format_named(name) if name else format_of_suffix(target)
    if kind.write is None:
        raise UsageError(f"format '{kind.name}' is only read; expected one of {', '.join(writable())}")
    if target.is_dir():
        raise UsageError(f"{target} is a folder; give a file in it, such as {target / f'events{kind.suffix}'}")
    check_place(target)
    if target.exists() and not overwrite:
        raise UsageError(f"{target} exists; --overwrite replaces it")
    file = open_events(of_only_camera(source))
    frame_us = frame_times_beside(file.path) if "frame times" in kind.keeps else None
    if start_s is None and stop_s is None:
        recording = _framed(survey(file), frame_us)
    else:
        recording = _part(file, start_s, stop_s, frame_us)
    check_holds(kind, recording.size, recording.duration_us, recording.start_us)
    seen_us: list[int] = []
    made = _write(target, kind, _reported(recording, report, seen_us), overwrite)
    had = (recording.labelled, recording.frames is not None, recording.frame_us is not None)
    lost = [what for what, there in zip(KEPT, had, strict=True) if there and what not in kind.keeps]
    return {
        "source": str(source),
        "path": str(target),
        "format": kind.name,
        "files": [str(path) for path in made],
        "events": recording.count,
        "size": list(recording.size),
        "size_stated": file.size is not None,
        "start_us": recording.start_us,
        "duration_us": recording.duration_us,
        "span_us": seen_us[-1] - seen_us[0] if seen_us else 0,  # from the first event to the last
        "bytes": sum(path.stat().st_size for path in made),
        "warnings": [
            *file.warnings,
            *_of_size(recording.size, file.size is not None, kind),
            *(f"{kind.name} does not hold {what}; they are left out" for what in lost),
        ],
    }


def _of_size(size: tuple[int, int], stated: bool, kind: Format) -> list[str]:
    """What is to be said of the size of a sensor."""
    if not stated:
        return [f"the size is not stated; {size[0]}x{size[1]} holds all events"]
    if "size" in kind.keeps:
        return []
    return [f"{kind.name} does not hold the size, {size[0]}x{size[1]}; readers take the smallest that holds all events"]


def writable() -> list[str]:
    """The names of formats that are written."""
    return [name for name in FORMATS if format_named(name).write]


def format_of_suffix(path: Path) -> Format:
    """The format that a file's name asks for: the first of that suffix; raises UsageError."""
    kinds = [format_named(name) for name in writable()]
    for kind in kinds:
        if kind.suffix == path.suffix.lower():
            return kind
    raise UsageError(f"{path}: '{path.suffix}' is the suffix of no format; give one of {', '.join(writable())}")


def _framed(recording: Recording, frame_us: np.ndarray | None) -> Recording:
    """A recording with the instants of its frames, where others say them and it does not itself."""
    if recording.frame_us is not None or frame_us is None or not len(frame_us):
        return recording
    duration_us = max(recording.duration_us, int(frame_us[-1]) - recording.start_us)
    return replace(recording, frame_us=frame_us, duration_us=duration_us)


def _part(file: Any, start_s: float | None, stop_s: float | None, frame_us: np.ndarray | None) -> Recording:
    for t_s in (start_s or 0, stop_s or 0):
        if not abs(t_s) * 10**6 < LATEST_US:
            raise UsageError(f"part from {start_s or 0} s to {stop_s} s: expected seconds after the beginning")
    first_us = beginning_us(file)
    start_us = first_us + round(1e6 * (start_s or 0))
    stop_us = None if stop_s is None else first_us + round(1e6 * stop_s)
    if stop_us is not None and stop_us <= start_us:
        raise UsageError(f"stop {stop_s} s: expected a time after the start at {start_s or 0} s")
    return window(file, start_us, stop_us, frame_us=frame_us)


def _write(target: Path, kind: Format, recording: Recording, overwrite: bool) -> list[Path]:
    """The files of a recording, made beside their place, where no other process makes them meanwhile, and moved there
    when they are whole."""
    assert kind.write is not None
    beside = target.with_name(f".{target.name}.new")
    held, work = Held(beside), beside / "made"
    try:
        with writing(target):
            held.take()
            shutil.rmtree(work, ignore_errors=True)  # (of one that was killed)
            work.mkdir()
            kind.write(work / target.name, recording)
            made = sorted(work.iterdir())
            taken = [path.name for path in made if (target.parent / path.name).exists()]
            if taken and not overwrite:
                raise UsageError(f"{target.parent / taken[0]} exists; --overwrite replaces it")
            for path in made:
                sync(path)
            old = _further(target)
            places = [path.replace(target.parent / path.name) for path in made]
            for path in {*old} - {*places}:
                path.unlink()
            sync(target.absolute().parent)
    finally:
        with undisturbed():  # (Ctrl-C twice leaves nothing, either)
            if held:
                shutil.rmtree(work, ignore_errors=True)
            held.close()
            with suppress(OSError):  # (another one is writing there)
                beside.rmdir()
    return places


def _further(target: Path) -> list[Path]:
    """The other files of the recording that is in the way, which go with it; none of what cannot be read."""
    try:
        kind = recognise(target) if target.is_file() else None
        return kind.further(target) if kind and kind.further else []
    except DataError:
        return []


def _reported(recording: Recording, report: Report | None, seen_us: list[int]) -> Recording:
    """The recording, telling how many events were taken from it; the times of the first and the last are put down."""

    def blocks() -> Iterator[Events]:
        done = 0
        for events in recording.blocks():
            yield events
            done += len(events)
            if len(events):
                seen_us[:] = [*seen_us[:1], *events.t[[0, -1]].tolist()]
            if report is not None:
                report(recording, done)

    return replace(recording, blocks=blocks)
