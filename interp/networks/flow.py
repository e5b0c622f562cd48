"""A network for optical flow alone: trained by DIS and by what its flows carry where, it serves others, frozen.

    F_01, F_10 = UNet(I0, I1, events)

It is U1 of RRIN, with the events between the frames if asked for.
"""

from __future__ import annotations

import torch
from pydantic import Field
from torch.nn import functional as F

from interp.blocks.unet import Unet, rrin_layout
from interp.networks.spec import FrameFedSpec
from interp.representation.event_counts import EventCounts


class FlowNetworkSpec(FrameFedSpec):
    """Options of the flow network."""

    levels: int = Field(
        default=5,
        ge=2,
        le=7,
        description="of 5: 10,992,292 parameters and 261 kMAC/px; of 4: 2.73 M and 201; it sees some 150 px"
        " around each, of 4 70",
    )
    bins: int = Field(
        default=0, ge=0, le=64, description="of events as input, 0 for none: 288 parameters and 0.288 kMAC/px each"
    )


class FlowNetwork(torch.nn.Module):
    """Flow from frames, and perhaps events, of any size."""

    def __init__(self, spec: FlowNetworkSpec):
        super().__init__()
        self.spec = spec
        self.unet = Unet(2 * spec.colours + spec.bins, 4, rrin_layout(spec.levels, spec.base), spec.zero_heads)
        self.multiple = self.unet.multiple

    def forward(self, frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts | None = None) -> torch.Tensor:
        """Flow [B, 4, H, W] px from the first frame [B, C, H, W] to the second (x, y), and back."""
        batch, _, height, width = frame_0.shape
        if events is None:
            events = EventCounts.none(batch, (height, width)).to(frame_0.device)
        right, below = -width % self.multiple, -height % self.multiple
        frames = torch.cat([frame_0, frame_1], 1)
        parts = [F.pad(frames, (0, right, 0, below), mode="replicate")]
        if self.spec.bins:
            parts.append(events.padded(right, below).whole(self.spec.bins))
        return self.unet(torch.cat(parts, 1)).float()[..., :height, :width] * self.spec.flow_scale
