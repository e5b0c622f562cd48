"""What is known of instants before their motion is, and that motion: sought twice where events are coarse.

Light of coarse pixels is a mean over them, and motion that is sought on means leads only about to where things are.
What they make is sharp, and leads there: so motion is sought again, to that (see `guided.py`, which is what is made).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch

from interp.candidates.guided import flows_to, guided
from interp.light import Transfer
from interp.representation.carried import ALL, Part

AGAIN = 1  # times that motion is sought once more


@dataclass(frozen=True, slots=True)
class Sight:
    """Both key frames, and N instants in between.

    frames     [B, C, H, W] codes, two of them
    light      [B, N, C, H, W]: the ramps
    doubt      [B, N, 1, H, W]: how far their light may be off [nat]
    alone      D [B, N, C, H, W]
    times      [B, N]
    footprint  k, pixels across that a pixel of the event camera looks at
    """

    frames: tuple[torch.Tensor, torch.Tensor]
    light: torch.Tensor
    doubt: torch.Tensor
    alone: torch.Tensor
    times: torch.Tensor
    footprint: int = 1
    transfer: Transfer = "srgb"

    @torch.no_grad()
    def motion(self, image: Callable[[torch.Tensor], torch.Tensor] | None = None) -> torch.Tensor:
        """Motion [B, N, 4, H, W] px from the instants to both frames.

        image   makes images of such motion, if not all of them are to be made at once
        """
        flows = self._flows_to(self.light)
        for _ in range(AGAIN if self.footprint > 1 else 0):
            flows = self._flows_to((image or self.image)(flows))
        return flows

    def image(self, flows: torch.Tensor, within: Part = ALL) -> torch.Tensor:
        """I [B, N, C, h, w] of motion [B, N, 4, H, W] px; `within` are the rows and columns that are wanted."""
        light, motion, doubt, alone = (each[(..., *within)] for each in (self.light, flows, self.doubt, self.alone))
        rows, columns = within
        corner = None if light.shape == self.light.shape else (rows.start, columns.start)
        seen = guided(*self.frames, light, self.transfer, self.footprint, motion, corner)
        return seen.image(light, doubt, alone, self.times, self.transfer)

    def _flows_to(self, images: torch.Tensor) -> torch.Tensor:
        return flows_to(*self.frames, images, self.transfer, self.footprint)
