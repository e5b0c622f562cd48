"""A part of an event file as a recording: from one instant to another, both in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from vid2ev.formats import DEEPEST_US, survey
from vid2ev.formats.event_file import BLOCK, EventFile, Picture, Recording
from vid2ev.stream.events import Events

LONG_US = 1_000_000  # a silence that says that a file counts from another instant than it begins
LONG_UNSAID_US = 100_000  # the same where the file does not say from which, and has no frames


def beginning_us(file: EventFile) -> int:
    """Where a recording begins: where its file counts from, but with the first event if that comes a second later, or a
    tenth of one where nothing says from when the file counts.

    Files of cameras often count from when the camera was switched on.  Some events come late: the first is the earliest
    of the first million.
    """
    long_us = LONG_US if file.says_start or file.has_frames else LONG_UNSAID_US
    first = next((int(events.t.min()) for events in file.events() if len(events)), file.start_us)
    return first if first - file.start_us > long_us else min(first, file.start_us)


def window(
    file: EventFile,
    start_us: int,
    stop_us: int | None = None,
    *,
    as_seen: bool = False,
    frame_us: np.ndarray | None = None,
) -> Recording:
    """The events and frames with start_us <= t <= stop_us.

    It ends with the last of these.  Reads all of the events once; raises as `survey` does.

    as_seen   with the last frame before them, too: it is what is seen as they begin
    frame_us  the instants of frames, of a file that does not say them
    """
    return survey(_Window(file, start_us, stop_us, as_seen, frame_us))


def with_frame_times(recording: Recording) -> Recording:
    """The recording with the instants of its frames, if it has any; reads the frames once."""
    if recording.frames is None or recording.frame_us is not None:
        return recording
    return replace(recording, frame_us=np.array([picture.t_us for picture in recording.frames()], np.int64))


class _Window:
    """An event file of which only a part is there."""

    def __init__(self, file: EventFile, start_us: int, stop_us: int | None, as_seen: bool, frame_us: np.ndarray | None):
        self._file, self.start_us, self._stop_us, self._as_seen = file, start_us, stop_us, as_seen
        self.path, self.size, self.labelled, self.has_frames = file.path, file.size, file.labelled, file.has_frames
        self.says_start, self.warnings, self.describe = True, file.warnings, file.describe
        known: np.ndarray | None = getattr(file, "frame_us", None)
        known = frame_us if known is None else known
        self.frame_us = None if known is None else known[(known >= start_us) & ~self._is_later(known)]

    def events(self, start_us: int | None = None, stop_us: int | None = None, block: int = BLOCK) -> Iterator[Events]:
        assert start_us is None and stop_us is None
        return self._file.events(self.start_us, None if self._stop_us is None else self._stop_us + 1, block)

    def frames(self) -> Iterator[Picture]:
        before: Picture | None = None
        for picture in self._file.frames():
            if self._is_later(picture.t_us):
                if self._is_later(picture.t_us - DEEPEST_US):
                    break
                continue  # (their times may go back)
            if picture.t_us < self.start_us:
                before = picture
                continue
            if before is not None and self._as_seen:
                yield before
            before = None
            yield picture
        if before is not None and self._as_seen:
            yield before

    def _is_later(self, t_us: Any) -> Any:
        return t_us > (np.inf if self._stop_us is None else self._stop_us)
