"""Flow refinement and visibility in one UNet, as Super SloMo has it.

dF_t0, dF_t1, V = UNet(I0, I1, F_01, F_10, F_t1, F_t0, g(I1, F_t1), g(I0, F_t0), ...)
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import nn

from interp.networks.frame_fed import Pair, run, warped
from interp.warp import flows_at


def refined(
    unet: nn.Module,
    pair: Pair,
    times: torch.Tensor,
    beside: Sequence[torch.Tensor],
    flow_scale: float,
    first: torch.Tensor | None = None,
    unsure: torch.Tensor | float = 1.0,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Refined flows at times [B, N, 4, H, W] px, both frames warped by them, and logits of what is visible.

    beside   what else the UNet takes, after its 8 channels of flows and four pictures
    first    flows at times to refine; those that the flows between the frames stand for unless given
    unsure   how much of what the UNet says counts, [B, N, 1, H, W], 0 ... 1
    """
    assert pair.flows is not None
    at = flows_at(pair.flows, times) if first is None else first
    warps = warped(pair, at)
    parts = [pair.frame_0, pair.frame_1, pair.flows, at[:, :, 2:], at[:, :, :2], warps[:, :, 1], warps[:, :, 0]]
    found = unsure * run(unet, [*parts, *beside])
    at = at + found[:, :, :4] * flow_scale
    return at, warped(pair, at), found[:, :, 4:]
