"""The structure of Time Lens, as a reference: flows from events alone, warps and a synthesis, weighed by attention.

    flow        F_t0 = UNet(events t -> 0),  F_t1 = UNet(events t -> 1)            one network, run twice
    fusion      S = UNet(events 0 -> t, I0, events t -> 1, I1)
    refinement  F_t1, F_t0 += UNet(g1, g0, S)                                      g_k = g(I_k, F_tk)
    attention   softmax of UNet(F_t1, g1', F_t0, g0', S, t) over g0', g1', S        g_k' with the refined flows

Numbers published for Time Lens are of its own weights; these are not they.  Flows are (x, y) here and (y, x) there.

Source: Tulyakov et al. (2021), "Time Lens: event-based video frame interpolation", CVPR; channels as in
https://github.com/uzh-rpg/rpg_timelens.
"""

from __future__ import annotations

import torch
from pydantic import Field

from interp.blend import blend
from interp.blocks.unet import Unet, slomo_layout
from interp.networks.frame_fed import FrameFed, Interpolated, Pair, run, shares_at, warped
from interp.networks.spec import FrameFedSpec


class TimeLensSpec(FrameFedSpec):
    """Options of Time Lens; of size paper it has 79.2 million parameters and 1,630 kMAC/px, all of it for every
    target."""

    bins: int = Field(
        default=5,
        ge=1,
        le=64,
        description="of events from the target to each frame: 4,704 parameters and 6.272 kMAC/px each",
    )


class TimeLens(FrameFed):
    """Time Lens."""

    def __init__(self, spec: TimeLensSpec):
        super().__init__()
        self.spec: TimeLensSpec = spec
        colours, bins, layout, zero = spec.colours, spec.bins, slomo_layout(spec.base), spec.zero_heads
        self.flow = Unet(bins, 2, layout, zero)
        self.fusion = Unet(2 * bins + 2 * colours, colours, layout)
        self.refine = Unet(3 * colours, 4, layout, zero)
        self.attention = Unet(3 * colours + 5, 3, layout, zero)
        self.multiple = self.flow.multiple

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        back, on = pair.events.halves(times, self.spec.bins).chunk(2, 2)
        at = torch.cat([run(self.flow, [back]), run(self.flow, [on])], 2) * self.spec.flow_scale
        fused = run(self.fusion, [-back.flip(2), pair.frame_0, on, pair.frame_1])
        first = warped(pair, at)
        change = run(self.refine, [first[:, :, 1], first[:, :, 0], fused]) * self.spec.flow_scale
        refined = at + torch.cat([change[:, :, 2:], change[:, :, :2]], 2)
        warps = warped(pair, refined)
        plane = times[..., None, None, None].expand_as(at[:, :, :1])
        parts = [at[:, :, 2:], warps[:, :, 1], at[:, :, :2], warps[:, :, 0], fused, plane]
        logits = run(self.attention, parts)
        pictures = torch.cat([warps, fused[:, :, None]], 2)
        image, weights = blend(pictures, logits, times.new_ones(*times.shape, 3))
        of_warps, _ = blend(warps, logits[:, :, :2], shares_at(times))
        return Interpolated(image, None, refined, warps, weights, of_warps)
