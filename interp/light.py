"""Codes and linear light as tensors, with gradients: the curves of `vid2ev.light.transfer` that frames come in.

Codes below 0 are black; above 1 the curves go on.

    ratios    ln(1 + 1000 L) / ln(1001), for light of any range: ratios count alike in the dark and in the bright, down
              to a thousandth of diffuse white; below 0 it goes on straight

Source of the last: Kalantari and Ramamoorthi (2017), "Deep high dynamic range imaging of dynamic scenes", ACM Trans.
Graphics 36(4), with 5000, which lets the noise of dark pixels decide.
"""

from __future__ import annotations

import math
from typing import Literal

import torch

from interp.precision import in_full_precision
from interp.rows import by_rows
from vid2ev.light.transfer import SRGB_KNEE, SRGB_OFFSET, SRGB_POWER, SRGB_SLOPE
from vid2ev.stream.frames import LUMINANCE

RATIOS = 1000.0
PIECES = 4  # of smaller pictures the curves are faster at once
Transfer = Literal["srgb", "linear"]


@in_full_precision
def to_light(codes: torch.Tensor, transfer: Transfer) -> torch.Tensor:
    """Linear light of codes; 1 is diffuse white."""
    return codes.clamp(min=0) if transfer == "linear" else by_rows(_srgb_light, codes, PIECES)


@in_full_precision
def to_codes(light: torch.Tensor, transfer: Transfer) -> torch.Tensor:
    """Codes of linear light."""
    return light.clamp(min=0) if transfer == "linear" else by_rows(_srgb_codes, light, PIECES)


@in_full_precision
def to_ratios(light: torch.Tensor) -> torch.Tensor:
    """Light of any range, evenly in ratios: 0 is black, 1 diffuse white."""
    return torch.where(light > 0, torch.log1p(RATIOS * light.clamp(min=0)), RATIOS * light) / math.log1p(RATIOS)


@in_full_precision
def from_ratios(ratios: torch.Tensor) -> torch.Tensor:
    """The light again."""
    nats = ratios * math.log1p(RATIOS)
    return torch.where(nats > 0, torch.expm1(nats.clamp(min=0)), nats) / RATIOS


def luminance(light: torch.Tensor) -> torch.Tensor:
    """Luminance [..., 1, H, W] of light [..., 1 or 3, H, W]."""
    if light.shape[-3] == 1:
        return light
    red, green, blue = (
        channel * share for channel, share in zip(light.split(1, -3), light.new_tensor(LUMINANCE), strict=True)
    )
    return (red + green).add_(blue)


def grey(codes: torch.Tensor, transfer: Transfer = "srgb") -> torch.Tensor:
    """Codes [..., 1, H, W] of the luminance of codes [..., 1 or 3, H, W]."""
    return to_codes(luminance(to_light(codes, transfer)), transfer)


def _srgb_light(codes: torch.Tensor) -> torch.Tensor:
    codes = codes.clamp(min=0)
    steep = ((codes.clamp(min=SRGB_KNEE) + SRGB_OFFSET) / (1 + SRGB_OFFSET)) ** SRGB_POWER
    return torch.where(codes <= SRGB_KNEE, codes / SRGB_SLOPE, steep)


def _srgb_codes(light: torch.Tensor) -> torch.Tensor:
    light, knee = light.clamp(min=0), SRGB_KNEE / SRGB_SLOPE
    # (the power of 0 has no slope: it is not taken where the straight part holds)
    steep = (1 + SRGB_OFFSET) * light.clamp(min=knee) ** (1 / SRGB_POWER) - SRGB_OFFSET
    return torch.where(light <= knee, light * SRGB_SLOPE, steep)
