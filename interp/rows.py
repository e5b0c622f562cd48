"""Laws that look at single pixels, some rows of a picture at a time.

What such a law makes on its way to its result is then as large as some rows are, however large the picture; and what
stays in the cache is made faster.  What gradients are asked of is kept anyhow, and taken as a whole.
"""

from __future__ import annotations

from collections.abc import Callable

import torch

AT_ONCE = 1 << 22  # values that are looked at at a time, 4 bytes each in float32: enough for all cores


def by_rows(law: Callable[[torch.Tensor], torch.Tensor], values: torch.Tensor, least: int = 1) -> torch.Tensor:
    """What a law makes of values [..., H, W]: of h of these rows [..., h, W].

    least   pieces; what would come in fewer is taken as a whole
    """
    rows = AT_ONCE * values.shape[-2] // values.numel() if values.ndim > 1 and values.numel() else 0
    if not 0 < rows * least < values.shape[-2] or values.is_cuda or values.requires_grad:
        return law(values)
    first = law(values[..., :rows, :])
    if first.requires_grad:
        return law(values)
    whole = first.new_empty(*first.shape[:-2], *values.shape[-2:])
    whole[..., :rows, :] = first
    for top in range(rows, values.shape[-2], rows):
        whole[..., top : top + rows, :] = law(values[..., top : top + rows, :])
    return whole
