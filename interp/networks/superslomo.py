"""Super SloMo, and SloMoEvents, which is Super SloMo with events in its second UNet.

    F_01, F_10 = UNet(I0, I1)
    dF_t0, dF_t1, V0 = UNet(I0, I1, F_01, F_10, F_t1, F_t0, g(I1, F_t1), g(I0, F_t0), events)
    F_t0 += dF_t0,  F_t1 += dF_t1
    I_t = ((1 - t) V0 g(I0, F_t0) + t (1 - V0) g(I1, F_t1)) / ((1 - t) V0 + t (1 - V0))

with F_t0, F_t1 of `flows_at`.  The result is made of warped frames alone: it cannot be brighter or darker than they
are.

Sources: Jiang et al. (2018), "Super SloMo: high quality estimation of multiple intermediate frames for video
interpolation", CVPR; channels and kernels as in https://github.com/avinashpaliwal/Super-SloMo; events, Radomski et
al., section III.A.1.
"""

from __future__ import annotations

import torch
from pydantic import Field

from interp.blend import blend
from interp.blocks.unet import Unet, slomo_layout
from interp.networks.event_input import EventInput, EventInputSpec
from interp.networks.frame_fed import FrameFed, Interpolated, Pair, shares_at
from interp.networks.refinement import refined


class SuperSlomoSpec(EventInputSpec):
    """Options of Super SloMo and SloMoEvents."""

    recurrent: bool = Field(
        default=False,
        description="a GRU of 8 channels walks over the bins first: 2,041 parameters and 2.016 kMAC/px a bin, at"
        " any size",
    )


class SuperSlomo(FrameFed):
    """Super SloMo; with events SloMoEvents."""

    def __init__(self, spec: SuperSlomoSpec):
        super().__init__()
        self.spec: SuperSlomoSpec = spec
        colours, layout = spec.colours, slomo_layout(spec.base)
        self.event_input = EventInput(spec.events, spec.bins, spec.recurrent)
        self.flow = Unet(2 * colours, 4, layout, spec.zero_heads)
        self.refine = Unet(4 * colours + 8 + self.event_input.channels, 5, layout, spec.zero_heads)
        self.multiple = self.flow.multiple

    def flows_of(self, pair: Pair) -> torch.Tensor:
        """Flows between the frames."""
        return self.flow(torch.cat([pair.frame_0, pair.frame_1], 1)).float() * self.spec.flow_scale

    def computed_once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """The bins, if they are taken."""
        return self.event_input.once(pair)

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        events = self.event_input.at(pair, pair.once, times)
        found = refined(self.refine, pair, times, events, self.spec.flow_scale)
        logits = torch.cat([found.visible, torch.zeros_like(found.visible)], 2)
        image, weights = blend(found.warps, logits, shares_at(times))
        return Interpolated(image, pair.flows, found.flows, found.warps, weights, image, found.before)
