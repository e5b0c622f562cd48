"""When training ends: the steps that a time is worth, planned, and planned again where it would not be kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from interp.train.run_folder import RunFolder
from interp.train.schedule import MOST_STEPS, Steps
from interp.train.session import Limits, Session, validate_every


def trained(
    training_s: float | None,
    step_s: Callable[[float], float],
    session_s: float | None = None,
    validation_s: float = 0.0,
    steps: Steps | None = None,
) -> Any:
    """A session with a clock that goes on with each step and validation, and what became of it.

    step_s    how long a step takes, from the time that has passed [s]
    """
    now = [0.0]
    trainer: Any = SimpleNamespace(
        strategy=SimpleNamespace(broadcast=lambda value: value),
        fit_loop=SimpleNamespace(epoch_loop=SimpleNamespace(max_steps=steps.plans[-1][1] if steps else -1)),
        val_check_batch=steps.validate_every if steps else 1 << 62,
        global_step=0,
        steps=steps,
        validations=0,
    )

    def planned(steps: Steps) -> None:
        trainer.steps = steps

    session = Session(Limits(training_s, 10, session_s), steps, planned, lambda: validation_s, 0.0, lambda: now[0])
    for _ in range(100_000):
        trainer.max_steps = trainer.fit_loop.epoch_loop.max_steps
        if trainer.global_step == trainer.max_steps:
            break
        now[0] += step_s(now[0])
        trainer.global_step += 1
        session.on_train_batch_end(trainer, None)  # type: ignore[arg-type]
        if trainer.global_step % trainer.val_check_batch == 0:
            now[0] += validation_s
            trainer.validations += 1
    trainer.taken_s = now[0]
    return trainer


@pytest.mark.parametrize("validation_s", [0.0, 3.0])
def test_the_steps_take_the_time_that_there_is(validation_s: float) -> None:
    done = trained(1000, lambda _: 0.1, validation_s=validation_s)
    assert len(done.steps.plans) == 1  # (so that what goes on from there is the same, however fast)
    assert done.validations in (9, 10)
    assert 0.9 * 1000 < done.taken_s <= 1000  # 5 % are left for what takes longer than in the first minutes


@pytest.mark.parametrize("slower", [0.3, 0.9, 1.04, 1.1, 1.5, 2.0, 5.0])
@pytest.mark.parametrize("since_s", [100, 300, 600])
def test_the_time_is_kept_by_a_machine_that_becomes_slower_and_used_by_one_that_becomes_faster(
    since_s: float, slower: float
) -> None:
    done = trained(1000, lambda now: 0.1 * slower if now > since_s else 0.1, validation_s=3.0)
    assert 0.85 * 1000 < done.taken_s < 1.03 * 1000
    assert done.validations >= 2
    if slower != 1.1:  # (which is no matter where it comes late)
        assert (len(done.steps.plans) > 1) == (not 0.9 <= slower <= 1.04)


def test_steps_that_were_given_are_no_matter_of_time() -> None:
    given = Steps(((0, 1000),), 100)
    done = trained(None, lambda now: 1.0 if now > 10 else 0.1, steps=given)
    assert done.steps is given and done.global_step == 1000


def test_plans_of_an_earlier_session_hold_where_it_is_gone_through_again() -> None:
    """Killed after it had planned again, before the next checkpoint: those steps have the rates that they had."""
    known = Steps(((20, 4000), (900, 3000)), 300)
    done = trained(100, lambda _: 0.1, steps=known)
    assert done.steps.plans[:2] == known.plans
    assert all(at > 900 for at, _ in done.steps.plans[2:])


@pytest.mark.parametrize("training_s", [1e13, 1e308])
def test_a_time_without_end_is_worth_as_many_steps_as_a_run_may_have(training_s: float, tmp_path: Path) -> None:
    """So that it goes on from what its folder says of them."""
    planned = list[Steps]()
    trainer: Any = SimpleNamespace(
        strategy=SimpleNamespace(broadcast=lambda value: value),
        fit_loop=SimpleNamespace(epoch_loop=SimpleNamespace(max_steps=-1)), val_check_batch=1 << 62, global_step=0,
    )  # fmt: skip
    session = Session(Limits(training_s, 10), None, planned.append, lambda: 3.0, 0.0, lambda: 0.1 * trainer.global_step)
    for trainer.global_step in range(1, 2000):
        session.on_train_batch_end(trainer, None)  # type: ignore[arg-type]
    folder = RunFolder(tmp_path / "run", {}, resume=False)
    folder.plan(planned[-1])
    assert folder.steps() == planned[-1] and planned[-1].last == MOST_STEPS - 1
    folder.close()


def test_a_machine_too_slow_ends_where_it_is() -> None:
    done = trained(10, lambda _: 4.0)
    assert done.steps.plans == ((3, 3),)


@pytest.mark.parametrize(("training_s", "most"), [(60, 1), (300, 4), (1500, 10)])
def test_short_trainings_are_validated_less_often(training_s: float, most: int) -> None:
    done = trained(training_s, lambda _: 0.1, validation_s=15.0)
    assert 1 <= done.validations <= most
    assert done.global_step * 0.1 > 0.6 * training_s
    assert done.taken_s <= training_s + 1


def test_a_session_ends_and_leaves_the_rest() -> None:
    done = trained(1000, lambda _: 0.1, session_s=20)
    assert done.taken_s == pytest.approx(20, abs=0.2)
    ((level, steps),) = done.steps.plans  # known by then, and better so than measured anew each time
    assert steps > 5000 and level == done.global_step


def test_validations_end_with_the_last_step() -> None:
    for steps in (1, 7, 10, 99, 1000):
        assert steps - 10 < validate_every(steps, 10) * 10 - 9 <= steps + 10
        assert validate_every(steps, 1) == steps
