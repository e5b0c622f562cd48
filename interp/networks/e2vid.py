"""E2VID: pictures from events, by a recurrent UNet.

    head      conv5                                    full resolution
    down      conv5 of stride 2, ReLU, ConvLSTM        three times, twice the channels each
    middle    two residual blocks
    up        bilinear x2, conv5 of the sum with the level on the way down, ReLU
    out       conv1 of the sum with the head, sigmoid

Source: Rebecq et al. (2019), "High speed and high dynamic range video with an event camera", TPAMI; channels as in
https://github.com/uzh-rpg/rpg_e2vid (lightweight), without normalisation.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from pydantic import Field
from torch import nn
from torch.nn import functional as F

from interp.blocks.recurrent import ConvLstm
from interp.blocks.residual import Residual
from interp.networks.event_fed import EventFed, States
from interp.networks.spec import NetworkSpec

LEVELS = 3


class E2vidSpec(NetworkSpec):
    """Options of E2VID; of size paper it has 10,710,401 parameters and 454 kMAC/px."""

    bins: int = Field(default=5, ge=1, le=64, description="of a window of events: 800 parameters and 0.8 kMAC/px each")


class E2vid(EventFed):
    """E2VID; `step` gives images between 0 and 1."""

    multiple = 1 << LEVELS
    around = 96

    def __init__(self, spec: E2vidSpec):
        super().__init__()
        self.spec = spec
        widths = [spec.base << level for level in range(LEVELS + 1)]
        self.head = nn.Conv2d(spec.bins, widths[0], 5, padding=2)
        levels = list(pairwise(widths))
        self.down = nn.ModuleList(nn.Conv2d(upper, lower, 5, stride=2, padding=2) for upper, lower in levels)
        self.cells = nn.ModuleList(ConvLstm(lower, lower) for _, lower in levels)
        self.middle = nn.Sequential(Residual(widths[-1]), Residual(widths[-1]))
        self.up = nn.ModuleList(nn.Conv2d(lower, upper, 5, padding=2) for upper, lower in levels[::-1])
        self.out = nn.Conv2d(widths[0], 1, 1)

    def step(self, voxels: torch.Tensor, states: States) -> tuple[torch.Tensor, States]:
        """An image of voxels, sides multiples of 8."""
        head = x = F.relu(self.head(voxels))
        levels, after = [], []
        for down, cell, state in zip(self.down, self.cells, states or [None] * LEVELS, strict=True):
            x, state = cell(F.relu(down(x)), state)
            levels.append(x)
            after.append(state)
        x = self.middle(x)
        for up, level in zip(self.up, levels[::-1], strict=True):
            x = F.relu(up(F.interpolate(x + level, scale_factor=2, mode="bilinear", align_corners=False)))
        return torch.sigmoid(self.out(x + head).float()), tuple(after)
