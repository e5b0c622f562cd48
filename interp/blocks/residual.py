"""Residual blocks: two 3 x 3 convolutions, added to what they were given (He et al. (2016), CVPR; without
normalisation)."""

from __future__ import annotations

from typing import Literal

import torch
from torch import nn
from torch.nn import functional as F


class Residual(nn.Module):
    """x + conv(act(conv(x))), with a (leaky) ReLU in the middle and, unless `open_end`, one after the sum."""

    def __init__(
        self,
        channels: int,
        slope: float = 0.0,
        open_end: bool = False,
        padding_mode: Literal["zeros", "reflect"] = "zeros",
    ):
        super().__init__()
        self.slope, self.open_end = slope, open_end
        self.first, self.second = (
            nn.Conv2d(channels, channels, 3, padding=1, padding_mode=padding_mode) for _ in range(2)
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """[B, channels, H, W] of the same."""
        x = x + self.second(F.leaky_relu(self.first(x), self.slope))
        return x if self.open_end else F.leaky_relu(x, self.slope)
