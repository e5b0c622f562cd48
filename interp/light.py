"""Codes and linear light as tensors, with gradients: the curves of `vid2ev.light.transfer` that frames come in.

Codes below 0 are black; above 1 the curves go on.
"""

from __future__ import annotations

from typing import Literal

import torch

from interp.precision import in_full_precision
from vid2ev.light.transfer import SRGB_KNEE, SRGB_OFFSET, SRGB_POWER, SRGB_SLOPE
from vid2ev.stream.frames import LUMINANCE

Transfer = Literal["srgb", "linear"]


@in_full_precision
def to_light(codes: torch.Tensor, transfer: Transfer) -> torch.Tensor:
    """Linear light of codes; 1 is diffuse white."""
    codes = codes.clamp(min=0)
    if transfer == "linear":
        return codes
    steep = ((codes.clamp(min=SRGB_KNEE) + SRGB_OFFSET) / (1 + SRGB_OFFSET)) ** SRGB_POWER
    return torch.where(codes <= SRGB_KNEE, codes / SRGB_SLOPE, steep)


@in_full_precision
def to_codes(light: torch.Tensor, transfer: Transfer) -> torch.Tensor:
    """Codes of linear light."""
    light = light.clamp(min=0)
    if transfer == "linear":
        return light
    knee = SRGB_KNEE / SRGB_SLOPE
    # (the power of 0 has no slope: it is not taken where the straight part holds)
    steep = (1 + SRGB_OFFSET) * light.clamp(min=knee) ** (1 / SRGB_POWER) - SRGB_OFFSET
    return torch.where(light <= knee, light * SRGB_SLOPE, steep)


def luminance(light: torch.Tensor) -> torch.Tensor:
    """Luminance [..., 1, H, W] of light [..., 1 or 3, H, W]."""
    if light.shape[-3] == 1:
        return light
    return (light * light.new_tensor(LUMINANCE)[:, None, None]).sum(-3, keepdim=True)
