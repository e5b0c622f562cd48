"""Two resolutions in one network: that of the frames, and one of 1 / factor where most of the work is done."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch.nn import functional as F

from interp.precision import in_full_precision


@dataclass(frozen=True, slots=True)
class Scale:
    """How to go from one resolution to the other and back; with a factor of 1 nothing changes."""

    factor: int

    def down(self, pictures: torch.Tensor) -> torch.Tensor:
        """Means over squares of pixels, [..., C, h, w] of pictures [..., C, H, W]."""
        return pictures if self.factor == 1 else _means(pictures, self.factor)

    def up(self, pictures: torch.Tensor) -> torch.Tensor:
        """Bilinear, [..., C, H, W] of pictures [..., C, h, w]."""
        return pictures if self.factor == 1 else _enlarged(pictures, self.factor)

    def flow_up(self, flow: torch.Tensor) -> torch.Tensor:
        """Flow in pixels of the frames, of one in pixels of the lower resolution."""
        return self.up(flow) * self.factor


@in_full_precision
def _means(pictures: torch.Tensor, factor: int) -> torch.Tensor:
    return F.avg_pool2d(pictures.flatten(0, -4), factor).unflatten(0, pictures.shape[:-3])


@in_full_precision
def _enlarged(pictures: torch.Tensor, factor: int) -> torch.Tensor:
    larger = F.interpolate(pictures.flatten(0, -4), scale_factor=factor, mode="bilinear", align_corners=False)
    return larger.unflatten(0, pictures.shape[:-3])
