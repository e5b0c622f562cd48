"""HDR post-processing: a network that makes interpolated frames agree over time, and gives them the range that events
show.

    path A    the frame P_t, and its own last picture O_{t-1}      conv7, conv3 of stride 2
    path B    the events (or the frame before processing, and the one before that)      the same
    both      conv3 of stride 2, five residual blocks, ConvLSTM, nearest x2 and conv3 twice, conv7, tanh
    O_t = P_t + what comes out, in ratios of light (`interp.light`)

Only path A is joined on the way up, so that events, which look nothing like a picture, do not leak into it.  O_{t-1}
and the state of the LSTM carry no gradients from step to step.  Before the first frame O is taken to be that frame.

With events, P_t is the frame with what lies beyond its range carried on by them (`interp.candidates.beyond`), and what
comes out counts a tenth within the range, where there is only noise to mend.

Sources: Lai et al. (2018), "Learning blind video temporal consistency", ECCV, and its code,
https://github.com/phoenix104104/fast_blind_video_consistency (without normalisation, as its published model is);
events in path B, Radomski et al., section III.A.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from pydantic import Field
from torch import nn
from torch.nn import functional as F

from interp.blocks.recurrent import ConvLstm, State, detached
from interp.blocks.residual import Residual
from interp.candidates.beyond import carried
from interp.light import from_ratios, to_ratios
from interp.networks.spec import NetworkSpec
from interp.representation.event_counts import PER_VOXEL_NATS

SLOPE = 0.2
BLOCKS = 5
WITHIN = 0.1
MULTIPLE = 8  # sides of 8 at least, so that reflected borders fit
AROUND = 64  # px that a pixel of the residue sees around it: 59, on whole multiples


class HdrSpec(NetworkSpec):
    """Options of the HDR network; of size paper with frames in path B it has 2,979,555 parameters and 268 kMAC/px."""

    colours: Literal[1, 3] = Field(
        default=3,
        description="channels of a frame; a network of 3 takes grey frames, too, and one of 1 the planes of coloured"
        " ones as frames of their own. 1 saves 5 % of the cost for grey frames, with frames in path B 7 %",
    )
    second: Literal["events", "frames"] = Field(
        default="events",
        description="what path B sees: events (bins channels) or frames (twice as many channels as a frame)",
    )
    bins: int = Field(default=5, ge=1, le=64, description="of events: 1,568 parameters and 1.568 kMAC/px each")
    start: Literal["carried", "frame"] = Field(
        default="carried",
        description="what is corrected: the frame, with what lies beyond its range carried on by events where there"
        " are any; or as it is, the paper's; no parameters",
    )


Residue = Callable[[torch.Tensor, torch.Tensor, State], tuple[torch.Tensor, State]]


@dataclass(frozen=True, slots=True)
class HdrState:
    """What is kept from step to step, without gradients: the last output (ratios), the last frame of path B, the LSTM,
    the light that was carried."""

    output: torch.Tensor
    second: torch.Tensor
    cell: State
    carried: torch.Tensor


class Hdr(nn.Module):
    """The HDR network."""

    def __init__(self, spec: HdrSpec):
        super().__init__()
        self.spec = spec
        base, frames = spec.base, 2 * spec.colours
        self.into_a, self.down_a = _conv(frames, base, 7), _conv(base, 2 * base, 3, 2)
        self.into_b = _conv(spec.bins if spec.second == "events" else frames, base, 7)
        self.down_b = _conv(base, 2 * base, 3, 2)
        self.down = _conv(4 * base, 4 * base, 3, 2)
        self.middle = nn.Sequential(*(Residual(4 * base, SLOPE, True, "reflect") for _ in range(BLOCKS)))
        self.cell = ConvLstm(4 * base, 4 * base)
        self.up = nn.ModuleList([_conv(4 * base, 2 * base, 3), _conv(4 * base, base, 3)])
        self.out = _conv(2 * base, spec.colours, 7)
        nn.init.zeros_(self.out.weight)  # (it begins with what it corrects)
        nn.init.zeros_(self.out.bias)  # type: ignore[arg-type]

    def forward(
        self,
        frame: torch.Tensor,
        second: torch.Tensor,
        state: HdrState | None = None,
        limits: torch.Tensor | None = None,
        residue: Residue | None = None,
    ) -> tuple[torch.Tensor, HdrState]:
        """The picture O_t [B, C, H, W], light, for a frame P_t [B, C, H, W], and the state after it.

        second   events [B, bins, H, W], or the frame before processing [B, C, H, W]
        limits   [B, 2] light of the frame's lowest and highest code; 0 and 1 unless given
        residue  what is asked in place of `residue`, such as that in parts of large frames
        """
        height, width = frame.shape[-2:]
        edges = (0, -width % MULTIPLE, 0, -height % MULTIPLE)
        whole, with_events = F.pad(frame, edges, mode="replicate"), self.spec.second == "events"
        beside = F.pad(second, edges, mode="constant" if with_events else "replicate")
        share: torch.Tensor | float = 1.0
        if with_events and self.spec.start == "carried":
            change = PER_VOXEL_NATS * beside.float().sum(1, keepdim=True)
            whole, beyond = carried(whole, change, state.carried if state else None, limits)
            share = torch.where(beyond, 1.0, WITHIN)
        ratios = to_ratios(whole)
        before = state or HdrState(ratios.detach(), beside.detach(), (), whole.detach())
        path_b = beside if with_events else torch.cat([beside, before.second], 1)
        found, cell = (residue or self.residue)(torch.cat([ratios, before.output], 1), path_b, before.cell)
        output = ratios + share * found
        (kept,) = detached((cell,))
        assert kept is not None
        after = HdrState(output.detach(), beside.detach(), kept, whole.detach())
        return from_ratios(output)[..., :height, :width], after

    def residue(self, path_a: torch.Tensor, path_b: torch.Tensor, cell: State) -> tuple[torch.Tensor, State]:
        """What comes out [B, C, H, W] for both paths [B, ..., H, W], and the state of the LSTM.

        Pixels see `AROUND` others around them, so parts may be made one by one, which begin and end at multiples of 4.
        """
        first = _leaky(self.into_a(path_a))
        second = _leaky(self.down_a(first))
        beside = _leaky(self.down_b(_leaky(self.into_b(path_b))))
        x = self.middle(_leaky(self.down(torch.cat([second, beside], 1))))
        x, cell = self.cell(x, cell or None)
        for up, level in zip(self.up, (second, first), strict=True):
            x = torch.cat([_leaky(up(F.interpolate(x, scale_factor=2, mode="nearest"))), level], 1)
        return torch.tanh(self.out(x).float()), cell


def _conv(channels_in: int, channels_out: int, kernel: int, stride: int = 1) -> nn.Conv2d:
    return nn.Conv2d(channels_in, channels_out, kernel, stride, kernel // 2, padding_mode="reflect")


def _leaky(x: torch.Tensor) -> torch.Tensor:
    return F.leaky_relu(x, SLOPE)
