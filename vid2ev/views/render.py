"""`render`: a film, a picture or a folder of pictures of any event file.

FILE.mp4    a film: a picture for each slice
FILE.png    one picture: all events of the window, if one is asked for; otherwise, or if it is said how to slice,
            the slice with the most events
DIR         a folder with the pictures of a film, and slices.csv
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.formats import of_only_camera, open_events
from vid2ev.formats.event_file import EventFile, Recording
from vid2ev.formats.frame_index import frame_times_beside
from vid2ev.pictures.film import film_size
from vid2ev.recording.disk import whole, writing
from vid2ev.untrusted import check_bytes
from vid2ev.views.canvas import Canvas
from vid2ev.views.destination import check_free, kind_of
from vid2ev.views.on_disk import FPS, write_film, write_picture, write_pictures
from vid2ev.views.representation import Kind, Slice, represent
from vid2ev.views.requests import parse_representation, parse_slicing
from vid2ev.views.slices import Duration, Slicing, Source
from vid2ev.views.window import beginning_us, window, with_frame_times

VIEWS = {"polarity": "counts", "accumulated": "frame", "voxel": "voxel", "time-surface": "time-surface"}
SIDE = 1280  # pixels
PIXEL = 16  # bytes of a pixel of the sensor, until its picture is reduced
RANGES = {"fps": (0.01, 1000), "speed": (1e-6, 1e6), "start": (0, 1e9), "stop": (0, 1e9), "size": (64, 8192)}

Report = Callable[[Recording, int], object]
Drawn = Iterator[tuple[Slice, np.ndarray]]


def render(
    events: str | Path,
    output: str | Path,
    *,
    view: str = "polarity",
    by: str | None = None,
    fps: float = FPS,
    speed: float | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    size: int = SIDE,
    frames: bool | None = None,
    stamp: bool = True,
    overwrite: bool = False,
    report: Report | None = None,
) -> dict[str, Any]:
    """Make a film (.mp4), a picture (.png) or a folder of pictures of an event file or a recording's folder.

    view            polarity, time-surface[:TAU], accumulated[:FULL_SCALE] or voxel[:BINS]
    by              how to slice; a picture shows a slice.  By default what passes in 1 / fps at `speed`
    fps             pictures per second of the film
    speed           of the film against reality, 1 by default; cannot be had together with `by`
    start_s, stop_s the window, in seconds after the beginning (`window.beginning_us`); both ends are in
    size            the longest side of a picture, at most [pixels]; the line that `stamp` writes below is not counted
    frames          whether to show the frames of the file, too; None: if it has any
    stamp           whether to write time and number of events below
    report          called after every slice with the recording and the number of events shown so far

    Returns what was made, for JSON.  What is at `output` is replaced only with `overwrite`, when the new is whole.
    Raises UsageError for what cannot be meant, DataError for a file that cannot be read or a disk that cannot be
    written.
    """
    output, made_as = Path(output), kind_of(Path(output))
    check_free(output, overwrite)
    _check_numbers(fps=fps, speed=speed, start=start_s, stop=stop_s, size=size)
    rate = Fraction(str(fps)).limit_denominator(10**6)  # films have no finer ones
    slicing, kind = _slicing(by, rate, speed), _kind(view)
    file = open_events(of_only_camera(events))
    zero_us = beginning_us(file)
    frame_us = frame_times_beside(file.path) if isinstance(slicing, Source) and not file.has_frames else None
    recording = _recording(file, zero_us, start_s, stop_s, bool(frames), frame_us)
    width, height = recording.size
    check_bytes(file.path, PIXEL * width * height, f"a picture of {width}x{height} pixels")
    if isinstance(slicing, Source):
        recording = with_frame_times(recording)
    if made_as == "png" and by is None and speed is None and (start_s, stop_s) != (None, None):
        slicing = Duration(Fraction(max(1, recording.duration_us)))
    shown = recording.frames() if recording.frames and frames is not False else None
    fine = not isinstance(slicing, Source) and not (isinstance(slicing, Duration) and slicing.us >= 1000)
    limit = size - size % 2 if made_as == "mp4" else size  # (films have even sides)
    canvas = Canvas(kind, recording.size, limit, shown, stamp=stamp, zero_us=zero_us, digits=6 if fine else 3)
    done = _Done(recording, report)
    arrays = represent(recording, slicing, canvas.view)
    made = _write(output, canvas, arrays, done, rate)
    asked = {"path": str(output), "kind": made_as, "view": view, "by": str(slicing), "fps": float(fps)}
    size_px = film_size(canvas.size) if made_as == "mp4" else canvas.size
    return asked | made | {"size": list(size_px), "warnings": list(file.warnings)}


@dataclass
class _Done:
    """The slices drawn so far."""

    recording: Recording
    report: Report | None
    slices: int = 0
    events: int = 0
    start_us: int | None = None
    stop_us: int = 0

    def add(self, part: Slice) -> None:
        """One more."""
        self.start_us = part.start_us if self.start_us is None else self.start_us
        self.slices, self.events, self.stop_us = self.slices + 1, self.events + part.events, part.stop_us
        if self.report is not None:
            self.report(self.recording, self.events)

    def facts(self, pictures: int, part: Slice | None = None) -> dict[str, Any]:
        """What is in the pictures: all slices, or one."""
        start_us, stop_us = (self.start_us or 0, self.stop_us) if part is None else (part.start_us, part.stop_us)
        return {
            "frames": pictures,
            "slices": self.slices,
            "events": self.events if part is None else part.events,
            "start_us": start_us,
            "duration_us": stop_us - start_us,
        }


def _check_numbers(**options: float | None) -> None:
    for name, value in options.items():
        least, most = RANGES[name]
        if value is not None and not least <= value <= most:
            raise UsageError(f"--{name} {value}: expected a number from {least:g} to {most:g}")


def _slicing(by: str | None, fps: Fraction, speed: float | None) -> Slicing:
    if by is not None and speed is not None:
        raise UsageError(f"--by {by} says what a picture shows, and so does --speed {speed:g}; leave out one of them")
    if by is not None:
        return parse_slicing(by)
    us = 10**6 * Fraction(str(speed or 1)) / fps
    if us < 1:
        raise UsageError(f"--speed {speed} at {float(fps):g} pictures per second is less than 1 us for each; go faster")
    return Duration(us)


def _kind(view: str) -> Kind:
    name, colon, rest = view.partition(":")
    if name not in VIEWS or (name == "polarity" and rest):
        raise UsageError(f"view '{view}': expected one of polarity, accumulated:2, voxel:5, time-surface:30ms")
    return parse_representation(VIEWS[name] + colon + rest, view)


def _recording(
    file: EventFile,
    zero_us: int,
    start_s: float | None,
    stop_s: float | None,
    frames: bool,
    frame_us: np.ndarray | None,
) -> Recording:
    """The window of a file, which has to have `frames` if so; their instants may stand beside it."""
    if start_s is not None and stop_s is not None and stop_s <= start_s:
        raise UsageError(f"--stop {stop_s:g} is not after --start {start_s:g}; choose a later one")
    if frames and not file.has_frames:
        raise UsageError(f"{file.path} holds no frames beside its events; leave out --with-frames")
    start_us, stop_us = (None if s is None else zero_us + round(s * 1e6) for s in (start_s, stop_s))
    recording = window(file, zero_us if start_us is None else start_us, stop_us, as_seen=True, frame_us=frame_us)
    if not recording.count and (start_s, stop_s) != (None, None):
        raise UsageError(f"{file.path}: no events from {start_s or 0:g} s to {_end(stop_s)}; choose another window")
    return recording


def _end(stop_s: float | None) -> str:
    return "the end" if stop_s is None else f"{stop_s:g} s"


def _write(output: Path, canvas: Canvas, arrays: Drawn, done: _Done, fps: Fraction) -> dict[str, Any]:
    """Draw the slices and put them where they go."""
    with writing(output, "make room or access there, or choose another place with -o"), whole(output) as beside:
        if kind_of(output) == "png":
            part, picture = _densest(canvas, arrays, done)
            write_picture(beside, picture)
            return done.facts(1, part)
        drawn = _drawn(canvas, arrays, done)
        film = kind_of(output) == "mp4"
        return done.facts(write_film(beside, drawn, fps) if film else write_pictures(beside, drawn))


def _drawn(canvas: Canvas, arrays: Drawn, done: _Done) -> Drawn:
    for part, array in arrays:
        yield part, canvas.draw(part, array)
        done.add(part)


def _densest(canvas: Canvas, arrays: Drawn, done: _Done) -> tuple[Slice, np.ndarray]:
    """The slice with the most events, the first of several; draws only slices that may be it."""
    best: tuple[Slice, np.ndarray] | None = None
    for part, array in arrays:
        if best is None or part.events > best[0].events:
            best = part, canvas.draw(part, array)
        done.add(part)
    assert best is not None  # there is at least one slice
    return best
