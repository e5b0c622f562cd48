"""What training goes on from: one file, there as a whole or not at all, written every so often and when training stops.

It holds the network, its running mean, the optimiser and how far training has come.  Samples and random numbers are
functions of the step, so there is no other state: what goes on from a checkpoint ends with the same bits on the same
kind of processor, with the same number of threads.
"""

from __future__ import annotations

import pickle
import time
from pathlib import Path
from typing import Any

import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Checkpoint
from lightning.pytorch.plugins.io import TorchCheckpointIO

from vid2ev.errors import DataError
from vid2ev.recording.disk import whole_file, writing


class WholeFiles(TorchCheckpointIO):
    """Lightning's way to files, by way of a file beside that is brought to the disk and renamed."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None) -> None:
        """Write a checkpoint; raises DataError where that cannot be."""
        with writing(Path(path), "make room or access there, then --resume"), whole_file(Path(path)) as file:
            torch.save(checkpoint, file)

    def load_checkpoint(self, path: str | Path, map_location: Any = None, weights_only: bool | None = None) -> Any:
        """Read a checkpoint; raises DataError for a file that is none, or not whole."""
        return read_checkpoint(Path(path))


def read_checkpoint(path: Path) -> dict[str, Any]:
    """A checkpoint, on the CPU; raises DataError for a file that is none, or not whole."""
    try:
        found = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, EOFError, ValueError, RuntimeError, KeyError, pickle.UnpicklingError) as error:
        reason = str(error).strip().split("\n")[0] or type(error).__name__
        raise DataError(
            f"{path} is no whole checkpoint ({reason}); copy the run again, or start another with -o"
        ) from error
    if not isinstance(found, dict) or "global_step" not in found:
        raise DataError(f"{path} is no checkpoint of `vid2ev train`; copy the run again, or start another with -o")
    return found


class Saves(Checkpoint):
    """Writes the checkpoint after a step, every `every_s` seconds and after the last step of a session."""

    def __init__(self, path: Path, every_s: float):
        self.path, self.every_s = path, every_s
        self._last_s = 0.0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Time counts from here."""
        self._last_s = time.monotonic()

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Write it if it is time."""
        due = time.monotonic() - self._last_s > self.every_s or trainer.global_step == trainer.max_steps
        if trainer.strategy.broadcast(due):
            trainer.save_checkpoint(self.path)
            self._last_s = time.monotonic()
