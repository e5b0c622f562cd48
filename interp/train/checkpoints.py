"""What training goes on from: one file, there as a whole or not at all, written every so often and when training stops.

It holds the network, its running mean, the optimiser and how far training has come.  Samples and random numbers are
functions of the step, so there is no other state: what goes on from a checkpoint ends with the same bits on the same
kind of processor, with the same number of threads.
"""

from __future__ import annotations

import time
import zipfile
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import Checkpoint
from lightning.pytorch.plugins.io import TorchCheckpointIO

from interp.train.schedule import MOST_STEPS
from vid2ev.errors import DataError
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing
from vid2ev.untrusted import check_bytes, first_line


class WholeFiles(TorchCheckpointIO):
    """Lightning's way to files, by way of a file beside that is brought to the disk and renamed."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None) -> None:
        """Write a checkpoint; raises DataError where that cannot be."""
        with writing(Path(path), THEN_RESUME), whole_file(Path(path)) as file:
            try:
                torch.save(checkpoint, file)
            except RuntimeError as error:  # (of the library, for whatever the disk says)
                raise OSError("the disk does not take it") from error

    def load_checkpoint(self, path: str | Path, map_location: Any = None, weights_only: bool | None = None) -> Any:
        """Read a checkpoint; raises DataError for a file that is none, or not whole."""
        return read_checkpoint(Path(path))


def read_checkpoint(path: Path) -> dict[str, Any]:
    """A checkpoint, on the CPU; raises DataError for a file that is none, or not whole."""
    try:
        with zipfile.ZipFile(path) as archive:
            # (torch packs without compressing: what claims to be larger than it is was made to fill the memory)
            stored = sum(info.file_size for info in archive.infolist())
            if stored > path.stat().st_size:
                check_bytes(path, stored)
            if damaged := archive.testzip():  # (torch does not ask: a flipped bit would be another weight)
                raise zipfile.BadZipFile(f"Bad CRC-32 for file {damaged!r}")
        found = torch.load(path, map_location="cpu", weights_only=True)
    except DataError:
        raise
    except Exception as error:  # (torch, its reader of plain data and zipfile have a dozen of their own)
        reason = first_line(error)
        if isinstance(error, UnpicklingError):  # (torch says how to have it run what is in there)
            reason = "it holds more than numbers and their names, which is not read"
        raise DataError(
            f"{path} is no whole checkpoint ({reason}); copy the run again, or start another with -o"
        ) from error
    step = found.get("global_step") if isinstance(found, dict) else None
    if type(step) is not int or not 0 <= step < MOST_STEPS or not isinstance(found.get("state_dict"), dict):
        raise DataError(f"{path} is no checkpoint of `vid2ev train`; copy the run again, or start another with -o")
    return found


class Saves(Checkpoint):
    """Writes the checkpoint after a step, every `every_s` seconds and after the last step of a session.

    Where a validation follows the step, it is written after that, with what was best: a checkpoint from before would
    go on without it.
    """

    def __init__(self, path: Path, every_s: float):
        self.path, self.every_s = path, every_s
        self._last_s, self._waits = 0.0, False

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Time counts from here."""
        self._last_s = time.monotonic()

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Write it if it is time."""
        due = time.monotonic() - self._last_s > self.every_s or trainer.global_step == trainer.max_steps
        if trainer.strategy.broadcast(due):
            if validation_follows(trainer):
                self._waits = True
            else:
                self._write(trainer)

    def on_validation_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write it if it was time before this validation."""
        if self._waits:
            self._write(trainer)

    def _write(self, trainer: Trainer) -> None:
        trainer.save_checkpoint(self.path)
        self._last_s, self._waits = time.monotonic(), False


def validation_follows(trainer: Trainer) -> bool:
    """Whether the trainer validates after the step that it has just done."""
    return trainer.global_step % int(trainer.val_check_batch or 1) == 0
