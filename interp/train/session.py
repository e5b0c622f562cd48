"""One session of training: when it ends, and how many steps training has, if that is given as a time.

Steps are fixed once, from the speed of the first minutes, and written down at once (`RunFolder.fix`): training that
goes on keeps them, so that its rates are those of training that was never interrupted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lightning.pytorch import Callback, LightningModule, Trainer

MEASURE_SHARE, MEASURE_S = 0.05, 90.0  # of the time that training may take, but no longer: workers start, caches fill
FEWEST_STEPS = 20
SAFETY = 0.95  # of the speed measured: a machine is rarely faster later on


@dataclass(frozen=True, slots=True)
class Limits:
    """What ends training and a session of it.

    training_s    seconds that training may take in all, where its steps are not given
    validations   how many there are in that time
    session_s     seconds of a session; None for no end
    stop          asked after every step: whether to end the session
    """

    training_s: float
    validations: int
    session_s: float | None = None
    stop: Callable[[], bool] = lambda: False


class Session(Callback):
    """Fixes the steps if need be, and ends the session after a step.

    fix            told (steps, level) once they are known, on every process
    validation_s   how long one validation takes
    begun_s        when the session began, by the clock
    """

    def __init__(
        self,
        limits: Limits,
        fix: Callable[[int, int], None],
        validation_s: Callable[[], float],
        begun_s: float,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.limits, self.fix, self.validation_s, self.clock = limits, fix, validation_s, clock
        self.before_s = 0.0  # in earlier sessions
        self._begun_s = begun_s
        self._first_s, self._first_step = 0.0, -1

    @property
    def seconds(self) -> float:
        """How long training has taken, all sessions together."""
        return self.before_s + self.clock() - self._begun_s

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Fix the steps if they can be, end the session if it is time."""
        now = self.clock()
        if self._first_step < 0:  # (the first step of a session takes longer than the others)
            self._first_s, self._first_step = now, trainer.global_step
        ends = self.limits.session_s is not None and now - self._begun_s > self.limits.session_s
        ends = trainer.strategy.broadcast(ends or self.limits.stop())
        if trainer.max_steps == -1:
            self._fix_if_known(trainer, now, ends)
        if ends:
            last_step(trainer, trainer.global_step)

    def state_dict(self) -> dict[str, Any]:
        """How long it has taken."""
        return {"seconds": self.seconds}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Go on from there."""
        self.before_s = state_dict["seconds"]

    def _fix_if_known(self, trainer: Trainer, now: float, ends: bool) -> None:
        step, allowed_s = trainer.global_step, self.limits.training_s
        measured, measured_s = step - self._first_step, now - self._first_s
        enough = measured >= FEWEST_STEPS and (ends or measured_s > min(MEASURE_S, MEASURE_SHARE * allowed_s))
        late = self.seconds > allowed_s
        left_s = allowed_s - self.seconds - self.limits.validations * self.validation_s()
        more = int(max(left_s, 0) * SAFETY * measured / measured_s) if measured else 0
        known, steps = trainer.strategy.broadcast((enough or late, step + more))
        if known:
            self.fix(steps, step)
            last_step(trainer, steps)
            trainer.val_check_batch = validate_every(steps, self.limits.validations)


def validate_every(steps: int, validations: int) -> int:
    """Steps from one validation to the next, so that the last is at the end, or near."""
    return max(1, -(-steps // validations))


def last_step(trainer: Trainer, step: int) -> None:
    """Have the trainer end after a step, without validation; it does so by itself if it is told beforehand."""
    trainer.fit_loop.epoch_loop.max_steps = step
