"""A gate for residues: closed where no event is near, so that what stands still stays untouched."""

from __future__ import annotations

import torch
from torch.nn import functional as F

from interp.networks.frame_fed import Pair

REACH_PX = 5  # events so far apart open the gate between them
STEEPNESS = 4.0


def gate_of(pair: Pair) -> torch.Tensor:
    """How much residue is let through, [B, 1, H, W], 0 ... 1: none where no event is near; all without events."""
    if not pair.seen:
        return torch.ones_like(pair.frame_0[:, :1])
    number = pair.events.off_on.float().sum((1, 2)).unsqueeze(1)
    near = F.avg_pool2d(number, REACH_PX, stride=1, padding=REACH_PX // 2)
    return 1 - torch.exp(-STEEPNESS * near)
