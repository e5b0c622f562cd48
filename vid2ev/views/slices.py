"""Slices: a stream of events cut into consecutive parts, each of which becomes a picture or an array.

    duration:10ms   each lasts 10 ms (us, ms or s; plain numbers are seconds; 1/30 will do)
    count:50000     each has 50 000 events
    area:500,32     a slice ends when one of the squares of 32 x 32 pixels has 500 events
    source          each is the interval between two frames of the source

A slice is (start_us, stop_us]: an event at an edge belongs to the slice that ends there, as an event of the interval
between two frames lies after the earlier and not after the later one.  Only the first slice has the events at its
start, too.  Slices follow each other without a gap, from the start of the recording to its end, and each event is in
exactly one.

* `duration`: edges are at start + floor(k T).  Slices without events are given.  The last one has the length of the
  others, though the recording may end within it.
* `source`: edges are the instants of the frames, so N frames make N - 1 slices.  If the recording begins before the
  first frame or ends after the last, that is a slice as well.  Slices without events are given.
* `count`, `area`: a slice begins where the one before ended, and ends with the event that fills it: of events in the
  same microsecond, some may be in one slice and some in the next.  The rest is the last slice, and ends with the
  recording; without a rest there is none.

There is always at least one slice, even of a recording without events.

These are the exposures of v2e (`--dvs_exposure duration T | count N | area_count N A | source`, `renderer.py` of
https://github.com/SensorsINI/v2e), which itself begins at the first event and leaves out the last slice.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.formats.event_file import Recording
from vid2ev.stream.events import Events

MOST_SLICES = 10**9


@dataclass(frozen=True, slots=True)
class Piece:
    """Events of the slice (start_us, stop_us] that come one after the other; with the `last` the slice is whole."""

    start_us: int
    stop_us: int
    events: Events
    last: bool


class Slicing(Protocol):
    """A way to cut a recording; `str` of it is its text."""

    def pieces(self, recording: Recording) -> Iterator[Piece]:
        """All slices of a recording in order, each in one or more pieces.  Raises UsageError where the recording has
        not what it takes."""


@dataclass(frozen=True)
class Duration:
    """Slices of `us` microseconds, at least 1; a fraction will do."""

    us: Fraction

    def pieces(self, recording: Recording) -> Iterator[Piece]:
        """Holds no more than a block of events.  Raises UsageError for more slices than anyone looks at: one damaged
        time is enough for that."""
        slices = max(1, -int(-recording.duration_us // self.us))
        if slices > MOST_SLICES:
            raise UsageError(
                f"slices '{self}': {recording.duration_us / 8.64e10:,.0f} days have {slices:,} of them, expected at"
                f" most {MOST_SLICES:,}; choose longer ones, or a part with --start and --stop"
            )
        edges = (recording.start_us + int(k * self.us // 1) for k in range(1, slices + 1))
        return _between(recording, edges)

    def __str__(self) -> str:
        return f"duration:{self.us}us"


@dataclass(frozen=True)
class Source:
    """Slices from frame to frame of the source."""

    def pieces(self, recording: Recording) -> Iterator[Piece]:
        """Holds no more than a block of events.  Raises UsageError if the instants of the frames are not known."""
        if recording.frame_us is None:
            raise UsageError("slices 'source': the times of the frames are not known here; choose duration:10ms")
        start_us, end_us = recording.start_us, recording.start_us + recording.duration_us
        frames = np.unique(recording.frame_us)
        edges = [int(t_us) for t_us in frames[(frames > start_us) & (frames < end_us)]]
        return _between(recording, [*edges, end_us])

    def __str__(self) -> str:
        return "source"


@dataclass(frozen=True)
class Count:
    """Slices of `most` events."""

    most: int

    def pieces(self, recording: Recording) -> Iterator[Piece]:
        """Holds the events of a slice, 13 bytes each."""
        filling = 0

        def fills(events: Events, first: int) -> int:
            nonlocal filling
            n = min(self.most - filling, len(events) - first)
            filling += n
            if filling < self.most:
                return -1
            filling = 0
            return first + n - 1

        return _until(recording, fills)

    def __str__(self) -> str:
        return f"count:{self.most}"


@dataclass(frozen=True)
class Area:
    """Slices that end when a square of `side` x `side` pixels, counted from the upper left, has `most` events."""

    most: int
    side: int

    def pieces(self, recording: Recording) -> Iterator[Piece]:
        """Holds the events of a slice: at most `most` for each square."""
        from vid2ev.views.squares import Squares

        return _until(recording, Squares(recording.size, self.side, self.most).fills)

    def __str__(self) -> str:
        return f"area:{self.most},{self.side}"


class _Fills(Protocol):
    def __call__(self, events: Events, first: int) -> int:
        """The index of the event, from `first` on, that fills the slice; -1 if none of these does."""


def _between(recording: Recording, edges: Iterable[int]) -> Iterator[Piece]:
    """Slices from the start to the first edge, from there to the second, ..., the last not before the last event."""
    edges = iter(edges)
    start_us, stop_us = recording.start_us, next(edges)
    for events in recording.blocks():
        while len(events) and events.t[-1] > stop_us:
            n = int(np.searchsorted(events.t, stop_us, side="right"))
            yield Piece(start_us, stop_us, events.stretch(0, n), True)
            events = events.stretch(n, len(events))
            start_us, stop_us = stop_us, _following(edges, int(events.t[-1]))
        if len(events):
            yield Piece(start_us, stop_us, events, False)
    yield Piece(start_us, stop_us, Events.empty(), True)
    for edge_us in edges:
        start_us, stop_us = stop_us, edge_us
        yield Piece(start_us, stop_us, Events.empty(), True)


def _following(edges: Iterator[int], t_us: int) -> int:
    edge_us = next(edges, None)
    if edge_us is None:
        raise ValueError(f"an event at {t_us} us, after the end of the recording")
    return edge_us


def _until(recording: Recording, fills: _Fills) -> Iterator[Piece]:
    """Slices that end with the events that fill them."""
    start_us, held, given = recording.start_us, [], False
    for events in recording.blocks():
        first = 0
        while first < len(events):
            at = fills(events, first)
            if at < 0:
                held.append(events.stretch(first, len(events)))
                break
            held.append(events.stretch(first, at + 1))
            stop_us = int(events.t[at])
            yield from _whole(start_us, stop_us, held)
            start_us, held, given, first = stop_us, [], True, at + 1
    if held or not given:
        yield from _whole(start_us, recording.start_us + recording.duration_us, held)


def _whole(start_us: int, stop_us: int, parts: list[Events]) -> Iterator[Piece]:
    parts = parts or [Events.empty()]
    for k, events in enumerate(parts):
        yield Piece(start_us, stop_us, events, k == len(parts) - 1)
