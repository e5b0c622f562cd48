"""Gates for what networks add: closed where no event is near, so that what stands still stays untouched; and where
the light that events tell and what was carried there agree, so that what is right stays right."""

from __future__ import annotations

import torch
from torch.nn import functional as F

from interp.candidates.guided import agreement, carried_off_by, off_by, part_of
from interp.candidates.ramps import Risen, in_doubt
from interp.light import Transfer
from interp.networks.frame_fed import Pair, warped

REACH_PX = 5  # events so far apart open the gate between them
STEEPNESS = 4.0


def gate_of(pair: Pair) -> torch.Tensor:
    """How much residue is let through, [B, 1, H, W], 0 ... 1: none where no event is near; all without events."""
    if not pair.seen:
        return torch.ones_like(pair.frame_0[:, :1])
    number = pair.events.off_on.float().sum((1, 2)).unsqueeze(1)
    near = F.avg_pool2d(number, REACH_PX, stride=1, padding=REACH_PX // 2)
    return 1 - torch.exp(-STEEPNESS * near)


def doubts(
    pair: Pair, candidate: torch.Tensor, found: Risen, flows: torch.Tensor, times: torch.Tensor, transfer: Transfer
) -> tuple[torch.Tensor, torch.Tensor]:
    """c^2 of the ramps at times [B, N], and how far frames carried by these flows are not to be believed beside them:
    j^2 / (c^2 + j^2), 0 ... 1.  Both [B, N, 1, H, W]."""
    wrong, _ = off_by(candidate, in_doubt(pair.frame_0, pair.frame_1, found, times, transfer), transfer)
    carried = carried_off_by(agreement(warped(pair, flows), candidate, transfer), wrong)
    return wrong, part_of(carried, wrong).detach()
