"""The voxel grid of events by themselves, as the papers have it: from the first event to the last unless it is told."""

from __future__ import annotations

import numpy as np

from vid2ev import Events
from vid2ev.views.voxel import Voxel


def voxel_grid(
    events: Events,
    size: tuple[int, int],
    bins: int = 5,
    start_us: int | None = None,
    stop_us: int | None = None,
    *,
    polarity: bool = False,
    normalised: bool = False,
) -> np.ndarray:
    """The voxel grid of events on a sensor of `size` (width, height), between two instants [us]."""
    grid = Voxel(size, bins, polarity=polarity, normalised=normalised)
    if len(events):
        first = int(events.t[0]) if start_us is None else start_us
        grid.add(events, first, int(events.t[-1]) if stop_us is None else stop_us)
    return grid.take()
