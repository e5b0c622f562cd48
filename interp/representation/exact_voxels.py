"""Voxel grids with the exact times of events: what recurrent networks take, window after window."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from interp.representation.event_counts import USUAL_NATS, as_voxels
from vid2ev.errors import UsageError
from vid2ev.sensors.limits import is_whole

if TYPE_CHECKING:
    from vid2ev import Events


def exact_voxels(
    events: Events,
    size: tuple[int, int],
    start_us: int,
    stop_us: int,
    bins: int = 5,
    contrast: tuple[float, float] = (USUAL_NATS, USUAL_NATS),
) -> torch.Tensor:
    """The voxel grid [bins, H, W] of the events in (start_us, stop_us] on a sensor of `size` (width, height).

    contrast   nats that an OFF and an ON event stand for
    In the units of `EventCounts`.  Raises UsageError for less than one bin, ValueError for events outside of the
    sensor.
    """
    from vid2ev.views.voxel import voxel_grid

    if not is_whole(bins, 1):
        raise UsageError(f"{bins} bins between two instants: expected at least 1; choose for example 5")
    kept = events.select((events.t > start_us) & (events.t <= stop_us))
    off, on = voxel_grid(kept, size, bins, start_us, stop_us, polarity=True)
    return as_voxels(torch.from_numpy(np.float32(contrast[1]) * on - np.float32(contrast[0]) * off))
