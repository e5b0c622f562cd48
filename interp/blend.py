"""Blends: pictures of the same instant, weighed pixel by pixel.

    I = sum_k w_k I_k        w = softmax_k(l_k + ln s_k)

l are logits and s shares that are known beforehand, such as 1 - t and t of what comes from two frames.  In logarithms
there is no denominator, so nothing is divided by 0 where a mask saturates, or where t is 0 or 1.  With l =
ln(sigmoid(m)) it is RRIN's (1 - t) V0 I0 + t V1 I1 over (1 - t) V0 + t V1, V = sigmoid(m); with l = (m, 0) Super
SloMo's, whose V1 is 1 - V0.
"""

from __future__ import annotations

import torch

from interp.precision import in_full_precision


@in_full_precision
def blend(images: torch.Tensor, logits: torch.Tensor, shares: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """The blend [..., C, H, W] of K pictures, and their weights [..., K, H, W].

    images [..., K, C, H, W]; logits [..., K, H, W]; shares [..., K], at least 0 and not all 0.
    Pictures that are alike are the blend to the bit.
    """
    weights = torch.softmax(logits + torch.log(shares)[..., None, None], dim=-3)
    first = images.narrow(-4, 0, 1)
    others = weights.unsqueeze(-3).narrow(-4, 1, weights.shape[-3] - 1)
    rest = images.narrow(-4, 1, images.shape[-4] - 1)
    return (first + (others * (rest - first)).sum(-4, keepdim=True)).squeeze(-4), weights
