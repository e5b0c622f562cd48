"""Van Rossum's distance: closed forms, its definition term by term and as an integral, the laws of a metric."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from event_streams import SIZE, busy, events_of, isolated, streams
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.compare.by_pixel import by_pixel
from vid2ev.compare.comparison import BINS, LATEST_US, compare
from vid2ev.compare.distance import TAUS_US, normalised, squared_distances
from vid2ev.stream.events import Events


def squared(a: Events, b: Events, tau_us: float) -> float:
    sides = (by_pixel([side], SIZE[0], range(SIZE[1])) for side in (a, b))
    return float(squared_distances(*sides, tau_us).sum())


def distance(a: Events, b: Events, tau_us: float = TAUS_US[0]) -> float:
    return normalised(squared(a, b, tau_us), len(a), len(b))


def term_by_term(a: Events, b: Events, tau_us: float) -> float:
    """1/2 sum_ij w_i w_j exp(-|t_i - t_j| / tau) over the pairs of one pixel."""
    both = Events.concatenate([a, b]) if len(a) and len(b) else (a if len(a) else b)
    weight = (2.0 * both.p - 1.0) * np.where(np.arange(len(both)) < len(a), 1.0, -1.0)
    near = np.exp(-np.abs(both.t[:, None] - both.t[None, :]) / tau_us)
    same = (both.x[:, None] == both.x[None, :]) & (both.y[:, None] == both.y[None, :])
    return 0.5 * float(weight @ (near * same) @ weight)


@pytest.mark.parametrize("begin_us", [-LATEST_US, LATEST_US - 200_000])
def test_it_does_not_matter_when_it_was(begin_us: int) -> None:
    a, b = busy(60), busy(50, seed=1)
    late_a, late_b = (events_of(side.t + begin_us, side.x, side.y, side.p) for side in (a, b))
    at_0, then = compare(a, b, SIZE), compare(late_a, late_b, SIZE)
    assert then.as_dict() | {"span_us": None} == at_0.as_dict() | {"span_us": None}
    early = events_of([-LATEST_US], 1)
    apart = compare(early, events_of([LATEST_US], 1), SIZE)
    assert (apart.matched, apart.distance) == (0, 1.0)
    for too_far in (-1 - LATEST_US, 1 + LATEST_US, 2**62, -(2**63), 2**63 - 1):
        with pytest.raises(ValueError, match="expected times within"):
            compare(early, events_of([too_far], 1), SIZE)


@given(a=streams(), b=streams(), tau_us=st.sampled_from([1.0, 37.5, 1000.0, 1e6]))
@settings(max_examples=300)
def test_is_the_double_sum(a: Events, b: Events, tau_us: float) -> None:
    assert squared(a, b, tau_us) == pytest.approx(term_by_term(a, b, tau_us), rel=1e-9, abs=1e-9)


def test_is_the_integral_of_the_squared_difference_of_the_traces() -> None:
    tau_us, a, b = 300.0, busy(12, duration_us=2000, seed=1), busy(9, duration_us=2000, seed=2)
    step_us = 0.05
    t = np.arange(-10, 2000 + 30 * tau_us, step_us)
    integral = 0.0
    for x in range(SIZE[0]):
        for y in range(SIZE[1]):
            trace = np.zeros_like(t)
            for side, sign in ((a, 1), (b, -1)):
                for k in np.flatnonzero((side.x == x) & (side.y == y)):
                    late = t - side.t[k]
                    trace += sign * (2 * int(side.p[k]) - 1) * np.where(late > 0, np.exp(-np.abs(late) / tau_us), 0)
            integral += float(np.sum(trace**2)) * step_us / tau_us
    assert squared(a, b, tau_us) == pytest.approx(integral, rel=1e-3)


@pytest.mark.parametrize("tau_us", TAUS_US)
def test_the_same_is_exactly_0(tau_us: int) -> None:
    events = busy(5000)
    assert distance(events, events, tau_us) == 0
    assert distance(Events.empty(), Events.empty(), tau_us) == 0


@pytest.mark.parametrize("missing", [0, 3, 999])
def test_one_event_missing_of_n_costs_half_an_event(missing: int) -> None:
    events = busy(1000)
    rest = events.select(np.arange(1000) != missing)
    assert distance(rest, events) == pytest.approx(1 / 1999, rel=1e-12)
    assert squared(rest, events, 100) == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("shift_us", [-3000, -1, 1, 50, 700])
@pytest.mark.parametrize("tau_us", TAUS_US)
def test_a_shift_costs_1_less_the_decay(shift_us: int, tau_us: int) -> None:
    events = isolated(200)
    late = Events(events.t + shift_us, events.x, events.y, events.p)
    assert distance(late, events, tau_us) == pytest.approx(-math.expm1(-abs(shift_us) / tau_us), rel=1e-12)


def test_two_percent_dropped_is_a_hundredth() -> None:
    events = busy(50_000)
    kept = events.select(np.arange(50_000) % 50 != 7)
    assert distance(kept, events) == pytest.approx(0.02 / 1.98, rel=0.1)
    far = isolated(5000)
    assert distance(far.select(np.arange(5000) % 50 != 7), far) == pytest.approx(0.02 / 1.98, rel=1e-12)


def test_jitter_costs_what_the_normal_distribution_says() -> None:
    sigma_us, n = 500.0, 40_000
    events = isolated(n)
    jitter = np.rint(np.random.default_rng(5).normal(0, sigma_us, n)).astype(np.int64)
    moved = Events(events.t + jitter, events.x, events.y, events.p)
    for tau_us in TAUS_US:
        ratio = sigma_us / tau_us
        expected = 1 - math.exp(ratio**2 / 2) * math.erfc(ratio / math.sqrt(2))
        assert distance(moved, events, tau_us) == pytest.approx(expected, rel=0.01)


def test_a_wrong_polarity_costs_2_and_n_events_at_once_n_times_n() -> None:
    events = isolated(100)
    wrong = Events(events.t, events.x, events.y, 1 - events.p)
    assert distance(wrong, events) == pytest.approx(2, rel=1e-12)
    assert squared(events_of([5] * 7), Events.empty(), 1000) == pytest.approx(49 / 2, rel=1e-12)


def test_pixels_know_nothing_of_each_other() -> None:
    assert squared(events_of([0], x=1), events_of([0], x=2), 1e9) == pytest.approx(1, rel=1e-12)
    assert squared(events_of([0], y=0), events_of([0], y=1), 1e9) == pytest.approx(1, rel=1e-12)


@given(a=streams(), b=streams(), c=streams(), tau_us=st.sampled_from([20.0, 1000.0]))
@settings(max_examples=200)
def test_its_root_is_a_metric(a: Events, b: Events, c: Events, tau_us: float) -> None:
    sides = [math.sqrt(squared(*pair, tau_us)) for pair in ((a, b), (b, c), (a, c))]
    assert squared(a, b, tau_us) == squared(b, a, tau_us) >= 0
    assert sides[2] <= sides[0] + sides[1] + 1e-9
    assert squared(a, a, tau_us) == 0


@given(a=streams(), b=streams(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=100)
def test_the_order_of_events_at_one_instant_is_of_no_account(a: Events, b: Events, seed: int) -> None:
    mixed = np.lexsort((np.random.default_rng(seed).random(len(a)), a.t))
    assert squared(a.select(mixed), b, 100) == squared(a, b, 100)


@given(a=streams(), b=streams(), later_us=st.sampled_from([-(10**15), 86_400_000_000, 10**17]))
@settings(max_examples=100)
def test_clocks_of_any_beginning_give_the_same(a: Events, b: Events, later_us: int) -> None:
    moved = (Events(side.t + later_us, side.x, side.y, side.p) for side in (a, b))
    assert squared(*moved, 100) == squared(a, b, 100)


@given(events=streams(most=60), cuts=st.lists(st.integers(0, 60), max_size=5))
@settings(max_examples=100)
def test_blocks_and_bands_may_be_cut_anywhere(events: Events, cuts: list[int]) -> None:
    edges = sorted({0, len(events), *(min(cut, len(events)) for cut in cuts)})
    whole = by_pixel([events], SIZE[0], range(SIZE[1]))
    for rows in (range(SIZE[1]), range(1), range(1, SIZE[1])):
        part = by_pixel((events.stretch(*edge) for edge in pairwise(edges)), SIZE[0], rows)
        first, last = whole.begins[rows.start * SIZE[0]], whole.begins[rows.stop * SIZE[0]]
        np.testing.assert_array_equal(part.moments, whole.moments[first:last])
        np.testing.assert_array_equal(part.counts, whole.counts[rows.start * SIZE[0] : rows.stop * SIZE[0]])


def test_the_parts_of_the_time_add_up() -> None:
    a, b = busy(3000, seed=1), busy(2000, seed=2)
    found = compare(a, b, SIZE)
    squared_by_time, events = found.by_time
    assert 2 * squared_by_time.sum() / 5000 == pytest.approx(found.distance, rel=1e-12)
    assert events.sum() == 5000 and (squared_by_time > 0).all()
    quiet = compare(a.select(a.t > 100_000), a, SIZE).by_time[0]
    assert (quiet[:50] > 0).all() and quiet[55:].max() < 1e-3 * quiet[:45].min()


@pytest.mark.parametrize("later_us", [0, 10**9, -(10**6)])
def test_parts_are_of_the_time_compared_whenever_it_begins(later_us: int) -> None:
    a, b = (busy(n, duration_us=200_000, seed=n) for n in (3000, 2000))
    a, b = (Events(side.t + later_us, side.x, side.y, side.p) for side in (a, b))
    t = np.concatenate([a.t, b.t])
    edges = t.min() + np.arange(BINS + 1) * ((t.max() + 1 - t.min()) / BINS)
    found = compare(a, b, SIZE)
    np.testing.assert_array_equal(found.by_time[1], np.histogram(t, edges)[0])
    assert found.by_time.shape == (2, BINS)


def test_one_event_beside_none_is_all_that_can_differ() -> None:
    assert distance(events_of([5]), Events.empty()) == pytest.approx(1, rel=1e-12)


def test_what_is_no_stream_of_that_sensor_is_refused() -> None:
    good = busy(10)
    for bad in (events_of([1], x=3), events_of([1], y=2), good.select(np.argsort(-good.t))):
        with pytest.raises(ValueError, match="out"):
            compare(good, bad, SIZE)


def test_blocks_out_of_order_are_refused() -> None:
    events = events_of([1, 3, 3, 5])
    for first, then in ((2, 4), (0, 2)):  # (which goes on at the instant of the last event, or before it)
        blocks = [events.stretch(first, 4), events.stretch(0, then)]
        with pytest.raises(ValueError, match="out of order of time"):
            by_pixel(blocks, SIZE[0], range(SIZE[1]))
    parts = by_pixel([events.stretch(0, 2), Events.empty(), events.stretch(2, 4)], SIZE[0], range(SIZE[1]))
    np.testing.assert_array_equal(parts.moments >> 1, events.t)
