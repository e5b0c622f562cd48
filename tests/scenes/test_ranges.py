"""Draws: within their ends, spread as they say, and each a function of the seed and its own key alone."""

from __future__ import annotations

import math
import statistics
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.scenes.ranges import chance_of, drawn, extremes

NUMBERS = st.floats(-1e6, 1e6)


def draws(node: Any, n: int = 4000, path: str = "key") -> list[Any]:
    return [drawn(node, chance_of(seed), path) for seed in range(n)]


@given(st.tuples(NUMBERS, NUMBERS).map(sorted), st.integers(0, 2**63))
def test_uniform_stays_within_its_ends(ends: list[float], seed: int) -> None:
    assert ends[0] <= drawn({"uniform": ends}, chance_of(seed), "key") <= ends[1]


@given(st.lists(st.integers(-1000, 1000), min_size=2, max_size=2).map(sorted), st.integers(0, 2**63))
def test_integers_are_whole_and_within_their_ends(ends: list[int], seed: int) -> None:
    value = drawn({"integer": ends}, chance_of(seed), "key")
    assert isinstance(value, int) and ends[0] <= value <= ends[1]


def test_distributions_are_what_they_are_called() -> None:
    uniform = draws({"uniform": [2.0, 4.0]})
    assert statistics.mean(uniform) == pytest.approx(3.0, abs=0.03)
    assert statistics.stdev(uniform) == pytest.approx(2 / math.sqrt(12), rel=0.03)
    normal = draws({"normal": [5.0, 2.0]})
    assert statistics.mean(normal) == pytest.approx(5.0, abs=0.1)
    assert statistics.stdev(normal) == pytest.approx(2.0 * 0.98658, rel=0.03)  # (cut off at 3 sd)
    assert max(abs(value - 5) for value in normal) <= 6
    logs = [math.log(value) for value in draws({"log_uniform": [1.0, 100.0]})]
    assert statistics.mean(logs) == pytest.approx(math.log(10), abs=0.08)
    counts = [draws({"integer": [3, 5]}).count(value) for value in (3, 4, 5)]
    assert max(abs(count - 4000 / 3) for count in counts) < 5 * math.sqrt(4000 * 2 / 9)
    directions = draws({"direction": 2.0})
    assert all(math.hypot(*vector) == pytest.approx(2.0) for vector in directions)
    assert max(abs(statistics.mean(axis)) for axis in zip(*directions, strict=True)) < 5 * 2 / math.sqrt(3 * 4000)


def test_lists_are_drawn_number_by_number() -> None:
    places = draws({"uniform": [[0, 10, 20], [1, 11, 20]]})
    assert all(0 <= x <= 1 and 10 <= y <= 11 and z == 20 for x, y, z in places)
    assert abs(statistics.correlation([p[0] for p in places], [p[1] for p in places])) < 0.08


@pytest.mark.parametrize("name", ["a", "a#1", "#3#12", "1\n#2"])
def test_spread_gives_each_of_many_its_own_part(name: str) -> None:
    for seed in range(20):
        paths = [f"objects.{name}#{k}.place" for k in range(8)]
        values = [drawn({"spread": [[0, 0], [8, 8]]}, chance_of(seed), path, (k, 8)) for k, path in enumerate(paths)]
        assert sorted(int(x) for x, _ in values) == sorted(int(y) for _, y in values) == list(range(8))
    orders = {
        tuple(int(drawn({"spread": [0, 8]}, chance_of(seed), f"objects.a#{k}.x", (k, 8))) for k in range(8))
        for seed in range(20)
    }
    assert len(orders) == 20


def test_a_draw_depends_on_nothing_but_seed_and_key() -> None:
    chance = chance_of(7)
    tree = {"a": {"uniform": [0, 1]}, "b": [{"normal": [0, 1]}, {"choice": [1, {"uniform": [2, 3]}]}]}
    whole = drawn(tree, chance, "")
    assert whole["a"] == drawn({"z": 1, "a": tree["a"]}, chance, "")["a"]
    assert whole["b"] == drawn({"b": tree["b"], "a": 3}, chance, "")["b"]
    assert whole["a"] != drawn(tree, chance_of(8), "")["a"]
    # (draws are part of what a scene file means: these may never change)
    assert chance_of(0)("objects.box#0.size_m") == 0.5573692677710815


