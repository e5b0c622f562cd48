"""How many events there are up to each frame of the source; `frame_index.csv` says it beside files that do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import Recording
from vid2ev.untrusted import check_bytes, check_file

FRAME_INDEX, HEADER = "frame_index.csv", "t_us,events"


class FrameIndex:
    """Counts events while they pass by.

    frame_us  the instants of the frames, int64, ascending
    counts    how many events have t <= frame_us[k], uint64; true of all frames once the last event has passed
    """

    def __init__(self, frame_us: np.ndarray):
        self.frame_us, self.counts, self._known = frame_us, np.zeros(len(frame_us), np.uint64), 0

    def add(self, t: np.ndarray, start: int) -> None:
        """Count a block of times that begins at event `start`; a frame counts once a later event has come."""
        known = int(np.searchsorted(self.frame_us, t[-1])) if len(t) else self._known
        part = slice(self._known, known)
        self.counts[part] = start + np.searchsorted(t, self.frame_us[part], side="right")
        self._known = max(self._known, known)
        self.counts[self._known :] = start + len(t)


def write_frame_index(path: Path, recording: Recording) -> None:
    """The instants of the frames of the source, and the number of events up to each, as CSV: events number a ... b - 1
    are those of the interval between two frames with counts a and b.  Raises OSError."""
    assert recording.frame_us is not None
    index = FrameIndex(recording.frame_us)
    start = 0
    for events in recording.blocks():
        index.add(events.t, start)
        start += len(events)
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(f"{HEADER}\n")
        file.writelines(f"{t_us},{count}\n" for t_us, count in zip(index.frame_us, index.counts, strict=True))


def frame_times_beside(events: Path) -> np.ndarray | None:
    """The instants of the frames [us] that stand beside the event file of a recording; None if there are none.

    Raises DataError for a file that is no such index.
    """
    path = events.parent / FRAME_INDEX
    if not (events.name.startswith("events") and path.exists()):
        return None
    check_file(path)
    try:
        check_bytes(path, path.stat().st_size)
        head, *rows = path.read_text("utf-8").splitlines()
        times, counts = np.array([row.split(",") for row in rows] or np.empty((0, 2)), np.int64).T
    except (OSError, ValueError, OverflowError) as error:
        raise DataError(f"{path} cannot be read ({error}); convert again, or choose --by duration:10ms") from error
    later, more = np.diff(times), np.diff(counts)  # (of fast clips some frames have one microsecond)
    if head != HEADER or np.any((later < 0) | (more < 0) | ((later == 0) & (more > 0))):
        raise DataError(f"{path}: expected {HEADER}, and in later lines later times and no fewer events; convert again")
    return times
