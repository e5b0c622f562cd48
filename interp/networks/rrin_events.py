"""RRIN, and RRINEvents, which is RRIN with events: four UNets, each with a task of its own.

    U1   F_01, F_10 = U1(I0, I1)                                      once per pair
    U2   F_t0, F_t1 += U2(F_t0, F_t1, I0, I1, events)                 what is not straight and even motion
    U3   V0, V1 = sigmoid(U3(F_t0, F_t1, I0, I1, g0, g1, events))     what is visible in which frame
         J = ((1 - t) V0 g0 + t V1 g1) / ((1 - t) V0 + t V1)          g_k = g(I_k, F_tk)
    U4   I_t = J + U4(I0, I1, J)                                      what warped frames do not have: colours, dynamic
    range

The defaults are the paper's network; the depths of its UNets are inferred from the 17 million parameters it has (the
19.19 million of RRIN with U4 one level shallower).  The options below them are what made a network of a sixteenth of
that learn on two cores in minutes; the register has them as `rrin_events_light`, and for frames alone as `rrin_light`:

    first_flow   the optical flow of DIS in place of U1, which takes days to learn as much
    coarse       U1 to U3 at half the resolution, U4 on squares of 2 x 2 pixels: a third of the cost
    candidate    what events and key frames give in closed form (`candidates/ramps.py`) as a third picture: from it
                 on, not from nothing
    gate         no residue where nothing happens, so that what stands still stays untouched

In a blend with warps the candidate wins before flows have learnt anything, and then they never do.  So it is either
kept out of the blend (`base`: U4 corrects it, and sees the blend) or left out of it at random (`softmax`,
`candidate_dropout`); and `Interpolated.blend` is of the warps alone, for a loss of their own.  `mixed` lets U4 say how
far to go from the candidate C to the blend, too, none of it at first and at most as far again the other way,

    I_t = C + (1 - 2 sigmoid(z)) (J - C) + residue                    z, residue = U4(I0, I1, J, C)

as where events are noise the blend is all that is needed.

Sources: Li et al. (2020), "Video frame interpolation via residue refinement", ICASSP; channels and levels as in
https://github.com/HopLee6/RRIN; events, Radomski et al., section III.A.2.
"""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field
from torch import nn
from torch.nn import functional as F

from interp.blend import blend
from interp.blocks.scale import Scale
from interp.blocks.unet import HalfSized, Unet, rrin_layout
from interp.candidates.ramps import RISEN_CHANNELS, Risen, ramps, risen
from interp.light import Transfer
from interp.networks.frame_fed import FrameFed, Interpolated, Pair, run, shares_at, sought, warped
from interp.networks.gate import gate_of
from interp.networks.spec import Depth, FrameFedSpec
from interp.representation.event_counts import EventCounts
from interp.warp import flows_at


