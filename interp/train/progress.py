"""What is seen of training while it goes on: a bar with the loss, samples per second and the time that is left."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

from lightning.pytorch import Callback, LightningModule, Trainer

from vid2ev.terminal import bar_of

if TYPE_CHECKING:
    from tqdm import tqdm

STEPS = "{percentage:3.0f}% {bar} step {n_fmt}/{total_fmt}, {elapsed} gone, {remaining} left{postfix}"
SMOOTHING = 0.05  # of the newest step, in loss and speed


class Bar(Callback):
    """A progress bar; logs speed and waiting for samples.

    batch   samples per step, of all processes together
    """

    def __init__(self, batch: int, quiet: bool):
        self.batch, self.quiet = batch, quiet
        self._shown: tqdm | None = None
        self._ended_s = self._waited_s = 0.0
        self._loss, self._step_s, self._wait_s = math.nan, 0.0, 0.0

    def on_train_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Nothing is shown yet."""
        self._ended_s = time.monotonic()

    def on_train_batch_start(self, *_: Any) -> None:
        """Samples are there."""
        self._waited_s = time.monotonic() - self._ended_s

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, outputs: Any, *_: Any) -> None:
        """A step more."""
        now = time.monotonic()
        step_s, self._ended_s = now - self._ended_s, now
        loss = float(outputs["loss"]) if outputs else math.nan
        begun = self._shown is not None
        if math.isfinite(loss):  # (a step that is skipped says nothing of the others)
            self._loss = _smooth(self._loss, loss, not math.isnan(self._loss))
        self._step_s, self._wait_s = _smooth(self._step_s, step_s, begun), _smooth(self._wait_s, self._waited_s, begun)
        speed = self.batch / self._step_s
        pl_module.log_dict({"train/samples_per_s": speed, "train/waiting": self._wait_s / self._step_s})
        if trainer.is_global_zero:
            self._show(trainer, pl_module, speed)

    def on_validation_end(self, *_: Any) -> None:
        """Validation is no part of a step."""
        self._ended_s = time.monotonic()

    def teardown(self, *_: Any, **__: Any) -> None:
        """Leave the terminal in order."""
        if self._shown is not None:
            self._shown.close()
            self._shown = None

    def _show(self, trainer: Trainer, module: LightningModule, speed: float) -> None:
        total = None if trainer.max_steps == -1 else trainer.max_steps
        if self._shown is None:
            first = trainer.global_step - 1
            self._shown = bar_of(self.quiet, STEPS, initial=first)
        self._shown.total = total
        skipped = f", {module.skipped} skipped" if module.skipped else ""
        self._shown.set_postfix_str(f"loss {self._loss:.4f}, {speed:.3g} samples/s{skipped}", refresh=False)
        self._shown.update(trainer.global_step - self._shown.n)


def _smooth(before: float, now: float, begun: bool) -> float:
    return before + SMOOTHING * (now - before) if begun else now
