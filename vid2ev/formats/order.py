"""Events whose times go back, put in order.

Cameras and recorders send packets now and then a little late.  How far times go back (`Disorder`) is found in a first
reading; then events wait as long as an earlier one may still come, and no longer.  Events of one microsecond keep their
order.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vid2ev.stream.events import Events


class Disorder:
    """How far times go back, counted while blocks pass by: `places`, and `depth_us` below the latest time before."""

    def __init__(self) -> None:
        self.places = self.depth_us = 0
        self.latest_us: int | None = None
        self._last_us = 0

    def add(self, t: np.ndarray) -> None:
        """Count a block of times, at least one."""
        latest_us = int(t[0]) if self.latest_us is None else self.latest_us
        before = t[0] if self.latest_us is None else self._last_us
        self.places += int(np.count_nonzero(t[1:] < t[:-1])) + int(t[0] < before)
        latest = np.maximum(np.maximum.accumulate(t), latest_us)
        # (64 bits without a sign hold the difference of any two times)
        self.depth_us = max(self.depth_us, int((latest.view(np.uint64) - t.view(np.uint64)).max()))
        self.latest_us, self._last_us = int(latest[-1]), int(t[-1])


def ordered(blocks: Iterator[Events], depth_us: int) -> Iterator[Events]:
    """The events in order of time, if their times go back by at most depth_us."""
    if depth_us == 0:
        yield from blocks
        return
    waiting = Events.empty()
    for events in blocks:
        both = Events.concatenate([waiting, events])
        both = both.select(np.argsort(both.t, kind="stable"))
        ready = int(np.searchsorted(both.t, both.t[-1] - depth_us, side="right")) if len(both) else 0
        yield both.stretch(0, ready)
        waiting = both.stretch(ready, len(both))
    yield waiting
