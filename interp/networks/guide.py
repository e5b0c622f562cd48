"""What the closed form `guided` tells a network: light at the targets, motion, and what either may be off by."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from interp.candidates.alone import alone
from interp.candidates.guided import (
    SHARP,
    agreement,
    carried_off_by,
    flows_to,
    nearer,
    off_by,
    part_of,
    recoloured,
    shown_of,
)
from interp.candidates.ramps import Risen, in_doubt, ramps, risen
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

    def agreement(self, warps: torch.Tensor) -> torch.Tensor:
        """Logits [B, N, 2, H, W] of warps by how near their luminance is."""
        return agreement(warps, self.shown, self.transfer)

    def nearer(self, carried: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """J [B, N, C, H, W], of J0 and D, and its logits [B, N, 1, H, W]."""
        return nearer(carried, self.alone, self.shown, self.transfer)

    def coloured(self, carried: torch.Tensor) -> torch.Tensor:
        """C' [B, N, C, H, W]: C in the colours of J."""
        return recoloured(self.light, carried, self.transfer)

    def carried_off_by(self, agreed: torch.Tensor) -> torch.Tensor:
        """j^2 [B, N, 1, H, W] of the logits of J."""
        return carried_off_by(agreed, self.wrong)

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


def light_at(pair: Pair, times: torch.Tensor, transfer: Transfer, found: Risen | None = None) -> torch.Tensor:
    """C [B, N, C, H, W] at times [B, N]: what motion is sought by."""
    highest = None if pair.around is None else pair.around.highest
    return ramps(pair.frame_0, pair.frame_1, pair.events, times, transfer, found=found, highest=highest)


def guide_of(pair: Pair, times: torch.Tensor, transfer: Transfer, gate: torch.Tensor) -> Guide:
    """What is known of a pair at times [B, N]; `gate` is that of the pair (`gate.py`)."""
    found = risen(pair.events, times)
    light = light_at(pair, times, transfer, found)
    flows = None if pair.around is None else pair.around.to_targets
    flows = flows_to(pair.frame_0, pair.frame_1, light, transfer) if flows is None else flows
    by_themselves = None if pair.around is None else pair.around.alone
    if by_themselves is None:
        by_themselves = alone(pair.frame_0, pair.frame_1, times, transfer)
    shown = shown_of(light, transfer)
    wrong, _ = off_by(shown, in_doubt(pair.frame_0, pair.frame_1, found, times, transfer))
    near = gate[:, None]
    carried = carried_off_by(agreement(warped(pair, flows, cubic=True), shown, transfer), wrong)
    unsure = near * part_of(carried, wrong).detach()
    return Guide(transfer, light, shown, found, flows, by_themselves, wrong, near, unsure)
