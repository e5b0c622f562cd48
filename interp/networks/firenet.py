"""FireNet: pictures from events by two small recurrent layers at full resolution.

    conv3, ReLU -> ConvGRU -> residual block -> ConvGRU -> residual block -> conv1 (-> sigmoid)

Without an output that is bounded it is known to be unstable over long sequences; here it ends in a sigmoid unless
told otherwise.

Source: Scheerlinck et al. (2020), "Fast image reconstruction with an event camera", WACV.
"""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field
from torch import nn
from torch.nn import functional as F

from interp.blocks.recurrent import ConvGru
from interp.blocks.residual import Residual
from interp.networks.event_fed import EventFed, States
from interp.networks.spec import NetworkSpec


class FireNetSpec(NetworkSpec):
    """Options of FireNet; of size paper it has 37,777 parameters and 37.6 kMAC/px, and half of `base` channels."""

    bins: int = Field(
        default=5, ge=1, le=64, description="of a window of events: 144 parameters and 0.144 kMAC/px each"
    )
    output: Literal["sigmoid", "linear"] = Field(
        default="sigmoid", description="sigmoid: between 0 and 1; linear: the original's"
    )


class FireNet(EventFed):
    """FireNet."""

    multiple = 1
    around = 9

    def __init__(self, spec: FireNetSpec):
        super().__init__()
        self.spec = spec
        width = spec.base // 2
        self.head = nn.Conv2d(spec.bins, width, 3, padding=1)
        self.cells = nn.ModuleList(ConvGru(width, width) for _ in range(2))
        self.blocks = nn.ModuleList(Residual(width) for _ in range(2))
        self.out = nn.Conv2d(width, 1, 1)

    def step(self, voxels: torch.Tensor, states: States) -> tuple[torch.Tensor, States]:
        """An image of voxels of any size."""
        x = F.relu(self.head(voxels))
        after = []
        for cell, block, state in zip(self.cells, self.blocks, states or [None] * 2, strict=True):
            x, state = cell(x, state)
            x = block(x)
            after.append(state)
        image = self.out(x).float()
        return torch.sigmoid(image) if self.spec.output == "sigmoid" else image, tuple(after)
