"""Two recordings beside each other: event files of any formats.

The time compared is that which both recordings have, from the later beginning to the earlier end; ends that are less
than a matching window apart are the same end, for it may only be an event that is missing there or late.  What is left
out is counted.

Streams of any length are compared in bands of rows: all events of a band of both recordings are in memory at a time, at
most `LIMIT` of them (or those of one row) at 20 bytes each, 60 if one pixel has them all, and the files are read once
more for each band.  Pixels know nothing of each other here, so the numbers are the same however the bands are cut.
Each pixel of the sensor takes `PIXEL` bytes beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.compare.by_pixel import by_pixel
from vid2ev.compare.comparison import LATEST_US, Comparison, Tally
from vid2ev.compare.matching import WINDOW_US
from vid2ev.compare.statistics import Statistics, statistics_of
from vid2ev.errors import DataError, UsageError
from vid2ev.formats import open_events, survey
from vid2ev.formats.event_file import EventFile, Recording
from vid2ev.stream.events import Events
from vid2ev.terminal import counted
from vid2ev.untrusted import check_bytes

LIMIT = 1 << 25  # events in memory at a time: 0.7 GB
PIXEL = 50  # bytes of a pixel

Report = Callable[[Recording, int], object]


@dataclass(frozen=True)
class Compared:
    """A comparison of two recordings, how many events of each are outside of the time compared, and what to know;
    the statistics of both, if they are asked for."""

    paths: tuple[str, str]
    comparison: Comparison
    left_out: tuple[int, int]
    shift_us: int
    warnings: list[str]
    alone: tuple[Statistics, Statistics] | None = None

    def as_dict(self) -> dict[str, Any]:
        """All numbers, ready for JSON."""
        names = ("statistics", "reference_statistics")
        return {
            "recording": self.paths[0],
            "reference": self.paths[1],
            **self.comparison.as_dict(),
            "left_out": self.left_out[0],
            "reference_left_out": self.left_out[1],
            "reference_shifted_us": self.shift_us,
            **{name: one.as_dict() for name, one in zip(names, self.alone or (), strict=False)},
            "warnings": self.warnings,
        }

    def facts(self) -> list[tuple[str, str]]:
        """The same for people: a name and a line for each."""
        facts = [("of", f"{self.paths[0]}, against {self.paths[1]}"), *self.comparison.facts()]
        if self.shift_us:
            facts.append(("aligned", f"the reference {self.shift_us / 1e6:+.6f} s"))
        if any(self.left_out):
            one, other = self.left_out
            facts.append(
                ("left out", f"{counted(one, 'event')}, {other:,} of the reference: outside of the time that both have")
            )
        facts += [(f"{name} alone", str(one)) for name, one in zip("AB", self.alone or (), strict=False)]
        return [*facts, *(("warning", text) for text in self.warnings)]


@dataclass(frozen=True)
class _Side:
    """A recording on the common clock."""

    path: str
    recording: Recording
    shift_us: int = 0

    @property
    def ends_us(self) -> tuple[int, int]:
        start_us = self.recording.start_us + self.shift_us
        return start_us, start_us + self.recording.duration_us

    @property
    def first_us(self) -> int:
        """The time of its first event; without any, when it begins."""
        first = next(self.recording.blocks(), None)
        return (self.recording.start_us if first is None else int(first.t[0])) + self.shift_us

    def blocks(self, span_us: tuple[int, int]) -> Iterator[Events]:
        """The events with span_us[0] <= t <= span_us[1]."""
        for events in self.recording.blocks():
            t = events.t + self.shift_us if self.shift_us else events.t
            first, last = np.searchsorted(t, [span_us[0], span_us[1] + 1])
            yield replace(events, t=t).stretch(int(first), int(last))


def compare_recordings(
    recording: str | Path,
    reference: str | Path,
    *,
    align: str = "clock",
    window_us: int = WINDOW_US,
    limit: int = LIMIT,
    statistics: bool = False,
    report: Report | None = None,
) -> Compared:
    """Compare an event file or recording's folder with a reference; both are read, whatever their formats.

    align       "clock": times are on one clock; "start": the beginnings are laid on one another, or the first events
                where a file says no beginning
    statistics  whether to gather those of each recording alone, too; the files are read once more
    report      called with a recording of as many events as will be read, and how many were read

    Raises UsageError for sensors of different sizes and recordings that have no time in common, DataError for files
    that cannot be read.
    """
    files = open_events(recording), open_events(reference)
    one, other = (_Side(str(path), survey(file)) for path, file in zip((recording, reference), files, strict=True))
    size = _size(one, other, *(file.size for file in files))
    check_bytes(one.path, PIXEL * size[0] * size[1], f"a comparison of {size[0]}x{size[1]} pixels")
    if align == "start":
        begins_us, other_us = _beginnings((one, other), files)
        other = replace(other, shift_us=begins_us - other_us)
    for side in (one, other):
        if max(map(abs, side.ends_us)) > LATEST_US:
            raise DataError(f"{side.path}: times beyond 63,000 years, which cannot be compared; the file is damaged")
    span_us = _common(one, other, files, window_us)
    tally = Tally(size, span_us, window_us=window_us)
    sides = one, other
    bands = _bands(sides, size, limit)
    progress = _Progress(sides, len(bands) + statistics, report)
    for rows in bands:
        a, b = (by_pixel(progress.noted(side.blocks(span_us)), size[0], rows) for side in sides)
        tally.add(a, b, rows)
    alone = None
    if statistics:
        of_one, of_other = (statistics_of(progress.noted(side.blocks(span_us)), size, span_us) for side in sides)
        alone = of_one, of_other
    comparison = tally.comparison()
    kept = comparison.events, comparison.reference_events
    left_out = one.recording.count - kept[0], other.recording.count - kept[1]
    warnings = [
        f"{side.path}: {text}" for side, file in zip(sides, files, strict=True) for text in dict.fromkeys(file.warnings)
    ]
    return Compared((one.path, other.path), comparison, left_out, other.shift_us, warnings, alone)


def _beginnings(sides: tuple[_Side, _Side], files: tuple[EventFile, EventFile]) -> list[int]:
    """When each begins by its own clock: as it says, or with its first event where one of them does not say, or counts
    from an instant long before that."""
    said = all(
        file.says_start and file.start_us == side.recording.start_us for side, file in zip(sides, files, strict=True)
    )
    return [side.recording.start_us if said else side.first_us for side in sides]


class _Progress:
    """Tells how many events were read."""

    def __init__(self, sides: tuple[_Side, _Side], passes: int, report: Report | None):
        count = passes * sum(side.recording.count for side in sides)
        self._all, self._done, self._report = replace(sides[0].recording, count=count), 0, report

    def noted(self, blocks: Iterator[Events]) -> Iterator[Events]:
        for events in blocks:
            yield events
            self._done += len(events)
            if self._report is not None:
                self._report(self._all, self._done)


def _size(
    one: _Side, other: _Side, one_stated: tuple[int, int] | None, other_stated: tuple[int, int] | None
) -> tuple[int, int]:
    """The size of both sensors: where a file does not state it, its events must fit that of the other."""
    sizes = one.recording.size, other.recording.size
    if one_stated is None and other_stated is None:
        return max(sizes[0][0], sizes[1][0]), max(sizes[0][1], sizes[1][1])
    size = one_stated or other_stated
    assert size is not None
    if any(stated not in (None, size) for stated in (one_stated, other_stated)) or any(
        found[0] > size[0] or found[1] > size[1] for found in sizes
    ):
        (w, h), (v, g) = sizes
        raise UsageError(f"{one.path} has {w}x{h} pixels, {other.path} {v}x{g}; compare recordings of one size")
    return size


def _common(one: _Side, other: _Side, files: tuple[EventFile, EventFile], window_us: int) -> tuple[int, int]:
    """The first and last instant that both have; a recording without events has any.  Where no file says when it
    begins, that is not when its clock was 0, which may be long before a camera recorded: the first event is."""
    sides = [(side, file) for side, file in zip((one, other), files, strict=True) if side.recording.count]
    ends = [side.ends_us for side, _ in sides] or [one.ends_us]
    starts, stops = zip(*ends, strict=True)
    start_us = min(starts) if max(starts) - min(starts) < window_us else max(starts)
    stop_us = max(stops) if max(stops) - min(stops) < window_us else min(stops)
    if start_us > stop_us:
        spans = [
            f"{path} {a / 1e6:.6f} ... {b / 1e6:.6f} s"
            for path, (a, b) in zip((one.path, other.path), ends, strict=True)
        ]
        raise UsageError(f"{' and '.join(spans)} have no time in common; --align start lays one beginning on the other")
    if sides and not any(file.says_start for _, file in sides):
        start_us = max(start_us, min(side.first_us for side, _ in sides))
    return start_us, stop_us


def _bands(sides: tuple[_Side, _Side], size: tuple[int, int], limit: int) -> list[range]:
    """The rows in bands that have at most `limit` events, or one row."""
    if sum(side.recording.count for side in sides) <= limit:
        return [range(size[1])]
    rows = np.zeros(size[1], np.int64)
    for side in sides:
        for events in side.recording.blocks():
            rows += np.bincount(events.y, minlength=size[1])
    bands, first, many = [], 0, 0
    for row, count in enumerate(rows.tolist()):
        if many + count > limit and row > first:
            bands.append(range(first, row))
            first, many = row, 0
        many += count
    return [*bands, range(first, size[1])]
