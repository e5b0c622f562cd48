"""What a part of two frames must know of the whole of them, so that it becomes what it is there.

Optical flow of DIS is sought in whole frames, as its search begins elsewhere in every part, and leads to other minima
in 1 to 5 % of the pixels.  What is carried comes from anywhere in the frames.  And light is as bright as the brightest
in them, at the most.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch


@dataclass(frozen=True, slots=True)
class Around:
    """The whole frames that B pairs are parts of; motion is None where the network seeks none of that kind.

    frame_0, frame_1   [B, C, H, W]
    highest            [B, 1, 1, 1] nat, of both (`candidates.bridge.highest_of`)
    between            [B, 4, H, W] px: motion from the first to the second (x, y) and back
    to_targets         [B, N, 4, H, W] px: from targets to the first, to the second
    alone              [B, N, C, H, W]: what the frames say alone of the targets (`candidates.alone`), where that counts
    corner             row and column where the part begins
    coloured           both frames in their colours, as of `frame_fed.Pair`
    """

    frame_0: torch.Tensor
    frame_1: torch.Tensor
    highest: torch.Tensor
    between: torch.Tensor | None = None
    to_targets: torch.Tensor | None = None
    alone: torch.Tensor | None = None
    corner: tuple[int, int] = (0, 0)
    coloured: tuple[torch.Tensor, ...] = ()

    def of_part(self, size: torch.Size) -> Around:
        """With what is of the part, of a size (height, width)."""
        rows, columns = (slice(start, start + side) for start, side in zip(self.corner, size, strict=True))
        between, to_targets, alone = (
            None if whole is None else whole[..., rows, columns]
            for whole in (self.between, self.to_targets, self.alone)
        )
        return replace(self, between=between, to_targets=to_targets, alone=alone)
