"""Learning rates: a function of the step, that rises, stays and falls."""

from __future__ import annotations

import itertools

import pytest

from interp.train.schedule import Schedule

TWICE = Schedule(0, 0.0, ((3, 9), (5, 5)))


def test_rates_rise_to_the_highest_and_fall_to_the_end() -> None:
    schedule = Schedule(warm_up=10, end=0.01, plans=((0, 100),))
    shares = [schedule.share(step) for step in range(101)]
    assert shares[0] == pytest.approx(0.1, rel=0.01)  # (a hundredth of the way down is nothing)
    assert shares[100] == pytest.approx(0.01)
    top = shares.index(max(shares))
    assert top == 9
    assert all(a > b for a, b in itertools.pairwise(shares[top:]))
    # Half the way down in steps is half the way down in rates: the cosine is even about its middle.
    assert schedule.share(50) == pytest.approx((1 + 0.01) / 2)


def test_rates_up_to_the_step_where_steps_are_planned_do_not_depend_on_them() -> None:
    before, after = Schedule(5, 0.01), Schedule(5, 0.01, ((40, 300),))
    assert [before.share(step) for step in range(41)] == [after.share(step) for step in range(41)]
    assert after.share(41) < 1
    assert after.share(300) == pytest.approx(0.01)


@pytest.mark.parametrize("steps", [150, 200, 600])
def test_steps_planned_again_do_not_make_the_rate_jump_and_end_where_they_should(steps: int) -> None:
    once, again = Schedule(0, 0.01, ((20, 300),)), Schedule(0, 0.01, ((20, 300), (100, steps)))
    assert once.plans[-1][1] == once.steps == 300 and again.steps == steps
    assert [again.share(step) for step in range(101)] == [once.share(step) for step in range(101)]
    ways = [again.progress(step) for step in range(100, steps + 1)]
    assert ways == pytest.approx([ways[0] + (1 - ways[0]) * k / (steps - 100) for k in range(steps - 99)])
    assert ways[-1] == pytest.approx(1)


@pytest.mark.parametrize(
    "schedule", [Schedule(0, 0.0, ((0, 1),)), Schedule(0, 0.5, ((7, 7),)), Schedule(50, 0.0, ((0, 10),)), TWICE]
)
def test_short_training_has_rates_too(schedule: Schedule) -> None:
    assert all(0 <= schedule.share(step) <= 1 for step in range(20))
    assert all(0 <= schedule.progress(step) <= 1 for step in range(20))
