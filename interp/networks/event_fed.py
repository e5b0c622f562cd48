"""The one way into networks that rebuild pictures from events alone, window after window.

    image, state = network(voxels, state)        images, state = network.sequence(voxels, state)

A sequence starts with the state None.  Sides may be any: events are continued by none, and what comes out is cut back.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import nn
from torch.nn import functional as F

from interp.blocks.recurrent import State, detached

States = tuple[State | None, ...]
Step = Callable[[torch.Tensor, States], tuple[torch.Tensor, States]]


class EventFed(nn.Module):
    """Base of the networks that take voxel grids.  They add `step`, `multiple` and `around`.

    multiple   of which sides have to be
    around     px that a pixel of the image sees around it at the most, a whole multiple of that
    """

    multiple: int
    around: int

    def step(self, voxels: torch.Tensor, states: States) -> tuple[torch.Tensor, States]:
        """An image of voxels with sides that the network takes; states are empty at first."""
        raise NotImplementedError

    def forward(
        self, voxels: torch.Tensor, states: States = (), step: Step | None = None
    ) -> tuple[torch.Tensor, States]:
        """The image [B, 1, H, W], 0 ... 1, after a window of events [B, bins, H, W], and the states after it.

        step   what is asked in place of `step`, such as that in parts of large pictures
        """
        height, width = voxels.shape[-2:]
        whole = F.pad(voxels, (0, -width % self.multiple, 0, -height % self.multiple))
        image, states = (step or self.step)(whole, states)
        return image[..., :height, :width], states

    def sequence(self, voxels: torch.Tensor, states: States = (), cut_every: int = 0) -> tuple[torch.Tensor, States]:
        """Images [B, T, 1, H, W] after each of T windows [B, T, bins, H, W], and the states after the last.

        cut_every   gradients go back through at most so many windows; 0 for all
        """
        images = []
        for k, window in enumerate(voxels.unbind(1)):
            if cut_every and k and k % cut_every == 0:
                states = detached(states)
            image, states = self(window, states)
            images.append(image)
        return torch.stack(images, 1), states
