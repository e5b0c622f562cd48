"""One session of training: when it ends, and how many steps training has, if that is given as a time.

Steps are planned from the speed of the first minutes, and planned again only where the machine turns out so much slower
or faster that the time would not be kept, or not be used.  Plans are written down at once (`RunFolder.plan`): training
that goes on keeps them, so that its rates are those of training that was never interrupted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lightning.pytorch import Callback, LightningModule, Trainer

from interp.train.schedule import MOST_STEPS, Steps

MEASURE_SHARE, MEASURE_S = 0.05, 90.0  # of the time that training may take, but no longer: workers start, caches fill
FEWEST_STEPS = 20
SAFETY = 0.95  # of the speed measured: a machine is rarely faster later on
KEPT = (0.85, 1.02)  # of the time: where it is foreseen to end outside of them, steps are planned again
SHORTEST_S = 1e-3  # of whatever is measured
VALIDATING = 0.2  # of the time that is left when steps are planned, at most


@dataclass(frozen=True, slots=True)
class Limits:
    """What ends training and a session of it.

    training_s    seconds that training may take in all; None where its steps are given
    validations   how many there are in that time, if it is not too short for them
    session_s     seconds of a session; None for no end
    stop          asked after every step: whether to end the session
    """

    training_s: float | None
    validations: int
    session_s: float | None = None
    stop: Callable[[], bool] = lambda: False


class Session(Callback):
    """Plans the steps if need be, and ends the session after a step.

    steps          as planned so far; None while they are not known
    planned        told them, on every process, where they are planned
    validation_s   how long one validation takes
    begun_s        when the session began, by the clock
    """

    def __init__(
        self,
        limits: Limits,
        steps: Steps | None,
        planned: Callable[[Steps], None],
        validation_s: Callable[[], float],
        begun_s: float,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.limits, self.steps, self.planned = limits, steps, planned
        self.validation_s, self.clock = validation_s, clock
        self.before_s = 0.0  # in earlier sessions
        self._begun_s = begun_s
        self._first_s, self._first_step = 0.0, -1

    @property
    def seconds(self) -> float:
        """How long training has taken, all sessions together."""
        return self.before_s + self.clock() - self._begun_s

    def on_train_batch_end(self, trainer: Trainer, pl_module: LightningModule, *_: Any) -> None:
        """Plan the steps if they can or must be, end the session if it is time."""
        now = self.clock()
        if self._first_step < 0:  # (the first step of a session takes longer than the others)
            self._first_s, self._first_step = now, trainer.global_step
        ends = self.limits.session_s is not None and now - self._begun_s > self.limits.session_s
        ends = trainer.strategy.broadcast(ends or self.limits.stop())
        if self.limits.training_s is not None:
            if self.steps is None:
                self._plan_if_known(trainer, now, self.limits.training_s, ends)
            else:
                self._plan_again_if_need_be(trainer, now, self.limits.training_s, self.steps)
        if ends:
            last_step(trainer, trainer.global_step)

    def state_dict(self) -> dict[str, Any]:
        """How long it has taken."""
        return {"seconds": self.seconds}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Go on from there."""
        self.before_s = state_dict["seconds"]

    def _plan_if_known(self, trainer: Trainer, now: float, allowed_s: float, ends: bool) -> None:
        step = trainer.global_step
        measured, measured_s = step - self._first_step, now - self._first_s
        enough = measured >= FEWEST_STEPS and (ends or measured_s > min(MEASURE_S, MEASURE_SHARE * allowed_s))
        late = self.seconds > allowed_s
        left_s, each_s = max(allowed_s - self.seconds, 0.0), max(self.validation_s(), SHORTEST_S)
        validations = min(self.limits.validations, max(1, int(VALIDATING * left_s / each_s)))
        left_s = max(left_s - validations * each_s, 0.0)
        more = _steps_in(left_s, measured_s / measured, step) if measured else 0
        known, steps, every = trainer.strategy.broadcast(
            (enough or late, step + more, validate_every(step + more, validations))
        )
        if known:
            self._take_up(trainer, Steps(((step, steps),), every))
            trainer.val_check_batch = every

    def _plan_again_if_need_be(self, trainer: Trainer, now: float, allowed_s: float, known: Steps) -> None:
        step, (planned_at, steps), every = trainer.global_step, known.plans[-1], known.validate_every
        gone_s, measured_s, measured = self.seconds, now - self._first_s, step - self._first_step
        validation_s = self.validation_s()
        due = measured >= FEWEST_STEPS and measured_s >= MEASURE_SHARE * allowed_s
        if trainer.strategy.broadcast(not planned_at < step < steps or not (due or gone_s > KEPT[1] * allowed_s)):
            return
        validated = (step - 1) // every - (self._first_step - 1) // every  # (that of this step is still to come)
        each_s = max(measured_s - validated * validation_s, SHORTEST_S) / max(measured, 1) + validation_s / every
        self._first_s, self._first_step = now, step
        kept = KEPT[0] * allowed_s <= gone_s + (steps - step) * each_s <= KEPT[1] * allowed_s
        more = _steps_in(max(allowed_s - gone_s, 0.0), each_s, step)
        kept, more = trainer.strategy.broadcast((kept, more))
        if not kept:
            self._take_up(trainer, Steps((*known.plans, (step, step + more)), every))

    def _take_up(self, trainer: Trainer, steps: Steps) -> None:
        self.steps = steps
        self.planned(steps)
        last_step(trainer, steps.last)


def _steps_in(left_s: float, each_s: float, step: int) -> int:
    """How many more steps after this one the time that is left is worth; as many as a run may have at most."""
    return int(min(left_s * SAFETY / each_s, MOST_STEPS - 1 - step))


def validate_every(steps: int, validations: int) -> int:
    """Steps from one validation to the next, so that the last is at the end, or near."""
    return max(1, -(-steps // validations))


def last_step(trainer: Trainer, step: int) -> None:
    """Have the trainer end after a step, without validation; it does so by itself if it is told beforehand."""
    trainer.fit_loop.epoch_loop.max_steps = step
