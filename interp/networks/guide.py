"""What the closed form `guided` tells a network: light at the targets, motion, and what either may be off by."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from interp.candidates.alone import alone
from interp.candidates.guided import (
    SHARP,
    agreement,
    carried_off_by,
    nearer,
    off_by,
    part_of,
    recoloured,
    shown_of,
)
from interp.candidates.ramps import Risen, in_doubt, ramps, risen
from interp.candidates.sight import Sight
from interp.light import Transfer
from interp.networks.frame_fed import Pair, warped

DEVIATIONS = 3.0  # that a correction may be
MOST = 10.0  # of n
OFFS = 2  # channels that say what light and carried frames may be off by


@dataclass(frozen=True, slots=True)
class Guide:
    """N targets, before a network.

    light    C, of the ramps [B, N, C, H, W], codes of this transfer
    shown    its luminance [B, N, 1, H, W] (`shown_of`)
    found    what events say there
    flows    [B, N, 4, H, W] px, from there to both frames
    alone    D [B, N, C, H, W]
    wrong    c^2 [B, N, 1, H, W]
    near     [B, 1, 1, H, W], 0 ... 1: where events are
    unsure   [B, N, 1, H, W], 0 ... 1: where events are, and frames carried by these flows are not to be believed
    seen_wrong, footprint   c^2 averaged as coarse events see it, and k (`candidates.guided`)
    """

    transfer: Transfer
    light: torch.Tensor
    shown: torch.Tensor
    found: Risen
    flows: torch.Tensor
    alone: torch.Tensor
    wrong: torch.Tensor
    near: torch.Tensor
    unsure: torch.Tensor
    seen_wrong: torch.Tensor
    footprint: int

    def agreement(self, warps: torch.Tensor) -> torch.Tensor:
        """Logits [B, N, 2, H, W] of warps by how near their luminance is."""
        return agreement(warps, self.shown, self.transfer, self.footprint)

    def nearer(self, carried: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """J [B, N, C, H, W], of J0 and D, and its logits [B, N, 1, H, W]."""
        return nearer(carried, self.alone, self.shown, self.transfer, self.footprint)

    def coloured(self, carried: torch.Tensor) -> torch.Tensor:
        """C' [B, N, C, H, W]: C in the colours of J."""
        return recoloured(self.light, carried, self.transfer)

    def carried_off_by(self, agreed: torch.Tensor) -> torch.Tensor:
        """j^2 [B, N, 1, H, W] of the logits of J."""
        return carried_off_by(agreed, self.seen_wrong, self.footprint)

    def offs(self, off: torch.Tensor) -> torch.Tensor:
        """c and j [B, N, 2, H, W] of j^2, as a network takes them."""
        return SHARP * torch.cat([self.wrong, off], 2).detach().sqrt()

    def image(self, start: torch.Tensor, carried: torch.Tensor, off: torch.Tensor, said: torch.Tensor) -> torch.Tensor:
        """I, of C', J and j^2: C' + m (J - C') + 3 s tanh(r), m = c^2 / (c^2 + j^2 e^-n), 1/s^2 = 1/c^2 + 1/j^2.

        said   r and then n of a network, [B, N, C + 1, H, W]; zero is the closed form
        """
        said = self.near * said
        share = part_of(self.wrong, off * torch.exp(-said[:, :, -1:].clamp(-MOST, MOST)))
        spread = (self.wrong * part_of(off, self.wrong)).detach().sqrt()
        return start + share * (carried - start) + DEVIATIONS * spread * torch.tanh(said[:, :, :-1])


def guide_of(pair: Pair, times: torch.Tensor, transfer: Transfer, gate: torch.Tensor) -> Guide:
    """What is known of a pair at times [B, N]; `gate` is that of the pair (`gate.py`)."""
    frames, around, k = (pair.frame_0, pair.frame_1), pair.around, pair.events.footprint
    found = risen(pair.events, times)
    light = ramps(
        *frames, pair.events, times, transfer, found=found, highest=None if around is None else around.highest
    )
    doubt = in_doubt(*frames, found, times, transfer)
    by_themselves = None if around is None else around.alone
    if by_themselves is None:
        by_themselves = alone(*frames, times, transfer)
    flows = None if around is None else around.to_targets
    if flows is None:
        flows = Sight(frames, light, doubt, by_themselves, times, k, transfer).motion()
    shown = shown_of(light, transfer)
    wrong, seen_wrong = off_by(shown, doubt, k)
    near = gate[:, None]
    carried = carried_off_by(agreement(warped(pair, flows, cubic=True), shown, transfer, k), seen_wrong, k)
    unsure = near * part_of(carried, wrong).detach()
    return Guide(transfer, light, shown, found, flows, by_themselves, wrong, near, unsure, seen_wrong, k)
