"""What all networks share while they learn: optimiser, rates, steps that are skipped, random numbers.

A step whose gradients are not all finite changes nothing: neither weights nor what the optimiser remembers.  Such
steps are counted, and too many in a row end training.

Random numbers of a step are a function of the seed, the step and the process, never a stream, so that training that
goes on draws what it would have drawn.
"""

from __future__ import annotations

import hashlib
import math
import time
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from lightning.pytorch import LightningModule
from torch import nn
from torch.optim import AdamW, Optimizer
from torch.optim.lr_scheduler import LambdaLR

from interp.losses.perceptual import Perceptual
from interp.methods.running import laid_out
from interp.train.recipe import Recipe
from interp.train.schedule import Schedule
from interp.train.scores import Scores
from vid2ev.errors import DataError


class Learner(LightningModule):
    """A network that learns.  Families of networks add `parts` and `predicted`.

    schedule   of the learning rate; replaced where the steps are planned
    features   what the loss looks at beside pictures, if it does
    skipped    steps whose gradients were not finite, so far
    table      mean scores of each group of clips, of the last validation, which was at step `validated_at`
               and took `validation_s`
    best       the table of the validation that was best, and its step: of the mean PSNR of all groups that have one,
               so that neither scenes nor real clips, neither clean nor noisy sensors are given up for the rest
    """

    def __init__(self, network: nn.Module, recipe: Recipe, schedule: Schedule, features: Perceptual | None = None):
        super().__init__()
        self.network, self.recipe, self.schedule = network, recipe, schedule
        self.features = features
        self.skipped = self._in_a_row = 0
        self.table: dict[str, Scores] = {}
        self.validated_at, self.validation_s = -1, 0.0
        self.best: tuple[int, dict[str, Scores]] = (-1, {})
        self._scores: list[tuple[str, list[Scores]]] = []

    def parts(self, batch: Any) -> dict[str, torch.Tensor]:
        """The parts of the loss, weighted; their sum is the loss."""
        raise NotImplementedError

    def predicted(self, clip: Any) -> torch.Tensor:
        """Images [N, C, H, W] of a clip of validation."""
        raise NotImplementedError

    def scored(self, clip: Any, images: torch.Tensor) -> list[Scores]:
        """How near they are to the truth."""
        raise NotImplementedError

    def baselines(self, clip: Any) -> dict[str, torch.Tensor]:
        """Images of methods that need no training, by name."""
        return {}

    def picture(self, clip: Any, images: torch.Tensor) -> np.ndarray:
        """A picture of them beside what went in, and the truth: R'G'B' uint8."""
        raise NotImplementedError

    def configure_optimizers(self) -> Any:
        """AdamW, with the rates of the schedule."""
        recipe, learnt = self.recipe, [weight for weight in self.parameters() if weight.requires_grad]
        optimizer = AdamW(learnt, recipe.rate, recipe.betas, weight_decay=recipe.weight_decay)
        rates = LambdaLR(optimizer, lambda step: self.schedule.share(step))
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": rates, "interval": "step"}}

    def on_fit_start(self) -> None:
        """The network is on its device now."""
        laid_out(self.network)

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Random numbers of this step."""
        torch.manual_seed(number_of(self.recipe.seed, self.trainer.global_step, self.trainer.global_rank))

    def training_step(self, batch: Any, batch_idx: int) -> torch.Tensor:
        """The loss."""
        parts = self.parts(batch)
        loss = torch.stack(list(parts.values())).sum()
        self.log("step", self.trainer.global_step + 1.0)  # (what Lightning puts the others over)
        said = {f"train/{name}": part.detach() for name, part in ({"loss": loss} | parts).items()}
        self.log_dict(said, sync_dist=True)  # (of the whole batch, whoever has which part)
        return loss

    def configure_gradient_clipping(self, optimizer: Optimizer, *_: Any, **__: Any) -> None:
        """Shorten the gradient, or drop it where it is not finite."""
        learnt = [weight for group in optimizer.param_groups for weight in group["params"]]
        length = torch.nn.utils.clip_grad_norm_(learnt, self.recipe.clip)
        rate = optimizer.param_groups[0]["lr"]
        if bool(length.isfinite()):
            self._in_a_row = 0
            self.log_dict({"train/gradient": length, "train/rate": rate, "train/skipped": float(self.skipped)})
            return
        optimizer.zero_grad(set_to_none=True)  # (without gradients the optimiser leaves everything as it is)
        self.skipped, self._in_a_row = self.skipped + 1, self._in_a_row + 1
        if self._in_a_row >= self.recipe.most_skipped:
            raise DataError(
                f"the loss had no finite gradient in {self._in_a_row} steps in a row, up to step"
                f" {self.trainer.global_step}; start again with a smaller rate than {self.recipe.rate:g}"
                f" (--set rate={self.recipe.rate / 3:.1g}), or look at the samples"
            )

    def on_validation_epoch_start(self) -> None:
        """It takes a while."""
        self._begun_s = time.monotonic()

    def validation_step(self, batch: tuple[str, Any], batch_idx: int) -> torch.Tensor:
        """Images of a clip."""
        group, clip = batch
        images = self.predicted(clip).float()
        self._scores.append((group, self.scored(clip, images)))
        return images

    def conclude_validation(self) -> None:
        """Means of each group of clips, of all processes together; asked for while the running mean is in place."""
        mine, self._scores = self._scores, []
        self.table = means(gathered(mine))
        self.validated_at, self.validation_s = self.trainer.global_step, time.monotonic() - self._begun_s
        self.log("step", float(self.trainer.global_step))
        for group, mean in self.table.items():
            self.log_dict(mean.named(f"validation/{group}."))
        if is_better(self.table, self.best[1]):
            self.best = (self.validated_at, self.table)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """What was skipped, how long validation took, and what was best."""
        checkpoint["skipped"] = [self.skipped, self._in_a_row]
        checkpoint["best"] = [self.best[0], {group: asdict(scores) for group, scores in self.best[1].items()}]
        checkpoint["validation_s"] = self.validation_s

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """The same."""
        self.skipped, self._in_a_row = checkpoint["skipped"]
        step, table = checkpoint["best"]
        self.best = (step, {group: Scores(**scores) for group, scores in table.items()})
        self.validation_s = checkpoint["validation_s"]


def means(scores: list[tuple[str, list[Scores]]]) -> dict[str, Scores]:
    """The mean of each group, over all its images."""
    groups = dict.fromkeys(group for group, _ in scores)
    return {name: Scores.mean([one for group, each in scores if group == name for one in each]) for name in groups}


def is_better(table: dict[str, Scores], best: dict[str, Scores]) -> bool:
    """Whether a validation was better than the best so far, which is not if it has lost a number that the best has.

    Raises DataError for one without any number.
    """
    here, there = ({group for group, scores in each.items() if not math.isnan(scores.psnr)} for each in (table, best))
    mean = overall(table)
    return not there or (there <= here and mean > overall(best))


def overall(table: dict[str, Scores]) -> float:
    """One number for a validation: the mean PSNR of all groups of clips that have one [dB].  Raises DataError if none
    has."""
    mean = Scores.mean([*table.values()]).psnr
    if math.isnan(mean):
        raise DataError(
            f"clips to validate with ({', '.join(table) or 'none'}) have nothing to score, such as light beyond the"
            " range of the frames: no validation is better than another; begin with more of them"
            " (--set validation.clips=16)"
        )
    return mean


def gathered(mine: list[Any]) -> list[Any]:
    """The lists of all processes as one."""
    if not torch.distributed.is_initialized():
        return mine
    lists: list[Any] = [None] * torch.distributed.get_world_size()
    torch.distributed.all_gather_object(lists, mine)
    return [one for each in lists for one in each]


def number_of(*name: int) -> int:
    """A number of 63 bits that stands for several, to seed with."""
    return int.from_bytes(hashlib.sha256(repr(name).encode()).digest()[:8], "big") >> 1
