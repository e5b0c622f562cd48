"""RRINSloMoEvents, the combined system: RRINEvents' residue after Super SloMo's flow refinement and visibility in one
network.

    F_01, F_10 = flow(I0, I1, events?)                                   own, trained before and frozen, or DIS
    F_t0, F_t1 = of these, or by the light that events tell, C           `guide.py`; V then of what agrees as well
    dF_t0, dF_t1, V0, V1 = UNet(I0, I1, F_01, F_10, F_t1, F_t0, g1, g0, C?, events, reconstructions?)
    J = ((1 - t) V0 g0 + t V1 g1) / ((1 - t) V0 + t V1)                  V = sigmoid of what the UNet says; if C guides,
                                                                         or D, what frames say alone, if that is nearer
    I_t = J + UNet(I0, I1, J)                                            if refine is unet
        = C' + m (J - C') + 3 s tanh(UNet(I0, I1, J, C', events, c, j))  if C guides

Source: Radomski et al., section III.A.3; depths are not given there: 5 levels for flow, 4 for the combined UNet, 3
for the others.
"""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field
from torch import nn
from torch.nn import functional as F

from interp.blend import blend
from interp.blocks.frozen import Frozen
from interp.blocks.unet import Unet, rrin_layout
from interp.candidates.ramps import RISEN_CHANNELS
from interp.light import Transfer
from interp.networks.e2vid import E2vid, E2vidSpec
from interp.networks.event_input import EventInput, EventInputSpec, first_last_and_target
from interp.networks.firenet import FireNet, FireNetSpec
from interp.networks.flow import FlowNetwork, FlowNetworkSpec
from interp.networks.frame_fed import FrameFed, Interpolated, Pair, run, shares_at, sought
from interp.networks.gate import gate_of
from interp.networks.guide import OFFS, Guide, guide_of
from interp.networks.refinement import refined

MULTIPLE = 16  # of sides: five levels of flow
SUB_BINS = 5  # of the window that a reconstruction is made of
Weights = Literal["own", "pretrained"]


class RrinSlomoEventsSpec(EventInputSpec):
    """Options of RRINSloMoEvents; by default 14.4 million parameters and 611 kMAC/px at size paper."""

    flow_input: Literal["frames", "frames+events"] = Field(
        default="frames",
        description="of the flow network, where there is one: all bins as well; 288 parameters and 0.288 kMAC/px a bin,"
        " once per pair",
    )
    flow: Literal[Weights, "dis", "guided"] = Field(
        default="own",
        description="pretrained: weights of the network `flow`, frozen; training takes about a third less time; dis:"
        " the optical flow of DIS between the frames, on the CPU, 0.43 s per pair at 1280x720; guided: that, and from"
        " each target to both frames the motion, and what agrees, by the light that events tell, as long again for"
        " each target; untrained it is the closed form `guided`, and only what that is not sure of is changed",
    )
    prepare: Literal["none", "unet"] = Field(
        default="none",
        description="a UNet of 3 levels changes the bins by what both frames show: 0.67 M parameters and 144 kMAC/px,"
        " for bins once per pair, for halves for each target",
    )
    refine: Literal["none", "unet"] = Field(
        default="unet",
        description="the UNet of the residue, of 3 levels: 667,875 parameters and 142 kMAC/px; none: no colours"
        " and no dynamic range that warped frames do not have",
    )
    reconstruct: Literal["none", "firenet", "e2vid"] = Field(
        default="none",
        description="a picture from events alone per bin, first, last and target as input: firenet 38 k parameters and"
        " 38 kMAC/px, e2vid 10.7 M and 454, times the number of bins, once per pair",
    )
    transfer: Transfer = Field(
        default="srgb",
        description="how the frames are coded, for flow dis and guided: srgb, as all commands have them, or linear, for"
        " Python; free",
    )
    reconstruct_weights: Weights = Field(default="own", description="pretrained: weights of that network, frozen")

    @property
    def takes_events(self) -> bool:
        into_flow = self.flow_input != "frames" and self.flow != "dis"
        return super().takes_events or into_flow or self.guided or self.reconstruct != "none"

    @property
    def guided(self) -> bool:
        return self.flow == "guided"


