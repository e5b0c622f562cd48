"""Flow refinement and visibility in one UNet, as Super SloMo has it.

dF_t0, dF_t1, V = UNet(I0, I1, F_01, F_10, F_t1, F_t0, g(I1, F_t1), g(I0, F_t0), ...)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import nn

from interp.networks.frame_fed import Pair, run, warped
from interp.warp import flows_at


class Refined(NamedTuple):
    """What a refinement comes to, at N times.

    flows    [B, N, 4, H, W] px
    warps    [B, N, 2, C, H, W]: both frames, warped by these
    visible  [B, N, 1, H, W] logits
    before   [B, N, 2, C, H, W]: both frames, warped by the flows that were refined
    """

    flows: torch.Tensor
    warps: torch.Tensor
    visible: torch.Tensor
    before: torch.Tensor


def refined(
    unet: nn.Module,
    pair: Pair,
    times: torch.Tensor,
    beside: Sequence[torch.Tensor],
    flow_scale: float,
    first: torch.Tensor | None = None,
    unsure: torch.Tensor | float = 1.0,
    *,
    cubic: bool = False,
) -> Refined:
    """Refined flows at times [B, N], both frames warped by them, and what is visible.

    beside   what else the UNet takes, after its 8 channels of flows and four pictures
    first    flows at times to refine; those that the flows between the frames stand for unless given
    unsure   how much of what the UNet says counts, [B, N, 1, H, W], 0 ... 1
    cubic    how frames are seen between their pixels (`warp.py`)
    """
    assert pair.flows is not None
    at = flows_at(pair.flows, times) if first is None else first
    warps = warped(pair, at, cubic=cubic)
    parts = [pair.frame_0, pair.frame_1, pair.flows, at[:, :, 2:], at[:, :, :2], warps[:, :, 1], warps[:, :, 0]]
    found = unsure * run(unet, [*parts, *beside])
    at = at + found[:, :, :4] * flow_scale
    return Refined(at, warped(pair, at, cubic=cubic), found[:, :, 4:], warps)
