"""The HDR network learns to give frames back the range that their sensor has clipped, evenly over time.

A batch has, as of `interp.data.sequences`, truth [B, T, C, H, W], linear light; clipped, as large, codes 0 ... 1 of a
frame sensor, and its range [B, 2], the light of codes 0 and 1; off_on and contrast of the events from the first to
the last; and flows (`true_flows.py`).
"""

from __future__ import annotations

import numpy as np
import torch

from interp.light import to_codes
from interp.losses import objectives
from interp.losses.perceptual import Perceptual
from interp.networks.hdr import Hdr
from interp.train.batches import Batch
from interp.train.event_fed import windows
from interp.train.learner import Learner
from interp.train.pictures import of_error, rows, shown
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.scores import Scores, scores


class HdrLearner(Learner):
    """The HDR network."""

    network: Hdr

    def __init__(self, name: str, network: Hdr, recipe: Recipe, schedule: Schedule):
        super().__init__(network, recipe, schedule)
        self.features = Perceptual()

    def made(self, batch: Batch) -> torch.Tensor:
        """Light [B, T, C, H, W] after the network."""
        frames, state, images = seen(batch), None, []
        for frame, second in zip(frames.unbind(1), self._second(batch).unbind(1), strict=True):
            image, state = self.network(frame, second, state)
            images.append(image)
        return torch.stack(images, 1)

    def parts(self, batch: Batch) -> objectives.Terms:
        """Terms of the loss."""
        return objectives.hdr(self.made(batch), batch["truth"], batch["flows"], batch["flows_to_first"], self.features)

    def predicted(self, clip: Batch) -> torch.Tensor:
        """Light [T, C, H, W] of one sequence."""
        return self.made(clip)[0]

    def scored(self, clip: Batch, images: torch.Tensor) -> list[Scores]:
        """One for each image, of sRGB codes, full code for the brightest of the truth."""
        top = clip["truth"].amax().clamp(min=1)
        made, truth = (to_codes(light / top, "srgb") for light in (images, clip["truth"][0]))
        return scores(made, truth, truth[0], truth[-1])

    def baselines(self, clip: Batch) -> dict[str, torch.Tensor]:
        """The frames as they were."""
        return {"unprocessed": seen(clip)[0]}

    def picture(self, clip: Batch, images: torch.Tensor) -> np.ndarray:
        """Clipped, image, truth, error; a row per instant."""
        top = clip["truth"].amax().clamp(min=1)
        parts = [to_codes(light / top, "srgb") for light in (seen(clip)[0], images, clip["truth"][0])]
        return rows([*(part[n] for part in parts), of_error(parts[1][n], parts[2][n])] for n in shown(len(images)))

    def _second(self, batch: Batch) -> torch.Tensor:
        """What path B sees of every frame: the frame, or the events since the one before."""
        if self.network.spec.second == "frames":
            return seen(batch)
        since = windows(batch, self.network.spec.bins)
        return torch.cat([torch.zeros_like(since[:, :1]), since], 1)


def seen(batch: Batch) -> torch.Tensor:
    """The light [B, T, C, H, W] that a frame sensor took the frames for."""
    low, high = batch["range"][:, :, None, None, None, None].unbind(1)
    return low + batch["clipped"] * (high - low)