class RrinSlomoEvents(FrameFed):
    """RRINSloMoEvents; pretrained parts are loaded with `interp.weights.load_part`."""

    def __init__(self, spec: RrinSlomoEventsSpec):
        super().__init__()
        self.spec: RrinSlomoEventsSpec = spec
        colours, zero = spec.colours, spec.zero_heads
        self.flow = None if spec.flow in ("dis", "guided") else self._flow()
        self.event_input = EventInput(spec.events, spec.bins, prepare=self._prepare if spec.prepare == "unet" else None)
        self.reconstruct = self._reconstruct()
        pictures = 0 if self.reconstruct is None else 3
        channels = 4 * colours + spec.guided * colours + 8 + self.event_input.channels + pictures
        self.combined = Unet(channels, 6, rrin_layout(4, spec.base), zero)
        taken, said = 3 * colours + spec.guided * (colours + RISEN_CHANNELS + OFFS), colours + spec.guided
        self.residue = Unet(taken, said, rrin_layout(3, spec.base), zero) if spec.refine == "unet" else None
        self.multiple = MULTIPLE

    @property
    def seeks_motion(self) -> bool:
        """See `FrameFed`."""
        return self.flow is None

    def flows_of(self, pair: Pair) -> torch.Tensor:
        """Flows between the frames."""
        if self.flow is None:
            return sought(pair, self.spec.transfer)
        return self.flow(pair.frame_0, pair.frame_1, pair.events)

    def computed_once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """Reconstructions, if there are, and then bins, if they are taken."""
        pictures = () if self.reconstruct is None else (self._pictures(pair),)
        return (*pictures, *self.event_input.once(pair))

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        once, beside = pair.once, []
        if self.reconstruct is not None:
            beside, once = [first_last_and_target(once[0], times)], once[1:]
        events = self.event_input.at(pair, once, times)
        if self.spec.guided:
            return self._guided(
                pair, times, guide_of(pair, times, self.spec.transfer, gate_of(pair)), [*events, *beside]
            )
        at, warps, visible, _ = refined(self.combined, pair, times, [*events, *beside], self.spec.flow_scale)
        carried, weights = blend(warps, F.logsigmoid(visible), shares_at(times))
        image = carried
        if self.residue is not None:
            image = image + run(self.residue, [pair.frame_0, pair.frame_1, image])
        return Interpolated(image, pair.flows, at, warps, weights, carried)

    def _guided(self, pair: Pair, times: torch.Tensor, guide: Guide, beside: list[torch.Tensor]) -> Interpolated:
        """Images at times [B, N], from the closed form on."""
        beside, scale = [guide.light, *beside], self.spec.flow_scale
        at, warps, visible, _ = refined(
            self.combined, pair, times, beside, scale, guide.flows, guide.unsure, cubic=True
        )
        warped_mix, weights = blend(warps, F.logsigmoid(visible) + guide.agreement(warps), shares_at(times))
        carried, agreed = guide.nearer(warped_mix)
        start, off = guide.coloured(carried), guide.carried_off_by(agreed)
        said = torch.zeros_like(start[:, :, :1]).expand(-1, -1, start.shape[2] + 1, -1, -1)
        if self.residue is not None:
            seen = torch.cat([guide.found.channels(), guide.offs(off)], 2)
            said = run(self.residue, [pair.frame_0, pair.frame_1, carried, start, seen])
        image = guide.image(start, carried, off, said)
        return Interpolated(image, pair.flows, at, warps, weights, warped_mix)

    def _flow(self) -> nn.Module:
        spec, bins = self.spec, self.spec.bins if self.spec.flow_input == "frames+events" else 0
        network = FlowNetwork(
            FlowNetworkSpec(
                size=spec.size, colours=spec.colours, bins=bins, flow_scale=spec.flow_scale, zero_heads=spec.zero_heads
            )
        )
        return Frozen(network) if spec.flow == "pretrained" else network

    def _prepare(self, channels: int) -> nn.Module:
        return Unet(2 * self.spec.colours + channels, channels, rrin_layout(3, self.spec.base), self.spec.zero_heads)

    def _reconstruct(self) -> nn.Module | None:
        if self.spec.reconstruct == "none":
            return None
        size = self.spec.size
        network = (
            E2vid(E2vidSpec(size=size, bins=SUB_BINS))
            if self.spec.reconstruct == "e2vid"
            else FireNet(FireNetSpec(size=size, bins=SUB_BINS))
        )
        return Frozen(network) if self.spec.reconstruct_weights == "pretrained" else network

    def _pictures(self, pair: Pair) -> torch.Tensor:
        """A picture per bin, from the events up to its end: [B, bins, H, W]."""
        edges = torch.arange(self.spec.bins + 1, device=pair.frame_0.device) / self.spec.bins
        edges = edges.expand(len(pair.frame_0), -1)
        windows = pair.events.voxels(edges[:, :-1], edges[:, 1:], SUB_BINS)
        states, images = (), []
        for window in windows.unbind(1):
            assert self.reconstruct is not None
            image, states = self.reconstruct(window, states)
            images.append(image)
        return torch.cat(images, 1)
