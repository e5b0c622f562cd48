"""Matching: the cheapest of all ways to pair events, by a solver of assignments; what its numbers mean."""

from __future__ import annotations

import numpy as np
import pytest
from event_streams import SIZE, busy, events_of, isolated, streams
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from vid2ev.compare.comparison import Comparison, compare, percentile
from vid2ev.compare.matching import _pair
from vid2ev.stream.events import Events

TIMES = st.one_of(
    st.lists(st.integers(0, span), max_size=14).map(lambda times: np.array(sorted(times), np.int64))
    for span in (4, 20, 100)
)


def partners(a_us: np.ndarray, b_us: np.ndarray, window_us: int) -> tuple[np.ndarray, np.ndarray]:
    """The indices of the events that are paired, of two ascending series of times [us]: the first of one with the
    first of the other, and so on."""
    a_kept, b_kept = np.zeros(len(a_us), np.bool_), np.zeros(len(b_us), np.bool_)
    scratch = np.empty((3, len(a_us) + len(b_us)), np.int64)
    _pair(a_us, b_us, len(a_us), len(b_us), window_us, a_kept, b_kept, scratch)
    return np.flatnonzero(a_kept), np.flatnonzero(b_kept)


def least_cost(a: np.ndarray, b: np.ndarray, window: int) -> int:
    """Of all assignments, in any order, of each event to one of the other stream or to nobody; in half microseconds."""
    apart = 2 * np.abs(a[:, None] - b[None, :])
    alone = np.full((len(a), len(a)), window), np.full((len(b), len(b)), window)
    cost = np.block([[apart, alone[0]], [alone[1], np.zeros((len(b), len(a)), np.int64)]])
    return int(cost[linear_sum_assignment(cost)].sum())


@given(a=TIMES, b=TIMES, window=st.sampled_from([1, 2, 3, 7, 20, 200]))
@settings(max_examples=600)
def test_no_way_to_pair_is_cheaper(a: np.ndarray, b: np.ndarray, window: int) -> None:
    i, j = partners(a, b, window)
    apart = np.abs(a[i] - b[j])
    assert len(i) == len(j) and (apart < window).all()
    assert 2 * apart.sum() + window * (len(a) + len(b) - 2 * len(i)) == least_cost(a, b, window)
    mirrored = partners(b, a, window)
    np.testing.assert_array_equal(a[i], a[mirrored[1]])
    np.testing.assert_array_equal(b[j], b[mirrored[0]])


