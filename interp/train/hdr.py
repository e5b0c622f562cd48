"""The HDR network learns to give frames back the range that their sensor has clipped, evenly over time.

A batch has, as of `interp.data.sequences`, truth [B, T, C, H, W], linear light; clipped, as large, codes 0 ... 1 of a
frame sensor, and its range [B, 2], the light of codes 0 and 1; off_on and contrast of the events from the first to
the last; and flows (`true_flows.py`).
"""

from __future__ import annotations

import math

import numpy as np
import torch

from interp.candidates.beyond import carried
from interp.light import RATIOS, to_codes, to_ratios
from interp.losses import objectives
from interp.losses.perceptual import Perceptual
from interp.networks.hdr import Hdr
from interp.representation.event_counts import PER_VOXEL_NATS
from interp.train.batches import Batch
from interp.train.event_fed import windows
from interp.train.learner import Learner
from interp.train.pictures import of_error, rows, shown
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.scores import Scores, rounded
from vid2ev.compare.pictures import psnr, ssim

DECADE = 1.0


class HdrLearner(Learner):
    """The HDR network."""

    network: Hdr
    features: Perceptual

    def __init__(self, name: str, network: Hdr, recipe: Recipe, schedule: Schedule):
        super().__init__(network, recipe, schedule, Perceptual())

    def made(self, batch: Batch) -> torch.Tensor:
        """Light [B, T, C, H, W] after the network."""
        frames, state, images = seen(batch), None, []
        for frame, second in zip(frames.unbind(1), self._second(batch).unbind(1), strict=True):
            image, state = self.network(frame, second, state, batch["range"])
            images.append(image)
        return torch.stack(images, 1)

    def parts(self, batch: Batch) -> objectives.Terms:
        """Terms of the loss, of ratios."""
        made, truth = to_ratios(self.made(batch)), to_ratios(batch["truth"])
        above, below = outside(batch)
        return objectives.hdr(made, truth, batch["flows"], batch["flows_to_first"], self.features, above | below)

    def predicted(self, clip: Batch) -> torch.Tensor:
        """Light [T, C, H, W] of one sequence."""
        return self.made(clip)[0]

    def scored(self, clip: Batch, images: torch.Tensor) -> list[Scores]:
        """One for each image: PSNR in decades of light, of what is beyond the range of the frame sensor, as `moving` of
        what is above it, as `static` below; SSIM of whole pictures, in ratios up to the brightest."""
        truth = clip["truth"][0]
        top = to_ratios(truth).amax().clamp(min=1)
        whole = [to_ratios(light) / top for light in (images, truth)]
        beyond = [_last(each[0]) for each in outside(clip)]
        return [
            Scores(
                psnr(error[above | below], DECADE),
                ssim(rounded(made[None])[0], rounded(true[None])[0]),
                psnr(error[above], DECADE),
                psnr(error[below], DECADE),
            )
            for error, above, below, made, true in zip(decades(images, truth), *beyond, *whole, strict=True)
        ]

    def baselines(self, clip: Batch) -> dict[str, torch.Tensor]:
        """The frames as they were, and with what events carry on."""
        frames, before, images = seen(clip), None, []
        changes = PER_VOXEL_NATS * windows(clip, 1)
        for k, frame in enumerate(frames.unbind(1)):
            change = changes[:, k - 1] if k else torch.zeros_like(frame[:, :1])
            before, _ = carried(frame, change, before, clip["range"])
            images.append(before[0])
        return {"unprocessed": frames[0], "carried": torch.stack(images)}

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


def decades(images: torch.Tensor, truth: torch.Tensor) -> np.ndarray:
    """Squared errors [T, H, W, C] of light [T, C, H, W] in decades; what is far below a thousandth of diffuse white is
    black."""
    error = (to_ratios(images.clamp(min=0)) - to_ratios(truth)) * math.log10(1 + RATIOS)
    return _last(error.double() ** 2)


def outside(batch: Batch) -> tuple[torch.Tensor, torch.Tensor]:
    """Which values [B, T, C, H, W] of the truth are above the range of the frame sensor, and which below."""
    low, high = _ends(batch)
    return batch["truth"] > high, batch["truth"] < low


def seen(batch: Batch) -> torch.Tensor:
    """The light [B, T, C, H, W] that a frame sensor took the frames for."""
    low, high = _ends(batch)
    return low + batch["clipped"] * (high - low)


def _ends(batch: Batch) -> tuple[torch.Tensor, ...]:
    """The light [B, 1, 1, 1, 1] of codes 0 and 1."""
    return batch["range"][:, :, None, None, None, None].unbind(1)


def _last(values: torch.Tensor) -> np.ndarray:
    """Values [T, C, H, W] with channels last."""
    return values.movedim(1, -1).cpu().numpy()