class RrinEventsSpec(FrameFedSpec):
    """Options of RRIN and RRINEvents."""

    depths: tuple[Depth, Depth, Depth, Depth] = Field(
        default=(5, 4, 4, 3),
        description="levels of U1 to U4: U1 of 5 is 10,992,292 parameters and 261 kMAC/px, once per pair; U2 to U4 of 4"
        " are 2.73 M and 202 kMAC/px each, of 3 0.67 M and 142",
    )
    bins: int = Field(
        default=5,
        ge=0,
        le=64,
        description="of events from the target to each frame, 0 for none: 576 parameters and 0.576 kMAC/px a bin in U2,"
        " and in U3",
    )
    events_into_masks: bool = Field(default=True, description="events into U3 as well; see bins")
    first_flow: Literal["own", "dis"] = Field(
        default="own", description="U1, or DIS between the frames, on the CPU: 0.43 s per pair at 1280x720"
    )
    coarse: bool = Field(
        default=False,
        description="U1 to U3 at half the resolution, U4 on squares of pixels: about a quarter of the time",
    )
    candidate: Literal["none", "input", "base", "mixed", "softmax"] = Field(
        default="none",
        description="the closed form: none; input of U3 and U4; base that U4 corrects; mixed: base, of which U4 takes"
        " part of the way to the blend; softmax: a third picture in the blend, too. 864 parameters and 0.864 kMAC/px in"
        " each, and two products with the events",
    )
    candidate_dropout: float = Field(
        default=0.3, ge=0, lt=1, description="share of training images whose blend does without the candidate; free"
    )
    chroma: Literal["keyframes", "warps"] = Field(
        default="keyframes", description="where the candidate has its colours from; free"
    )
    events_into_residue: bool = Field(
        default=False,
        description="into U4, with a candidate, what events say of each pixel before and after the target: 1,152"
        " parameters and 1.152 kMAC/px, coarse 9,216 and 2.304",
    )
    gate: bool = Field(
        default=False,
        description="no residue where no event is near, of networks that take events; costs one mean of counts",
    )
    transfer: Transfer = Field(
        default="srgb",
        description="how the frames are coded: srgb, as all commands have them, or linear, for Python; for the"
        " candidate and the flow of DIS",
    )

    @property
    def takes_events(self) -> bool:
        return bool(self.bins) or self.candidate != "none"


