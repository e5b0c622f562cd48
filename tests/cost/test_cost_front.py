"""The front, budgets, and what is recommended."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.cost.errors import Errors
from vid2ev.cost.front import AS_FAST, Budget, Row, front, recommended, refusal
from vid2ev.cost.rung import Rung
from vid2ev.errors import UsageError


def row(
    time: float, distance: float | None, us: int | None = 0, *, offered: bool = True, lsb: float | None = None
) -> Row:
    timing = None if us is None else (us, 2 * us)
    return Row(
        Rung(f"{time} {distance}", offered=offered), Errors(distance, 0.1, timing, 1.0, lsb), 7, (2 * time, time)
    )


LADDER = [row(1, 0.5, 900), row(2, 0.1, 60), row(2.5, 0.2, 70), row(4, 0.01, 20), row(9, 0.0, 0)]


@pytest.mark.parametrize(
    ("budget", "time"),
    [
        ("vR=0.5", 1),
        ("vR=0.1", 2),
        ("vR=0.0999", 4),
        ("vR=0", 9),
        ("us=60", 2),
        ("us=60,vR=0.05", 4),
        ("time=1x", 1),
        ("time=3x", 2),
        ("time=3", 2),
        ("time=100x", 9),
        (" vR = 0.3 , time = 3x ", 2),
    ],
)
def test_the_fastest_within_errors_and_the_most_accurate_within_time(budget: str, time: float) -> None:
    best = recommended(LADDER, Budget.parse(budget))
    assert best is not None and best.time == time


def test_what_is_not_offered_is_not_recommended() -> None:
    best = recommended([row(0.1, 0.0, offered=False), *LADDER], Budget.parse("vR=0.05"))
    assert best is LADDER[3]


@pytest.mark.parametrize(("budget", "said"), [("time=0.5x", "time=1x"), ("vR=0.001,time=2x", "vR=0, time=1x each")])
def test_a_budget_that_nothing_meets_says_how_near_one_can_come(budget: str, said: str) -> None:
    assert recommended(LADDER, Budget.parse(budget)) is None
    assert said in refusal(LADDER, Budget.parse(budget))


def test_how_near_one_can_come_is_said_of_what_may_be_recommended() -> None:
    faster = replace(row(0.2, 0.5, lsb=3.0), rung=Rung("frames of an instant", "frames"))
    budget = Budget.parse("time=0.5x")  # (which says nothing of frames: that is no way to meet it)
    assert recommended([faster, *LADDER], budget) is None
    assert "come to time=1x;" in refusal([faster, *LADDER], budget)


def test_what_cannot_be_measured_is_within_no_limit() -> None:
    asked = Budget.parse("lsb=100")
    assert recommended(LADDER, asked) is None
    assert "lsb cannot be measured here" in refusal(LADDER, asked)
    assert not Budget.parse("us=1e9").holds(row(1, 0.5, None))
    assert Budget.parse("us=0").holds(row(1, 0.0, None))  # there are no events that could be late


def test_two_limits_of_a_kind_are_refused() -> None:
    with pytest.raises(UsageError, match="vR is limited twice; expected one limit of each kind"):
        Budget.parse("vR=0.05,us=3,vR=0.4")


def test_no_time_is_refused() -> None:
    with pytest.raises(UsageError, match="'time=0x': no setting takes no time; expected more"):
        Budget.parse("vR=0.05, time=0x")


@pytest.mark.parametrize(
    "text", ["", "vR", "vR=", "vR=x", "vR=-1", "vR=nan", "us=inf", "distance=1", "vR=0.1;us=3", "time=x"]
)
def test_what_is_no_budget_is_refused_in_a_sentence(text: str) -> None:
    with pytest.raises(UsageError, match=r"^budget '.*': expected .* such as ") as refused:
        Budget.parse(text)
    assert "did you mean" not in str(refused.value)


Places = list[tuple[float, float]]
points = st.lists(st.tuples(st.floats(0.01, 100), st.floats(0, 2)), min_size=1, max_size=30)


@given(points)
def test_nothing_is_better_than_the_front_and_the_rest_is_worse_than_some_of_it(
    places: Places,
) -> None:
    rows = [row(time, distance) for time, distance in places]
    ahead = front(rows)
    values = [(each.time, each.errors.distance or 0.0) for each in ahead]
    assert values == sorted(values) and len({error for _, error in values}) == len(values)
    for time, error in places:
        assert any(t <= time and e <= error for t, e in values)
    for time, error in values:
        assert not any((t < time and e <= error) or (t <= time and e < error) for t, e in places)


@given(points, st.floats(0, 2))
def test_the_recommended_is_on_the_front(places: Places, limit: float) -> None:
    rows = [row(time, distance) for time, distance in places]
    best = recommended(rows, Budget.parse(f"vR={limit!r}"))
    within = [(time, error) for time, error in places if error <= limit]
    assert (best is None) == (not within)
    if best is not None:
        as_fast = [error for time, error in within if time <= AS_FAST * min(within)[0]]
        assert best.time <= AS_FAST * min(within)[0] and best.errors.distance == min(as_fast)
        assert best in front(rows)


def test_what_is_as_fast_to_within_noise_is_judged_by_its_error() -> None:
    rows = [row(1.0, 0.03), row(1.04, 0.02), row(1.06, 0.01)]
    assert recommended(rows, Budget.parse("vR=0.05")) is rows[1]


def test_the_margin_of_noise_is_in_and_what_has_no_error_is_the_worst() -> None:
    rows = [row(1.0, 0.03), row(AS_FAST, 0.02)]
    assert recommended(rows, Budget.parse("vR=0.05")) is rows[1]
    assert recommended([row(2.0, None), row(3.0, 0.5)], Budget.parse("time=9x")).time == 3.0  # type: ignore[union-attr]
    assert [each.time for each in front([row(2.0, None), row(3.0, 0.5)])] == [2.0, 3.0]


def test_events_say_nothing_of_frames() -> None:
    frames = replace(row(1.0, 0.01, lsb=20.0), rung=Rung("frames of an instant", "frames"))
    rows = [frames, row(2.0, 0.01, lsb=0.1)]
    assert recommended(rows, Budget.parse("vR=0.05")) is rows[1] and front(rows) == rows[1:]
    assert recommended(rows, Budget.parse("vR=0.05,lsb=30")) is frames
    assert recommended(rows, Budget.parse("vR=0.05,lsb=1")) is rows[1]


def test_frames_alone_are_judged_by_their_own_error() -> None:
    rows = [row(1, None, None, lsb=5.0), row(2, None, None, lsb=0.5), row(3, None, None, lsb=0.7)]
    assert front(rows) == rows[:2]
    assert recommended(rows, Budget.parse("lsb=1")) is rows[1]
    assert recommended(rows, Budget.parse("time=9")) is rows[1]
    assert math.isfinite(rows[0].time)


def test_a_limit_that_is_written_in_other_letters_is_named() -> None:
    for said, meant in (("vr=0.05", "vR"), ("VR=0.05", "vR"), ("Time=3x", "time"), ("coun=0.01", "count")):
        with pytest.raises(UsageError, match=rf"\(did you mean {meant}\?\)$"):
            Budget.parse(said)


@pytest.mark.parametrize(("budget", "kinds"), [("lsb=1", ["dvs"]), ("vR=0.1", ["cis"]), ("time=9x,us=3", ["cis"])])
def test_errors_of_cameras_that_are_not_there_are_refused_at_once(budget: str, kinds: list[str]) -> None:
    with pytest.raises(UsageError, match="cannot be measured here"):
        Budget.parse(budget).check(kinds)
    Budget.parse(budget).check(["cis", "dvs"])
