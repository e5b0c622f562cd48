"""RRINEvents guided by light: what is known in closed form first, and networks for what is left.

    C    = ramps(I0, I1, events)                            luminance at the target, from events (`candidates/ramps.py`)
    F_tk = DIS(C -> I_k) + (1 - m) U2(F_t0, F_t1, I0, I1, C, events)
    J0   = sum_k w_k g(I_k, F_tk)     w_k ~ s_k exp(a_k) V_k     V = sigmoid(U3(F, I0, I1, g0, g1, C, events))^(1 - m)
    J    = of J0 and what both frames say alone, by which is nearer to C
    I_t  = C' + m (J - C') + 3 s tanh(r)      C' = C in the colours of J      r, n = U4(I0, I1, J, C', events, c, j)
    m    = c^2 / (c^2 + j^2 e^-n)                  1/s^2 = 1/c^2 + 1/j^2

It has U2, U3 and U4 of RRINEvents, and in place of U1, which would have to learn optical flow, the flow of
`candidates/guided.py` from the target itself; a_k says how far luminance is off there.  c and j are what C and J may
be off by there, s the mix of both: n says which of the two to believe more, and r what is missing, in units of what
can be missing.  Untrained it is that closed form, and where that is sure of itself it stays so, whatever was learnt.

All networks work at half the resolution (U4 on squares of pixels), and where no event is near they change nothing: what
stands still is the closed form's.  Without that, static pixels of real clips lost 0.5 dB in 800 steps of training.
"""

from __future__ import annotations

import torch
from pydantic import Field
from torch.nn import functional as F

from interp.blend import blend
from interp.blocks.scale import Scale
from interp.blocks.unet import HalfSized, Unet, rrin_layout
from interp.candidates.ramps import RISEN_CHANNELS
from interp.light import Transfer
from interp.networks.frame_fed import FrameFed, Interpolated, Pair, run, shares_at, warped
from interp.networks.gate import gate_of
from interp.networks.guide import OFFS, guide_of
from interp.networks.spec import Depth, FrameFedSpec
from interp.representation.event_counts import EventCounts


class RrinEventsGuidedSpec(FrameFedSpec):
    """Options of RRINEvents guided by light."""

    depths: tuple[Depth, Depth, Depth] = Field(
        default=(4, 4, 4),
        description="levels of U2 to U4: of 4 2.7 M parameters each, of 3 0.7 M; U2 and U3 51 and 36 kMAC/px,"
        " U4 151 and 91",
    )
    bins: int = Field(
        default=5,
        ge=1,
        le=64,
        description="of events from the target to each frame: 576 parameters and 0.144 kMAC/px a bin in U2, and in U3",
    )
    transfer: Transfer = Field(
        default="srgb",
        description="how the frames are coded: srgb, as all commands have them, or linear, for Python; free",
    )

    @property
    def guided(self) -> bool:
        return True


class RrinEventsGuided(FrameFed):
    """RRINEvents guided by light."""

    def __init__(self, spec: RrinEventsGuidedSpec):
        super().__init__()
        self.spec: RrinEventsGuidedSpec = spec
        colours, zero, events = spec.colours, spec.zero_heads, 2 * spec.bins
        layouts = [rrin_layout(depth, spec.base) for depth in spec.depths[:2]]
        self.scale = Scale(2)
        self.refine = Unet(3 * colours + 4 + events, 4, layouts[0], zero)
        self.masks = Unet(5 * colours + 4 + events, 2, layouts[1], zero)
        self.residue = HalfSized(
            4 * colours + RISEN_CHANNELS + OFFS, colours + 1, rrin_layout(spec.depths[2] - 1, 2 * spec.base), zero
        )
        self.multiple = 2 * 2 ** (max(spec.depths) - 1)

    def computed_once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """Counts at half the resolution, and the gate."""
        return pair.events.pooled(self.scale.factor).off_on, gate_of(pair)

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        guide = guide_of(pair, times, self.spec.transfer, pair.once[1])
        seen = [self.scale.down(each) for each in (pair.frame_0, pair.frame_1, guide.light)]
        seen.append(EventCounts(pair.once[0], pair.events.contrast).halves(times, self.spec.bins))
        at = self.scale.down(guide.flows) / self.scale.factor
        correction = self.scale.down(guide.unsure) * run(self.refine, [at, *seen]) * self.spec.flow_scale
        flows = guide.flows + self.scale.flow_up(correction)
        warps = warped(pair, flows, cubic=True)
        logits = self._visible(guide.unsure, warps, [at + correction, *seen]) + guide.agreement(warps)
        warped_mix, weights = blend(warps, logits, shares_at(times))
        carried, agreed = guide.nearer(warped_mix)
        start, off = guide.coloured(carried), guide.carried_off_by(agreed)
        seen = [pair.frame_0, pair.frame_1, carried, start, torch.cat([guide.found.channels(), guide.offs(off)], 2)]
        image = guide.image(start, carried, off, run(self.residue, seen))
        return Interpolated(image, None, flows, warps, weights, warped_mix)

    def _visible(self, unsure: torch.Tensor, warps: torch.Tensor, seen: list[torch.Tensor]) -> torch.Tensor:
        """ln V of both warps, [B, N, 2, H, W]."""
        logits = run(self.masks, [*seen, *(self.scale.down(warp) for warp in warps.unbind(2))])
        return unsure * F.logsigmoid(self.scale.up(logits))