class RrinEvents(FrameFed):
    """RRINEvents; without events RRIN."""

    def __init__(self, spec: RrinEventsSpec):
        super().__init__()
        self.spec: RrinEventsSpec = spec
        colours, zero = spec.colours, spec.zero_heads
        events, candidate = 2 * spec.bins, colours * (spec.candidate != "none")
        masks_in = 4 * colours + 4 + events * spec.events_into_masks + candidate * self._blends_candidate
        pictures = 3 if spec.candidate == "softmax" else 2
        layouts = [rrin_layout(depth, spec.base) for depth in spec.depths]
        self.scale = Scale(2 if spec.coarse else 1)
        self.flow = Unet(2 * colours, 4, layouts[0], zero) if spec.first_flow == "own" else None
        self.refine = Unet(2 * colours + 4 + events, 4, layouts[1], zero)
        self.masks = Unet(masks_in, pictures, layouts[2], zero)
        corrections = colours + (spec.candidate == "mixed")
        corrected = 3 * colours + candidate + RISEN_CHANNELS * self._residue_sees_events
        if spec.coarse:
            halved = rrin_layout(spec.depths[3] - 1, 2 * spec.base)
            self.residue: nn.Module = HalfSized(corrected, corrections, halved, zero)
        else:
            self.residue = Unet(corrected, corrections, layouts[3], zero)
        self.multiple = self.scale.factor * 2 ** (max(spec.depths) - 1)

    @property
    def _blends_candidate(self) -> bool:
        return self.spec.candidate in ("input", "softmax")

    @property
    def _residue_sees_events(self) -> bool:
        return self.spec.events_into_residue and self.spec.candidate != "none"

    @property
    def seeks_motion(self) -> bool:
        """See `FrameFed`."""
        return self.flow is None

    def flows_of(self, pair: Pair) -> torch.Tensor:
        """Flows between the frames, in pixels of the resolution of U1 to U3."""
        if self.flow is None:
            return self.scale.down(sought(pair, self.spec.transfer)) / self.scale.factor
        frames = torch.cat([pair.frame_0, pair.frame_1], 1)
        return self.flow(self.scale.down(frames)).float() * self.spec.flow_scale

    def computed_once(self, pair: Pair) -> tuple[torch.Tensor, ...]:
        """Counts at the resolution of U1 to U3, and the gate."""
        return pair.events.pooled(self.scale.factor).off_on, self._gate(pair)

    def synthesise(self, pair: Pair, times: torch.Tensor) -> Interpolated:
        """Images at times [B, N]."""
        assert pair.flows is not None
        frames = [self.scale.down(frame) for frame in (pair.frame_0, pair.frame_1)]
        events = self._events(pair, times)
        at = flows_at(pair.flows, times)
        at = at + run(self.refine, [at, *frames, *events]) * self.spec.flow_scale
        flows = self.scale.flow_up(at)
        warps = warped(pair, flows)
        found = risen(pair.events, times) if self.spec.candidate != "none" else None
        candidate = self._candidate(pair, times, warps, found)
        beside = events if self.spec.events_into_masks else []
        logits = self._visible([at, *frames], warps, beside, candidate)
        of_warps, weights = blend(warps, logits[:, :, :2], shares_at(times))
        draft = of_warps
        if self.spec.candidate == "softmax":
            draft, weights = self._blend_with_candidate(warps, candidate[0], logits, times)
        said = [found.channels()] if found and self._residue_sees_events else []
        correction = run(self.residue, [pair.frame_0, pair.frame_1, draft, *candidate, *said])
        image = self._start(draft, candidate) + pair.once[1][:, None] * self._correction(correction, draft, candidate)
        return Interpolated(image, self.scale.flow_up(pair.flows), flows, warps, weights, of_warps)

    def _events(self, pair: Pair, times: torch.Tensor) -> list[torch.Tensor]:
        """Voxels of both halves, at the resolution of U1 to U3, in a list that is empty without events."""
        if not self.spec.bins:
            return []
        return [EventCounts(pair.once[0], pair.events.contrast).halves(times, self.spec.bins)]

    def _candidate(
        self, pair: Pair, times: torch.Tensor, warps: torch.Tensor, found: Risen | None
    ) -> list[torch.Tensor]:
        """The closed form, in a list that is empty if none is asked for."""
        if found is None:
            return []
        around = None
        if self.spec.chroma == "warps":
            around = warps[:, :, 0] + times[..., None, None, None] * (warps[:, :, 1] - warps[:, :, 0])
        highest = None if pair.around is None else pair.around.highest
        return [ramps(pair.frame_0, pair.frame_1, pair.events, times, self.spec.transfer, around, found, highest)]

    def _visible(
        self, seen: list[torch.Tensor], warps: torch.Tensor, events: list[torch.Tensor], candidate: list[torch.Tensor]
    ) -> torch.Tensor:
        """What U3 says, at full resolution: logarithms of V, [B, N, pictures, H, W]."""
        pictures = [*warps.unbind(2), *(candidate if self._blends_candidate else [])]
        found = run(self.masks, [*seen, *(self.scale.down(picture) for picture in pictures), *events])
        return F.logsigmoid(self.scale.up(found))

    def _blend_with_candidate(
        self, warps: torch.Tensor, candidate: torch.Tensor, logits: torch.Tensor, times: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        kept = torch.ones_like(times)
        if self.training:
            kept = (torch.rand_like(times) >= self.spec.candidate_dropout).to(times)
        pictures = torch.cat([warps, candidate[:, :, None]], 2)
        return blend(pictures, logits, torch.cat([shares_at(times), kept[..., None]], -1))

    def _start(self, draft: torch.Tensor, candidate: list[torch.Tensor]) -> torch.Tensor:
        return candidate[0] if self.spec.candidate in ("base", "mixed") else draft

    def _correction(self, found: torch.Tensor, draft: torch.Tensor, candidate: list[torch.Tensor]) -> torch.Tensor:
        """What U4 adds: the residue, and of `mixed` a share of the way to the blend."""
        if self.spec.candidate != "mixed":
            return found
        share = 1 - 2 * torch.sigmoid(found[:, :, -1:])
        return found[:, :, :-1] + share * (draft - candidate[0])

    def _gate(self, pair: Pair) -> torch.Tensor:
        closes = self.spec.gate and self.spec.takes_events  # (in use, too, whatever it was taught with)
        return gate_of(pair) if closes else torch.ones_like(pair.frame_0[:, :1])
