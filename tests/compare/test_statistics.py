"""Statistics of events against closed forms: Poisson processes, refractory periods, known neighbours, known rates."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from event_streams import busy, events_of, streams
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.compare.comparison import compare
from vid2ev.compare.statistics import EDGES_US, Statistics, statistics_of
from vid2ev.formats import read_events
from vid2ev.stream.events import Events

SIZE = (3, 2)
BAG = Path(__file__).parents[3] / "shared" / "data" / "events" / "evt3_vga_legs.bag"


def poisson(rate_hz: float, seconds: float, size: tuple[int, int], seed: int = 0, on: float = 0.5) -> Events:
    """Events of pixels that fire at random."""
    random = np.random.default_rng(seed)
    n = random.poisson(rate_hz * seconds * size[0] * size[1])
    t = random.integers(0, int(seconds * 1e6), n)
    return events_of(t, random.integers(0, size[0], n), random.integers(0, size[1], n), random.random(n) < on)


def alike(one: Statistics, other: Statistics) -> bool:
    same = np.array_equal(one.counts, other.counts) and np.array_equal(one.intervals, other.intervals)
    return same and one == other


def by_hand(events: Events, size: tuple[int, int], reach_us: int) -> tuple[list[int], list[list[int]], list[int]]:
    """Isolated OFF and ON events, and the intervals of each kind, looking at each pair of events."""
    found, intervals = [0, 0], [[], []]  # type: ignore[var-annotated]
    columns = list(zip(events.t.tolist(), events.x.tolist(), events.y.tolist(), events.p.tolist(), strict=True))
    for i, (t, x, y, p) in enumerate(columns):
        others = [c for j, c in enumerate(columns) if j != i and abs(c[1] - x) <= 1 and abs(c[2] - y) <= 1]
        found[p] += all(abs(c[0] - t) > reach_us for c in others)
        before = [c for c in columns[:i] if c[1:3] == (x, y)]
        if before:
            intervals[int(before[-1][3] == p)].append(t - before[-1][0])
    return found, intervals, [gap for kind in intervals for gap in kind]


@given(streams(), st.sampled_from([0, 1, 40, 3000]))
def test_each_event_is_counted_as_by_hand(events: Events, reach_us: int) -> None:
    isolated, intervals, gaps = by_hand(events, SIZE, reach_us)
    found = statistics_of([events], SIZE, neighbour_us=reach_us)
    assert list(found.isolated) == isolated
    assert found.shortest_us == (min(gaps) if gaps else None)
    for kind in (0, 1):
        assert np.array_equal(found.intervals[kind], np.histogram(intervals[kind], EDGES_US)[0])


@given(streams(), st.lists(st.integers(0, 30), max_size=4))
def test_blocks_may_be_cut_anywhere(events: Events, cuts: list[int]) -> None:
    ends = [0, *sorted(min(cut, len(events)) for cut in cuts), len(events)]
    parts = [events.stretch(a, b) for a, b in pairwise(ends)]
    assert alike(statistics_of(parts, SIZE), statistics_of([events], SIZE))


@pytest.mark.parametrize("begin_us", [-(2**62), -(2**61), -(2**61) + 7, 2**61, 2**62 - 10**6])
def test_it_does_not_matter_when_it_was(begin_us: int) -> None:
    events = busy(60, SIZE)
    at_0, then = (statistics_of([events_of(events.t + t, events.x, events.y, events.p)], SIZE) for t in (0, begin_us))
    assert then.shortest_us == at_0.shortest_us and then.isolated == at_0.isolated
    np.testing.assert_array_equal(then.intervals, at_0.intervals)


def test_intervals_of_chance_are_exponential_as_far_as_they_fit() -> None:
    rate, seconds, size = 40.0, 0.5, (80, 60)
    found = statistics_of([poisson(rate, seconds, size)], size, (0, 500_000))

    def below(s: float) -> float:  # integral of r^2 (T - s) exp(-r s) from 0 to s
        s = min(s, seconds)
        return rate * seconds - 1 + math.exp(-rate * s) * (1 - rate * (seconds - s))

    expected = size[0] * size[1] * np.diff([below((edge - 0.5) / 1e6) if edge else 0.0 for edge in EDGES_US.tolist()])
    counted = found.intervals.sum(axis=0)
    assert np.all(np.abs(counted - expected) <= 5 * np.sqrt(expected) + 5)
    assert found.rate_hz == pytest.approx(rate, rel=0.02)
    assert found.on_share == pytest.approx(0.5, abs=0.02)
    assert found.intervals[1].sum() == pytest.approx(found.intervals[0].sum(), rel=0.03)


def test_isolated_events_of_chance() -> None:
    rate, seconds, reach_us, size = 2.0, 4.0, 5000, (120, 100)
    found = statistics_of([poisson(rate, seconds, size, on=0.25)], size, (0, 4_000_000), neighbour_us=reach_us)
    alone = [rate * math.exp(-2 * neighbours * rate * reach_us / 1e6) for neighbours in (4, 6, 9)]
    corners, border = 4, 2 * (size[0] + size[1] - 4)
    inside = size[0] * size[1] - corners - border
    expected = seconds * (corners * alone[0] + border * alone[1] + inside * alone[2])
    assert abs(sum(found.isolated) - expected) < 5 * math.sqrt(expected)
    assert found.isolated[1] / sum(found.isolated) == pytest.approx(0.25, abs=0.01)


def test_a_refractory_period_is_the_floor_of_the_intervals() -> None:
    random = np.random.default_rng(1)
    t = np.cumsum(500 + random.exponential(300, 20_000).astype(np.int64))
    found = statistics_of([events_of(t)], (1, 1))
    assert found.shortest_us is not None and 500 <= found.shortest_us < 505
    assert found.intervals[:, EDGES_US[1:] <= 500].sum() == 0
    median_us = found.interval_us(50)
    assert median_us is not None and 500 + 300 * math.log(2) < median_us < (500 + 300 * math.log(2)) * 10 ** (1 / 8)
    assert found.about_us(50) == pytest.approx(500 + 300 * math.log(2), rel=0.03)
    assert found.about_us(5) == pytest.approx(500 - 300 * math.log(0.95), rel=0.03)


@pytest.mark.parametrize("gap_us", [9_999_999_999, 36_000_000_000])
def test_intervals_of_hours_are_not_said_to_be_below_anything(gap_us: int) -> None:
    found = statistics_of([events_of(np.array([0, gap_us, 2 * gap_us]))], (1, 1))
    assert found.interval_us(5) is found.interval_us(50) is None and found.as_dict()["interval_us"]["95"] is None
    assert found.about_us(50) is None
    assert f"intervals from {gap_us} us, half above {EDGES_US[-2]} us" in str(found)


def test_a_moving_edge_has_no_isolated_event_and_noise_in_it_is_found() -> None:
    edge = [(1000 * x, x, y, 1) for x in range(30) for y in range(20)]
    noise = [(500_000 + 20_000 * k, 3 * k % 30, 7 * k % 20, 0) for k in range(40)]
    found = statistics_of([events_of(*np.array(edge + noise).T)], (30, 20))
    assert found.isolated == (40, 0)


def test_one_event_and_none() -> None:
    one = statistics_of([events_of([7])], SIZE)
    assert (one.events, one.on_share, one.rate_hz, one.isolated, one.shortest_us) == (1, 1.0, None, (0, 1), None)
    none = statistics_of([], SIZE, (0, 10)).as_dict()
    assert (none["events"], none["on_share"], none["rate_hz"], none["isolated_on_share"]) == (0, None, 0.0, None)


@pytest.mark.parametrize("events", [events_of([3], x=3), events_of([3], y=2)])
def test_events_outside_of_the_sensor_are_refused(events: Events) -> None:
    with pytest.raises(ValueError, match="outside"):
        statistics_of([events], SIZE)


@pytest.mark.parametrize("name", ["t", "x", "y", "p"])
def test_events_in_arrays_of_other_lengths_are_refused(name: str) -> None:
    """(Compiled code would read beyond the end of one of them.)"""
    events = events_of([3, 4])
    short = replace(events, **{name: getattr(events, name)[:1]})
    for made in (lambda: statistics_of([short], SIZE), lambda: compare(events, short, SIZE)):
        with pytest.raises(ValueError, match="expected one length"):
            made()


def test_events_out_of_order_are_refused() -> None:
    with pytest.raises(ValueError, match="order"):
        statistics_of([events_of([5]), events_of([4])], SIZE)


@pytest.mark.skipif(not BAG.exists(), reason=f"needs {BAG}")
def test_a_real_recording_against_numpy() -> None:
    parts = list(read_events(BAG, block=30_000))
    found, events = statistics_of(parts, (640, 480)), Events.concatenate(parts)
    pixel = events.y.astype(np.int64) * 640 + events.x
    order = np.lexsort((np.arange(len(events)), pixel))
    gaps = np.diff(events.t[order])[np.diff(pixel[order]) == 0]
    assert np.array_equal(found.intervals.sum(axis=0), np.histogram(gaps, EDGES_US)[0])
    assert found.shortest_us == int(gaps.min()) and found.events == len(events)
    assert np.array_equal(found.counts.sum(axis=0).ravel(), np.bincount(pixel, minlength=640 * 480))


def test_numbers_are_ready_for_json() -> None:
    numbers = statistics_of([busy(500)], (3, 2)).as_dict()
    assert json.loads(json.dumps(numbers)) == numbers
    assert sum(numbers["intervals_same"]) + sum(numbers["intervals_opposite"]) == 500 - 6


def test_each_number_is_what_its_name_says() -> None:
    """Of two pixels of six: one sends ON, ON, OFF, and one far from it ON; the last two are isolated."""
    events = events_of([0, 4000, 100_000, 200_000], x=[0, 0, 0, 2], p=[1, 1, 0, 1])
    found = statistics_of([events.stretch(0, 1), events.stretch(1, 4)], (3, 2))
    numbers = found.as_dict()
    assert found.span_us == (0, 200_000) and numbers["rate_hz"] == pytest.approx(4 / 6 / 0.2)
    assert numbers["active_share"] == pytest.approx(2 / 6) and numbers["on_share"] == 0.75
    assert found.isolated == (1, 1) and numbers["isolated_on_share"] == 0.5
    same, opposite = (np.flatnonzero(numbers[f"intervals_{name}"]).tolist() for name in ("same", "opposite"))
    assert [EDGES_US[k] <= 4000 < EDGES_US[k + 1] for k in same] == [True]
    assert [EDGES_US[k] <= 96_000 < EDGES_US[k + 1] for k in opposite] == [True]
    assert numbers["interval_us"] == {
        "5": EDGES_US[same[0] + 1],
        "50": EDGES_US[same[0] + 1],
        "95": EDGES_US[opposite[0] + 1],
    }
    assert str(found).startswith("3.33 events/pixel/s, 75 % ON; 1.67 isolated; intervals from 4000 us, half below ")
    assert EDGES_US[-1] == 10**10 and (np.diff(EDGES_US) > 0).all()


@pytest.mark.parametrize(("shortest_us", "low_us"), [(1, EDGES_US[25]), (1400, 1400)])
def test_about_is_even_in_logarithms_within_its_bin(shortest_us: int, low_us: float) -> None:
    intervals = np.zeros((2, len(EDGES_US) - 1), np.int64)
    intervals[0, 25] = 4
    made = Statistics((1, 1), (0, 10**6), np.zeros((2, 1, 1), np.int64), intervals, (0, 0), shortest_us, 5000)
    assert made.about_us(50) == pytest.approx(np.sqrt(low_us * EDGES_US[26]))
