"""What an event file is: what it is told before it is written, and what it answers when it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from vid2ev.stream.events import Events

BLOCK = 1 << 20  # events written or read at a time
PACKETS = 1 << 14  # events to which small packets are joined first, so that few of them wait at a time
HEAD = 1 << 16  # bytes from which a format is recognised


@dataclass(frozen=True, slots=True)
class Picture:
    """A frame that a file holds beside its events: uint8 gray [H, W] or red, green, blue [H, W, 3], and when [us]."""

    t_us: int
    pixels: np.ndarray


@dataclass(frozen=True)
class Recording:
    """Events to be written, and what is known of them before the first.

    size         (width, height) [px]; every event is within
    start_us     the instant from which formats with relative times count; no event is before it
    duration_us  from there to the end; no event is after it
    count        how many events there are
    blocks       gives the events afresh at each call, in order of time, `BLOCK` of them at a time but for the last;
                 times are absolute
    labelled     whether events have labels
    frames       gives the frames beside them, in order of time, or as they stand in a file; None if there are none
    frame_us     the instants of the frames of the source, int64, absolute; None if there were none
    """

    size: tuple[int, int]
    start_us: int
    duration_us: int
    count: int
    blocks: Callable[[], Iterator[Events]]
    labelled: bool = False
    frames: Callable[[], Iterator[Picture]] | None = None
    frame_us: np.ndarray | None = None


class EventFile(Protocol):
    """An event file that can be read as often as one likes, in memory that does not grow with its length.

    Making one reads what stands at the start of the file, and raises `DataError` for what cannot be read.
    """

    path: Path
    size: tuple[int, int] | None  # (width, height) [px] if the file states it
    start_us: int  # the instant from which the file counts, on the clock of its source; 0 if it does not say
    says_start: bool  # whether it does
    labelled: bool  # whether its events have labels
    has_frames: bool  # whether there are frames beside the events
    warnings: list[str]  # what a person should know, one sentence each; more may come while the events are read

    def describe(self) -> dict[str, Any]:
        """What else the file says of itself (version, camera, how it is stored), ready for JSON."""

    def events(self, start_us: int | None = None, stop_us: int | None = None, block: int = BLOCK) -> Iterator[Events]:
        """The events with start_us <= t < stop_us as they stand in the file, at most `block` at a time; times are
        absolute.  Raises DataError where the file turns out to be damaged."""

    def frames(self) -> Iterator[Picture]:
        """The frames beside the events."""


@dataclass(frozen=True)
class Format:
    """A kind of event file.

    name        of `--format`
    title       what it is, in a line
    suffix      of files that are written, such as ".h5"
    recognises  whether a file is of this kind, by its first `HEAD` bytes (the path is there to look further)
    open        the file, to be read; None if that cannot be done
    write       makes the file; raises OSError where the disk cannot take it.  None if that cannot be done
    further     the other files that belong to one, where a recording may take several; raises DataError
    largest     (width, height) [px] that it can hold; None without limit
    longest_us  the latest time after start_us that it can hold; None without limit
    clock_us    the first and the last instant that it can hold, absolute; None without limit
    idle_bytes  a second, about, that it grows by where nothing happens
    keeps       what it holds beside t, x, y, p: of "labels", "frames", "frame times", "size", "start"
    """

    name: str
    title: str
    suffix: str
    recognises: Callable[[bytes, Path], bool]
    open: Callable[[Path], EventFile] | None = None
    write: Callable[[Path, Recording], None] | None = None
    further: Callable[[Path], list[Path]] | None = None
    largest: tuple[int, int] | None = None
    longest_us: int | None = None
    clock_us: tuple[int, int] | None = None
    idle_bytes: int = 0
    keeps: frozenset[str] = frozenset()


def within(blocks: Iterator[Events], start_us: int | None = None, stop_us: int | None = None) -> Iterator[Events]:
    """The events with start_us <= t < stop_us; for files that have no index of times."""
    for events in blocks:
        if start_us is not None or stop_us is not None:
            kept = np.ones(len(events), bool)
            kept &= True if start_us is None else events.t >= start_us
            kept &= True if stop_us is None else events.t < stop_us
            events = events.select(kept)
        if len(events):
            yield events


def regrouped(blocks: Iterator[Events], block: int = BLOCK) -> Iterator[Events]:
    """The same events, exactly `block` of them at a time but for the last."""
    waiting: list[Events] = []
    count = 0
    for events in blocks:
        while count + len(events) >= block:
            first = block - count
            yield Events.concatenate([*waiting, events.stretch(0, first)])
            events, waiting, count = events.stretch(first, len(events)), [], 0
        if len(events):
            waiting.append(events)
            count += len(events)
    if count:
        yield Events.concatenate(waiting)


def promised(recording: Recording) -> Iterator[tuple[np.ndarray, Events]]:
    """The blocks of a recording, each with its times since start_us.

    Raises ValueError if the recording does not keep what it says of itself.
    """
    width, height = recording.size
    count, last_us = 0, 0
    for events in recording.blocks():
        if not len(events):
            continue
        t = events.t - recording.start_us
        if t[0] < last_us or np.any(t[1:] < t[:-1]) or t[-1] > recording.duration_us:
            raise ValueError(f"events out of order of time, or outside of the recording, after event {count}")
        if int(events.x.max()) >= width or int(events.y.max()) >= height:
            raise ValueError(f"events outside of {width}x{height} pixels after event {count}")
        count, last_us = count + len(events), int(t[-1])
        yield t, events
    if count != recording.count:
        raise ValueError(f"{count} events, {recording.count} announced")
