"""Voxel grids with the exact times of events, in the units of networks."""

from __future__ import annotations

import numpy as np
import torch
from voxel_grid import voxel_grid

from interp.representation.event_counts import USUAL_NATS, as_voxels
from vid2ev import Events


def exact_voxels(
    events: Events,
    size: tuple[int, int],
    start_us: int,
    stop_us: int,
    bins: int = 5,
    contrast: tuple[float, float] = (USUAL_NATS, USUAL_NATS),
) -> torch.Tensor:
    """[bins, H, W] of the events in (start_us, stop_us] on a sensor of `size` (width, height)."""
    kept = events.select((events.t > start_us) & (events.t <= stop_us))
    off, on = voxel_grid(kept, size, bins, start_us, stop_us, polarity=True)
    return as_voxels(torch.from_numpy(np.float32(contrast[1]) * on - np.float32(contrast[0]) * off))
