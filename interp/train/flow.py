"""The network for optical flow learns from DIS, and by what its flows carry where: one frame to the other, and both to
what was between them, if motion is straight and even (Jiang et al. (2018), "Super SloMo", CVPR)."""

from __future__ import annotations

from typing import Any

import torch

from interp.losses import objectives
from interp.networks.frame_fed import Interpolated
from interp.train.batches import Batch
from interp.train.frame_fed import FrameFedLearner, events_of
from interp.warp import both_warped, flows_at


class FlowLearner(FrameFedLearner):
    """A network of flows from two frames.

    Its images are the nearer frame, carried to the target: by flows that are zero the baseline `nearest`.  A cross-fade
    of both would be scored by what averaging makes of errors, too, and is at its best where flows say little.
    """

    network: Any

    def made(self, batch: Batch) -> Interpolated:
        """What the flows make of a batch."""
        first, last = batch["frames"].unbind(1)
        flows, times = self.network(first, last, events_of(batch)), batch["times"]
        at = flows_at(flows, times)
        warps = both_warped(first, last, at)
        later = (times > 0.5)[:, :, None, None, None]
        images = torch.where(later, warps[:, :, 1], warps[:, :, 0])
        weights = torch.cat([~later, later], 2).float().expand(-1, -1, -1, *images.shape[-2:])
        return Interpolated(images, flows, at, warps, weights, images)

    def parts(self, batch: Batch) -> objectives.Terms:
        """Terms of the loss."""
        first, last = batch["frames"].unbind(1)
        return objectives.flows(self.made(batch), first, last, batch["truth"], batch["flow"])
