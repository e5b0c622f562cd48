"""What a run keeps after each validation: the weights, for use, if none were better, and pictures."""

from __future__ import annotations

from typing import Any

import torch
from lightning.pytorch import Callback, LightningModule, Trainer
from lightning.pytorch.loggers import TensorBoardLogger

from interp import weights
from interp.train.learner import Learner
from interp.train.pictures import encoded
from interp.train.run_folder import RunFolder
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing


class Keeping(Callback):
    """Writes weights and pictures; stands before the callback that keeps the running mean, whose weights these are."""

    def __init__(self, folder: RunFolder, network: str):
        self.folder, self.network = folder, network

    def on_validation_batch_end(
        self, trainer: Trainer, pl_module: LightningModule, outputs: Any, batch: Any, batch_idx: int, *_: Any
    ) -> None:
        """A picture of the first clip of each group, by the process that has it."""
        group, clip = batch
        feed: Any = trainer.datamodule  # type: ignore[attr-defined]
        if not feed.is_first_of_group(batch_idx):
            return
        assert isinstance(pl_module, Learner)
        rgb = pl_module.picture(clip, outputs)
        with self._writing():
            self.folder.pictures.mkdir(parents=True, exist_ok=True)
            with whole_file(self.folder.pictures / f"step-{trainer.global_step:07d}-{group}.png") as file:
                file.write(encoded(rgb))
        for logger in trainer.loggers:
            if isinstance(logger, TensorBoardLogger):
                logger.experiment.add_image(group, torch.from_numpy(rgb), trainer.global_step, dataformats="HWC")

    def on_validation_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """The weights, if these are the best."""
        assert isinstance(pl_module, Learner)
        pl_module.conclude_validation()
        if trainer.is_global_zero and pl_module.best[0] == trainer.global_step:
            with self._writing():
                weights.save(self.folder.weights, self.network, pl_module.network, {"step": str(trainer.global_step)})

    def _writing(self) -> Any:
        return writing(self.folder.path, THEN_RESUME)
