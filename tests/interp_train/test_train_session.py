"""When training ends: the steps that a time is worth, fixed once."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from interp.train.session import Limits, Session, validate_every


def trained(training_s: float, step_s: float, session_s: float | None = None, validation_s: float = 0.0) -> Any:
    """A session with a clock that goes on by `step_s` with each step, and what became of it."""
    now = [0.0]
    trainer: Any = SimpleNamespace(
        strategy=SimpleNamespace(broadcast=lambda value: value),
        fit_loop=SimpleNamespace(epoch_loop=SimpleNamespace(max_steps=-1)),
        global_step=0,
        fixed=[],
    )
    fix = lambda steps, level: trainer.fixed.append((steps, level))  # noqa: E731
    session = Session(Limits(training_s, 10, session_s), fix, lambda: validation_s, 0.0, lambda: now[0])
    for _ in range(100_000):
        trainer.max_steps = trainer.fit_loop.epoch_loop.max_steps
        if trainer.global_step == trainer.max_steps:
            break
        now[0] += step_s
        trainer.global_step += 1
        session.on_train_batch_end(trainer, None)  # type: ignore[arg-type]
    trainer.taken_s = now[0]
    return trainer


@pytest.mark.parametrize("validation_s", [0.0, 3.0])
def test_the_steps_take_the_time_that_there_is(validation_s: float) -> None:
    done = trained(1000, step_s=0.1, validation_s=validation_s)
    assert len(done.fixed) == 1
    taken_s = done.taken_s + 10 * validation_s
    assert 0.9 * 1000 < taken_s <= 1000  # 5 % are left for what takes longer than in the first minutes


def test_a_machine_too_slow_ends_where_it_is() -> None:
    done = trained(10, step_s=4.0)
    assert done.fixed == [(3, 3)]


def test_a_session_ends_and_leaves_the_rest() -> None:
    done = trained(1000, step_s=0.1, session_s=20)
    assert done.taken_s == pytest.approx(20, abs=0.2)
    ((steps, level),) = done.fixed  # known by then, and better so than measured anew each time
    assert steps > 5000 and level == done.global_step


def test_validations_end_with_the_last_step() -> None:
    for steps in (1, 7, 10, 99, 1000):
        assert steps - 10 < validate_every(steps, 10) * 10 - 9 <= steps + 10
        assert validate_every(steps, 1) == steps
