"""Frames of events: ON minus OFF in gray, as v2e shows them.

    frame[y, x] = (clip(N_ON - N_OFF, -F, F) + F) / 2F        float32 [height, width], 0 ... 1

No events is 0.5, F more ON than OFF events are white (1), F more OFF than ON are black (0).  F is v2e's
`--dvs_vid_full_scale`, 2 by default there and here (`renderer.py` of https://github.com/SensorsINI/v2e, which clips
after every packet of events; here it is once, at the end of the slice, so that packets do not matter).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.stream.events import Events, check_within


class Frame:
    """ON minus OFF events of a slice in gray; `full_scale` events are white."""

    tiles = (1, 1)
    dtype: np.dtype[Any] = np.dtype(np.float32)

    def __init__(self, size: tuple[int, int], full_scale: int = 2):
        self.size, self.full_scale = size, full_scale
        self.shape: tuple[int, ...] = (size[1], size[0])
        self._net = np.zeros(self.shape, np.int32)

    def add(self, events: Events, start_us: int = 0, stop_us: int = 0) -> None:
        """Add events, whatever their time."""
        check_within(events, self.size)
        _add(events.x, events.y, events.p, self._net)

    def take(self, stop_us: int = 0) -> np.ndarray:
        """The frame of the events since the last call."""
        net = np.clip(self._net.astype(np.int64), -self.full_scale, self.full_scale)  # (a scale may be beyond int32)
        self._net[:] = 0
        return ((net + self.full_scale) / (2 * self.full_scale)).astype(np.float32)

    def picture(self, array: np.ndarray) -> np.ndarray:
        """Gray."""
        return np.repeat(np.rint(255 * array).astype(np.uint8)[..., None], 3, axis=2)


@cached
def _add(x, y, p, net):  # type: ignore[no-untyped-def]
    for i in range(len(x)):
        net[y[i], x[i]] += 1 if p[i] else -1
