"""How many events there are up to each frame of the source."""

from __future__ import annotations

import numpy as np


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
