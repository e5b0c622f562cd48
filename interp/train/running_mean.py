"""The running mean of the weights, which is what is validated and kept."""

from __future__ import annotations

from typing import Any

import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import WeightAveraging


class RunningMean(WeightAveraging):
    """mean <- share mean + (1 - share) weight after each step, share = min(most, (1 + n) / (10 + n)) after n others: at
    first over fewer steps, so that it does not hang on the start, of which after the first step nothing is left."""

    def __init__(self, most: float):
        self._most, self._share = most, 0.0
        super().__init__(use_buffers=False, avg_fn=lambda mean, weight, _: torch.lerp(weight, mean, self._share))

    def setup(self, trainer: Trainer, pl_module: LightningModule, stage: str) -> None:
        """The mean is where training is: the weights, which it begins with, are brought there only later."""
        self._device = trainer.strategy.root_device
        super().setup(trainer, pl_module, stage)

    def on_train_batch_end(
        self, trainer: Trainer, pl_module: LightningModule, outputs: Any, batch: Any, batch_idx: int
    ) -> None:
        """A step more.  (Its number, unlike the mean's own count, is no tensor to wait for.)"""
        done = trainer.global_step - 1
        self._share = min(self._most, (1 + done) / (10 + done))
        super().on_train_batch_end(trainer, pl_module, outputs, batch, batch_idx)
