"""RRINEvents guided by light: what is known in closed form first, and networks for what is left.

    C    = ramps(I0, I1, events)                            luminance at the target, from events (`candidates/ramps.py`)
    F_tk = DIS(C -> I_k) + (1 - m) U2(F_t0, F_t1, I0, I1, C, events)
    J    = sum_k w_k g(I_k, F_tk)     w_k ~ s_k exp(a_k) V_k     V = sigmoid(U3(F, I0, I1, g0, g1, C, events))^(1 - m)
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
from interp.candidates.guided import SHARP, agreement, carried_off_by, flows_to, part_of, recoloured
from interp.candidates.ramps import RISEN_CHANNELS, Risen, ramps, risen
from interp.light import Transfer
from interp.networks.frame_fed import FrameFed, Interpolated, Pair, run, shares_at, warped
from interp.networks.gate import doubts, gate_of
from interp.networks.spec import Depth, FrameFedSpec
from interp.representation.event_counts import EventCounts

DEVIATIONS = 3.0  # that a correction may be
MOST = 10.0  # of n


class RrinEventsGuidedSpec(FrameFedSpec):
    """Options of RRINEvents guided by light."""

    depths: tuple[Depth, Depth, Depth] = Field(
        default=(4, 4, 4),
        description="levels of U2 to U4: of 4 2.73 M parameters and 50 kMAC/px each, of 3 0.67 M and 36; U4 four times"
        " the parameters",
    )
    bins: int = Field(
        default=5,
        ge=1,
        le=64,
        description="of events from the target to each frame: 576 parameters and 0.144 kMAC/px a bin in U2, and in U3",
    )
    transfer: Transfer = Field(default="srgb", description="how the frames are coded: srgb or linear; free")


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
            4 * colours + RISEN_CHANNELS + 2, colours + 1, rrin_layout(spec.depths[2] - 1, 2 * spec.base), zero
        )
        self.multiple = 2 * 2 ** (max(spec.depths) - 1)

    def computed_once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """Counts at half the resolution, and the gate."""
        return pair.events.pooled(self.scale.factor).off_on, gate_of(pair)

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        found = risen(pair.events, times)
        candidate = ramps(pair.frame_0, pair.frame_1, pair.events, times, self.spec.transfer, found=found)
        seen = [self.scale.down(each) for each in (pair.frame_0, pair.frame_1, candidate)]
        seen.append(EventCounts(pair.once[0], pair.events.contrast).halves(times, self.spec.bins))
        first = flows_to(pair.frame_0, pair.frame_1, candidate, self.spec.transfer)
        wrong, unsure = doubts(pair, candidate, found, first, times, self.spec.transfer)
        unsure = pair.once[1][:, None] * unsure
        at = self.scale.down(first) / self.scale.factor
        correction = self.scale.down(unsure) * run(self.refine, [at, *seen]) * self.spec.flow_scale
        flows = first + self.scale.flow_up(correction)
        warps = warped(pair, flows)
        agreed = agreement(warps, candidate, self.spec.transfer)
        logits = self._visible(unsure, warps, [at + correction, *seen]) + agreed
        of_warps, weights = blend(warps, logits, shares_at(times))
        start = recoloured(candidate, of_warps, self.spec.transfer)
        image = self._corrected(pair, start, of_warps, found, wrong, carried_off_by(agreed, wrong))
        return Interpolated(image, None, flows, warps, weights, of_warps)

    def _visible(self, unsure: torch.Tensor, warps: torch.Tensor, seen: list[torch.Tensor]) -> torch.Tensor:
        """ln V of both warps, [B, N, 2, H, W]."""
        logits = run(self.masks, [*seen, *(self.scale.down(warp) for warp in warps.unbind(2))])
        return unsure * F.logsigmoid(self.scale.up(logits))

    def _corrected(
        self,
        pair: Pair,
        start: torch.Tensor,
        draft: torch.Tensor,
        found: Risen,
        wrong: torch.Tensor,
        wrongly_carried: torch.Tensor,
    ) -> torch.Tensor:
        """The image, from C' and J, and from how far either may be off: c^2, j^2."""
        offs = SHARP * torch.cat([wrong, wrongly_carried], 2).detach().sqrt()
        seen = [pair.frame_0, pair.frame_1, draft, start, torch.cat([found.channels(), offs], 2)]
        said = pair.once[1][:, None] * run(self.residue, seen)
        share = part_of(wrong, wrongly_carried * torch.exp(-said[:, :, -1:].clamp(-MOST, MOST)))
        spread = (wrong * part_of(wrongly_carried, wrong)).detach().sqrt()
        return start + share * (draft - start) + DEVIATIONS * spread * torch.tanh(said[:, :, :-1])
