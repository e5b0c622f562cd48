"""Frames and events that come from a file each, or from one file that has both, as cameras with frames write it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from interp.data.layouts.sequence import Placed
from interp.interpolate.event_cursor import EventCursor
from interp.interpolate.instants import rate_of
from interp.interpolate.of_source import OfSource
from interp.interpolate.sensor import sensor_of
from interp.interpolate.take import Key, Options, refuse_edits
from interp.representation.dead_time import look_back_us, stated
from vid2ev import Events
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.manifest import identity
from vid2ev.sources.framing import framing_of

MOMENT = 4  # of a gap, before the first event and after the last: there need not be one at every instant


class FramesBesideEvents(OfSource):
    """A video or a folder of images, and the events of a file; both on one clock.

    Events of as many pixels as the frames have before `--crop` and `--size` are cropped with these.  Of events of
    another resolution nobody says where they belong: that is found (`interp.candidates.registered`), from edge on edge
    with what is left of the frames.
    """

    def __init__(self, path: str, options: Options, events: Path):
        super().__init__(path, options, has_events=True)
        sensor = sensor_of(events, options.contrast, options.refractory_us)
        self.contrast, self.dead_time = sensor.contrast, sensor.dead_time
        self._cursor, self._events_path = EventCursor(events, look_back_us(self.dead_time)), events
        corner, self._guessed = self._cursor.size, self._cursor.file.size is None
        guess = next((size for size in (self.size, self._whole) if all(np.less_equal(corner, size))), corner)
        sent = guess if self._guessed else corner
        *_, width, height = self._part
        self._cropped = sent != self.size and sent == self._whole != (width, height)
        self.event_size: tuple[int, int] = (width, height) if self._cropped else sent
        self.apart = self.event_size != self.size
        self._laid_over_part = self.apart and not self._cropped and self._whole != (width, height)

    @property
    def remarks(self) -> list[str]:
        """Those of the source, and what events and frames do not say of each other."""
        across, down = self._whole if self._cropped else self.event_size
        guessed = f"{self._events_path} does not state the size of its sensor, taken for {across}x{down}"
        cropped = f"{self._events_path} is of as many pixels as whole frames, and is cropped as these are"
        laid = f"{self._events_path} is of other pixels than whole frames, and all of it is laid over the part of these"
        said = [*super().remarks, *(f"{self._events_path}: {text}" for text in self._cursor.file.warnings)]
        if not self._cursor.count:
            return [*said, f"{self._events_path} holds no events"]
        said += [guessed] * self._guessed + [cropped] * self._cropped + [laid] * self._laid_over_part
        return [*said, *self._elsewhere()]

    def _elsewhere(self) -> Iterator[str]:
        """Whether all events are before the frames, or after them."""
        first, lasts_s = next(self._source.frames(0), None), self._source.duration_expected_s
        seen_us = self._cursor.seen_us
        if first is None or lasts_s is None or seen_us is None:
            return
        begin_s, seen_s = first.t_ns * 1e-9, [t_us * 1e-6 for t_us in seen_us]
        if seen_s[0] > begin_s + lasts_s or seen_s[1] < begin_s:
            yield (
                f"no event lies beside a frame: events are from {seen_s[0]:g} to {seen_s[1]:g} s, frames from"
                f" {begin_s:g} to {begin_s + lasts_s:g} s; give both by one clock"
            )

    def describe(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """What source and event file are."""
        about = {"path": str(self._events_path), "size": list(self.event_size), "contrast": self.contrast}
        known = {"dead_time": stated(self.dead_time), "identity": identity(self._events_path, besides=besides)}
        return super().describe(besides) | {"events": about | known}

    def events(self, start_us: int, stop_us: int) -> Events | None:
        """See `Take`."""
        events = _within(self._cursor, start_us, stop_us)
        if events is None or not self._cropped:
            return events
        return Placed(events.t, events.x, events.y, events.p).part(*self._part)[0]

    @property
    def _whole(self) -> tuple[int, int]:
        """Width and height of the frames before they are cropped [px]."""
        framing = framing_of(self._source)
        return self.size if framing is None else framing.whole

    @property
    def _part(self) -> tuple[int, int, int, int]:
        """Left, top, width and height of what is cropped [px]."""
        framing = framing_of(self._source)
        if framing is None:
            return 0, 0, *self.size
        left, top = map(round, framing.corner)
        right, bottom = (round(place + side) for place, side in zip(framing.corner, framing.extent, strict=True))
        return left, top, right - left, bottom - top


class OfEventFile:
    """An event file with frames, such as AEDAT4 or a bag of ROS.

    Where it does not state the size of its sensor, that is the frames', if all events are within.  Raises UsageError
    where it has no frames, or none in the part asked for, DataError where those of it differ in size.
    """

    curve = coded = "srgb"
    bits = 8
    apart = bright = False  # one sensor

    def __init__(self, path: Path, options: Options):
        refuse_edits(path, options)
        sensor = sensor_of(path, options.contrast, options.refractory_us)
        self.contrast, self.dead_time = sensor.contrast, sensor.dead_time
        self._cursor, self._path = EventCursor(path, look_back_us(self.dead_time)), path
        if not self._cursor.file.has_frames:
            raise UsageError(f"{path} holds no frames; give their video, with --events {path}, or `vid2ev reconstruct`")
        times, shapes = list[int](), dict[int, tuple[int, ...]]()
        for picture in self._cursor.file.frames():
            if not times or picture.t_us > times[-1]:
                times.append(picture.t_us)
                shapes[picture.t_us] = picture.pixels.shape
        begin_us = times[0] if times else 0
        start_us = begin_us if options.start_s is None else begin_us + round(options.start_s * 1e6)
        stop_us = times[-1] if times and options.stop_s is None else begin_us + round((options.stop_s or 0) * 1e6)
        inside = [t_us for t_us in times if start_us <= t_us <= stop_us]
        if not inside:
            raise UsageError(f"{path}: no frame in the part asked for; choose another")
        shape = shapes[inside[0]]
        if other := next((t_us for t_us in inside if shapes[t_us] != shape), None):
            raise DataError(
                f"{path}: frames of {_said(shape)} up to {(other - begin_us) / 1e6:.6g} s, and then of"
                f" {_said(shapes[other])}; take one or the other with --stop or --start"
            )
        self._first_us, self._last_us, self.gaps_expected = inside[0], inside[-1], len(inside) - 1
        self.name, self.size, self.channels = path.stem, (shape[1], shape[0]), 1 if len(shape) == 2 else 3
        guessed = self._cursor.file.size is None and all(np.less_equal(self._cursor.size, self.size))
        self.event_size = self.size if guessed else self._cursor.size
        span_us = self._last_us - self._first_us
        self.rate = rate_of(Fraction(10**6 * self.gaps_expected, span_us)) if span_us else Fraction(30)

    @property
    def remarks(self) -> list[str]:
        """Those of the file."""
        return self._cursor.file.warnings

    def looks(self, t_us: int) -> tuple[()]:
        """Nobody says so."""
        return ()

    def describe(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """Path and sizes."""
        about = {"kind": "events with frames", "path": str(self._path), "size": list(self.size)}
        return about | {
            "event_size": list(self.event_size),
            "contrast": self.contrast,
            "dead_time": stated(self.dead_time),
            "identity": identity(self._path, besides=besides),
        }

    def keys(self, start: int = 0) -> Iterator[Key]:
        """See `Take`."""
        last_us = self._first_us - 1
        number = 0
        for picture in self._cursor.file.frames():
            if not last_us < picture.t_us <= self._last_us:
                continue
            last_us, number = picture.t_us, number + 1
            if number > start:
                pixels = picture.pixels if picture.pixels.ndim == 3 else picture.pixels[..., None]
                yield Key(picture.t_us, pixels.astype(np.float32) / np.float32(255))

    def events(self, start_us: int, stop_us: int) -> Events | None:
        """See `Take`."""
        return _within(self._cursor, start_us, stop_us)


def _said(shape: tuple[int, ...]) -> str:
    """The shape of a picture, for people."""
    return f"{shape[1]}x{shape[0]} {'gray' if len(shape) == 2 else 'coloured'} pixels"


def _within(cursor: EventCursor, start_us: int, stop_us: int) -> Events | None:
    """The events of a gap; None if that is not within what the file holds."""
    begin_us, end_us = cursor.covered_us
    moment_us = (stop_us - start_us) // MOMENT
    if start_us < max(begin_us, cursor.silent_us) - moment_us or stop_us > end_us + moment_us:
        return None
    return cursor.between(start_us, stop_us)