def test_extremes_reach_both_ends_and_every_choice() -> None:
    tree = {"a": {"uniform": [1, 2]}, "b": {"choice": list(range(7))}, "c": {"choice": ["x", "y", "z"]}}
    seen = [drawn(tree, chance, "") for chance in extremes(tree)]
    assert {value["b"] for value in seen} == set(range(7))
    assert {value["c"] for value in seen} == {"x", "y", "z"}
    assert min(value["a"] for value in seen) == 1 and max(value["a"] for value in seen) == pytest.approx(2)


def test_extremes_reach_both_ends_of_what_is_within_choices() -> None:
    inner = {"choice": ["plain", [3, {"uniform": [5, 6]}], {"choice": [{"integer": [7, 8]}]}]}
    tree = {"a": {"choice": [{"uniform": [1, 2]}, {"x": inner}, {"normal": [0, 1]}]}}
    seen = [drawn(tree, chance, "")["a"] for chance in extremes(tree)]
    numbers = [value for value in seen if isinstance(value, float)]
    assert {round(value, 9) for value in numbers} >= {1, 2, -3, 3}
    within = [value["x"] for value in seen if isinstance(value, dict)]
    assert "plain" in within and {7, 8} <= {value for value in within if isinstance(value, int)}
    assert {round(value[1], 9) for value in within if isinstance(value, list)} >= {5, 6}


@given(st.tuples(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6)).map(sorted), st.integers(0, 2**63))
@example([90023.1915, 1e5], 0)  # (its last draw is rounded up)
def test_log_uniform_stays_within_its_ends(ends: list[float], seed: int) -> None:
    node = {"log_uniform": ends}
    for chance in (chance_of(seed), *extremes(node)):
        assert ends[0] <= drawn(node, chance, "key") <= ends[1]


@pytest.mark.parametrize(
    ("node", "low", "high"),
    [
        ({"uniform": [-4, 8]}, -4, 8),
        ({"log_uniform": [0.25, 8]}, 0.25, 8),
        ({"normal": [5, 2]}, -1, 11),  # (three standard deviations)
        ({"integer": [-2, 7]}, -2, 7),
        ({"spread": [-4, 8]}, -4, 8),
    ],
)
def test_ranges_go_from_one_end_to_the_other(node: dict[str, Any], low: float, high: float) -> None:
    lowest, *_, highest = (drawn(node, chance, "key") for chance in extremes(node))
    assert lowest == pytest.approx(low, rel=1e-9) and highest == pytest.approx(high, rel=1e-9)


def test_log_uniform_has_as_many_draws_below_the_geometric_mean_as_above() -> None:
    low, high = 0.25, 64.0
    below = sum(value < math.sqrt(low * high) for value in draws({"log_uniform": [low, high]}))
    assert abs(below - 2000) < 5 * math.sqrt(1000)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("integer", "two ends of whole numbers, a lower and an upper end"),
        ("log_uniform", "two ends above 0, a lower and an upper end"),
        ("normal", "two ends, a mean and a standard deviation from 0"),
        ("uniform", "two ends, a lower and an upper end"),
    ],
)
def test_what_ends_a_range_takes_is_said(kind: str, said: str) -> None:
    with pytest.raises(UsageError, match=f"expected {said}$"):
        drawn({kind: ["a", "b"]}, chance_of(0), "key")


@pytest.mark.parametrize(
    "node",
    [
        {"uniform": 3},
        {"uniform": [1]},
        {"uniform": [2, 1]},
        {"uniform": ["a", "b"]},
        {"uniform": [[1, 2], [3]]},
        {"uniform": [True, 2]},
        {"uniform": [float("nan"), 2]},
        {"log_uniform": [0, 1]},
        {"normal": [0, -1]},
        {"integer": [0.5, 2]},
        {"choice": []},
        {"choice": 3},
        {"direction": "up"},
    ],
)
def test_what_is_no_range_is_refused_in_one_sentence(node: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=r"^some.key = ") as refused:
        drawn(node, chance_of(0), "some.key")
    assert "expected" in str(refused.value) and "\n" not in str(refused.value)
