"""Whether images agree over time as the scene does.

    mean of M |O_t - g(O_s, F_ts)|        M = exp(-50 sum_c (I_t - g(I_s, F_ts))_c^2)

I are true frames, O images made, F_ts the flow from the later to the earlier: M is near 0 where the flow leads to
something else. The difference is not divided by the brightness, which would be huge where it is dark, and colours are
squared before they are added, so that red and green errors do not cancel.  M is meant for codes from 0 to 1: of 255
times that it would be 0 everywhere, and so would the loss.

Source: Lai et al. (2018), "Learning blind video temporal consistency", ECCV.
"""

from __future__ import annotations

import torch

from interp.precision import in_full_precision
from interp.warp import warp
from vid2ev.errors import UsageError

STEEPNESS = 50.0
LARGEST_CODE = 32.0  # codes of HDR frames may be above 1, those of 8-bit frames are above this


def check_codes(frames: torch.Tensor) -> None:
    """Raise UsageError for codes of frames, of any shape, that are not from 0 to about 1.  A GPU is waited for."""
    largest = float(frames.detach().abs().amax())
    if largest > LARGEST_CODE:
        raise UsageError(f"frames with codes up to {largest:g}: expected 0 ... 1; divide them by their full code")


@in_full_precision
def visibility(frame: torch.Tensor, earlier: torch.Tensor, flow: torch.Tensor) -> torch.Tensor:
    """M [B, 1, H, W] for true frames [B, C, H, W], 0 ... 1 (`check_codes`), and the flow [B, 2, H, W] px from the later
    to the earlier."""
    return torch.exp(-STEEPNESS * ((frame - warp(earlier, flow)) ** 2).sum(1, keepdim=True))


@in_full_precision
def inconsistency(
    image: torch.Tensor,
    earlier: torch.Tensor,
    flow: torch.Tensor,
    seen: torch.Tensor,
    through_earlier: bool = False,
) -> torch.Tensor:
    """How far an image is from an earlier one, carried along the flow, where it is `seen`.

    through_earlier   whether gradients go through the earlier image as well
    """
    carried = warp(earlier if through_earlier else earlier.detach(), flow)
    return (seen * (image - carried).abs()).mean()
