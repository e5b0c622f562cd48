"""Networks that rebuild pictures from events alone learn from sequences of frames.

A batch has, as of `interp.data.sequences`, off_on [B, 2, S, H, W] and contrast [B, 2] of the events between two key
frames, and truth [B, K + 1, 3, H, W] codes of as many instants, both key frames included; and flows
(`true_flows.py`).  Each of the K windows between these gives an image.

How bright a scene is cannot be seen from events, so scores are of images that were brought to the truth's mean and
contrast, image by image.
"""

from __future__ import annotations

import numpy as np
import torch

from interp.light import grey
from interp.losses import objectives
from interp.losses.perceptual import Perceptual
from interp.networks.event_fed import EventFed
from interp.train.batches import Batch
from interp.train.frame_fed import events_of
from interp.train.learner import Learner
from interp.train.pictures import of_error, of_events, rows, shown
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.scores import Scores, scores


class EventFedLearner(Learner):
    """E2VID or FireNet; the latter is also to agree over time."""

    network: EventFed
    features: Perceptual

    def __init__(self, name: str, network: EventFed, recipe: Recipe, schedule: Schedule):
        super().__init__(network, recipe, schedule, Perceptual())
        self.over_time, self.bins = name == "firenet", int(network.spec.bins)  # type: ignore[union-attr, arg-type]

    def made(self, batch: Batch) -> torch.Tensor:
        """Images [B, K, 1, H, W] after each window."""
        return self.network.sequence(windows(batch, self.bins), cut_every=self.recipe.cut_every)[0]

    def parts(self, batch: Batch) -> objectives.Terms:
        """Terms of the loss."""
        flows = batch["flows"][:, 1:] if self.over_time else None
        return objectives.reconstruction(self.made(batch), grey(batch["truth"])[:, 1:], self.features, flows)

    def predicted(self, clip: Batch) -> torch.Tensor:
        """Images [K, 1, H, W] of one sequence, brought to the truth's mean and contrast."""
        return aligned(self.made(clip)[0], grey(clip["truth"])[0, 1:])

    def scored(self, clip: Batch, images: torch.Tensor) -> list[Scores]:
        """One for each of the images but the first, which has seen too little."""
        truth = grey(clip["truth"])[0]
        return scores(images[1:], truth[2:], truth[0], truth[-1])

    def picture(self, clip: Batch, images: torch.Tensor) -> np.ndarray:
        """Events so far, image, truth, error; a row per instant."""
        truth, events, count = grey(clip["truth"])[0, 1:], events_of(clip), len(images)
        return rows(
            [of_events(events, (n + 1) / count, truth[n]), images[n], truth[n],
             of_error(images[n], truth[n])]
            for n in shown(count)
        )  # fmt: skip


def windows(batch: Batch, bins: int) -> torch.Tensor:
    """Voxel grids [B, K, bins, H, W] of the events from each frame to the next."""
    count = batch["truth"].shape[1] - 1
    edges = torch.arange(count + 1, device=batch["truth"].device).expand(len(batch["truth"]), -1) / count
    return events_of(batch).voxels(edges[:, :-1], edges[:, 1:], bins)


def aligned(images: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Images [N, 1, H, W], each as a x + b with the least squared error."""
    x, y = images.double(), truth.double()
    mean_x, mean_y = x.mean((1, 2, 3), keepdim=True), y.mean((1, 2, 3), keepdim=True)
    spread = ((x - mean_x) ** 2).mean((1, 2, 3), keepdim=True)
    slope = ((x - mean_x) * (y - mean_y)).mean((1, 2, 3), keepdim=True) / spread.clamp(min=1e-12)
    return (slope * (x - mean_x) + mean_y).float()