@pytest.mark.parametrize("seed", range(6))
def test_nor_for_long_dense_streams(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b = (np.sort(random.integers(0, 60_000, n)) for n in (200, 170 + 20 * seed))
    window = (300, 1000, 5000)[seed % 3]
    i, j = partners(a, b, window)
    assert 2 * np.abs(a[i] - b[j]).sum() + window * (len(a) + len(b) - 2 * len(i)) == least_cost(a, b, window)


def test_a_missing_event_does_not_shift_those_after_it() -> None:
    train = 1000 * np.arange(500)
    i, j = partners(np.delete(train, 10), train, 5000)
    assert len(i) == 499 and 10 not in j
    np.testing.assert_array_equal(np.delete(train, 10)[i], train[j])
    # (one too many at the beginning and one too few at the end: a shift of all would pair all)
    i, j = partners(np.array([-900, *train[:-1]]), train, 5000)
    assert len(i) == 499 and 0 not in i and 499 not in j


def as_pairs(found: Comparison) -> list[int]:
    """The timing error of each pair, ascending."""
    return np.repeat(np.arange(1 - found.window_us, found.window_us), found.timing_errors).tolist()


@given(a=streams(), b=streams(), window_us=st.sampled_from([1, 40, 5000]))
@settings(max_examples=200)
def test_each_pixel_and_polarity_for_itself(a: Events, b: Events, window_us: int) -> None:
    found = compare(a, b, SIZE, window_us=window_us)
    errors, crossed = [], 0
    for x in range(SIZE[0]):
        for y in range(SIZE[1]):
            at = [[side.t[(side.x == x) & (side.y == y) & (side.p == p)] for p in (0, 1)] for side in (a, b)]
            alone: list[list[np.ndarray]] = [[], []]
            for p in (0, 1):
                i, j = partners(at[0][p], at[1][p], window_us)
                errors += (at[0][p][i] - at[1][p][j]).tolist()
                for side, pairs in enumerate((i, j)):
                    alone[side].append(np.delete(at[side][p], pairs))
            crossed += sum(len(partners(alone[0][p], alone[1][1 - p], window_us)[0]) for p in (0, 1))
    assert as_pairs(found) == sorted(errors)
    assert found.polarity_errors == crossed
    counts = np.zeros((2, *SIZE[::-1]), np.int64)
    for side, count in zip((a, b), counts, strict=True):
        np.add.at(count, (side.y, side.x), 1)
    np.testing.assert_array_equal(found.difference, counts[0] - counts[1])


@given(a=streams(), b=streams())
@settings(max_examples=100)
def test_the_other_way_round_errors_have_the_other_sign(a: Events, b: Events) -> None:
    one, other = compare(a, b, SIZE), compare(b, a, SIZE)
    np.testing.assert_array_equal(one.timing_errors, other.timing_errors[::-1])
    np.testing.assert_array_equal(one.difference, -other.difference)
    assert one.polarity_errors == other.polarity_errors and one.distances == other.distances


@given(a=streams(), b=streams(), later_us=st.sampled_from([-(10**15), 86_400_000_000, 10**17]))
@settings(max_examples=100)
def test_clocks_of_any_beginning_give_the_same_pairs(a: Events, b: Events, later_us: int) -> None:
    moved = [Events(side.t + later_us, side.x, side.y, side.p) for side in (a, b)]
    one, other = compare(a, b, SIZE), compare(*moved, SIZE)
    np.testing.assert_array_equal(one.timing_errors, other.timing_errors)
    assert one.polarity_errors == other.polarity_errors


def test_late_is_positive() -> None:
    events = isolated(101)
    found = compare(Events(events.t + 300, events.x, events.y, events.p), events, SIZE).as_dict()
    assert (found["matched"], found["timing_error_median_us"]) == (101, 300)
    assert (found["timing_error_abs_median_us"], found["timing_error_abs_p95_us"]) == (300, 300)
    early = compare(Events(events.t - 300, events.x, events.y, events.p), events, SIZE)
    assert early.timing_error_us == -300 and early.absolute_timing_error_us == (300, 300)
    assert "300 us early" in str(early)


def test_flipped_polarities_are_counted_and_no_pairs() -> None:
    events = isolated(400)
    flipped = np.arange(400) % 25 == 3
    found = compare(Events(events.t + 10, events.x, events.y, events.p ^ flipped.astype(np.uint8)), events, SIZE)
    assert found.polarity_errors == 16 and found.matched == 384
    assert found.count_error == 0


def test_counts_and_shares() -> None:
    events = busy(1000)
    found = compare(events.select(np.arange(1000) % 50 != 0), events, SIZE).as_dict()
    assert found["count_error"] == pytest.approx(0.02)
    assert (found["matched_share"], found["matched_share_of_reference"]) == (1.0, 0.98)
    # (as many events in all, but elsewhere)
    moved = compare(events_of([1, 2], x=0), events_of([1, 2], x=1), SIZE)
    assert moved.count_error == 2.0


def test_of_nothing_there_are_no_errors() -> None:
    nothing, something = Events.empty(), busy(10)
    none = compare(nothing, nothing, SIZE).as_dict()
    assert none["distance"] == none["count_error"] == 0
    assert none["matched_share"] is none["matched_share_of_reference"] is None
    assert str(compare(nothing, nothing, SIZE)).startswith("events    none in either: there is nothing to compare\n")
    assert none["timing_error_median_us"] is None and none["timing_error_abs_p95_us"] is None
    invented = compare(something, nothing, SIZE)
    assert invented.count_error is None and invented.as_dict()["matched_share"] == 0
    missing = compare(nothing, something, SIZE)
    assert missing.count_error == 1 and missing.distance == invented.distance > 0
    assert "matched   nothing: the reference has no events" in str(invented) and "%" not in str(invented)
    assert "matched   nothing: it has no events" in str(missing)
    assert "polarity" not in f"{invented}{missing}" and "timing" not in f"{invented}{missing}"


def test_percentiles_of_errors_are_of_their_sizes() -> None:
    """Of 100 pairs 91 are 10 us late, 4 are 20 us early, and 5 are 30 us early."""
    events = isolated(100)
    late_us = np.repeat([10, -20, -30], [91, 4, 5])
    found = compare(Events(events.t + late_us, events.x, events.y, events.p), events, SIZE)
    assert (found.timing_error_us, found.absolute_timing_error_us) == (10, (10, 20))


def test_the_text_says_which_share_is_of_which_and_how_long_was_compared() -> None:
    events = isolated(100)
    found = compare(events.select(np.arange(100) % 10 != 1), events, SIZE)
    assert "matched   100 % of them, 90 % of the reference's, within 5 ms\n" in str(found)
    assert str(found).endswith("compared  99 s from 1000000 us on, 3x2")
    assert list(found.as_dict()["distance_by_tau_us"]) == ["1000", "100"]


@given(st.lists(st.integers(-9, 9), min_size=1, max_size=50), st.integers(1, 100))
def test_percentiles_are_those_of_numpy(numbers: list[int], percent: int) -> None:
    counts = np.bincount(np.array(numbers) + 9, minlength=19)
    assert percentile(counts, percent, -9) == np.percentile(numbers, percent, method="inverted_cdf")
