"""Aggregates against numbers worked out by hand, and against numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scored import NAN, row, scored

from interp.evaluate.tables import (
    binned,
    breaks_at,
    by_position,
    edges_of,
    least,
    lowest,
    mean_of,
    per_sequence,
    pooled,
    split,
    values,
)

HAND = [
    row(sequence="a", position=1, psnr=30.0, motion_px=0.0),
    row(sequence="a", position=2, psnr=34.0, motion_px=1.0),
    row(sequence="a", position=1, psnr=NAN, motion_px=1.0),
    row(sequence="b", position=1, psnr=20.0, motion_px=2.0),
]


def test_pooled_and_per_sequence_by_hand() -> None:
    # pooled: 30, 34, 20; of sequences: 32 and 20
    found = pooled(HAND, "psnr")
    assert (found.mean, found.count) == (28.0, 3) and found.std == pytest.approx(math.sqrt((4 + 36 + 64) / 3))
    found = per_sequence(HAND, "psnr")
    assert (found.mean, found.std, found.count) == (26.0, 6.0, 2)


def test_positions_and_worst_by_hand() -> None:
    places = by_position(reversed(HAND), "psnr")
    assert list(places) == [1, 2] and (places[1].mean, places[2].mean) == (25.0, 34.0)
    assert lowest(HAND, "psnr") is HAND[3] and least(HAND, "psnr") == 20.0


def test_aggregates_are_numpys() -> None:
    rows = scored(groups=3)
    table = values(rows, "ssim")
    assert pooled(rows, "ssim").mean == pytest.approx(table.mean(), rel=1e-12)
    assert pooled(rows, "ssim").std == pytest.approx(table.std(), rel=1e-12)
    means = [np.mean(values(part, "ssim")) for part in split(rows, lambda one: one.sequence).values()]
    assert per_sequence(rows, "ssim").std == pytest.approx(np.std(means), rel=1e-12)


def test_what_is_not_known_is_left_out() -> None:
    nothing = [row(), row(sequence="b")]
    for found in (mean_of([]), pooled(nothing, "psnr"), per_sequence(nothing, "psnr")):
        assert math.isnan(found.mean) and math.isnan(found.std) and found.count == 0
    assert lowest(nothing, "psnr") is None and math.isnan(least(nothing, "psnr"))
    assert edges_of(values(nothing, "motion_px")) == [] and binned(nothing, "motion_px", "psnr", [0, 1]) == []


def test_frames_without_error_do_not_stop_the_rest() -> None:
    found = mean_of([math.inf, 30.0])
    assert found.mean == math.inf and math.isnan(found.std)


def test_bins_by_hand() -> None:
    low, high = binned(HAND, "motion_px", "psnr", [0, 1, 2])
    assert (low.low, low.high, low.at, low.score.mean, low.score.count) == (0, 1, 0.0, 30.0, 1)
    assert (high.low, high.high, high.at, high.score.mean) == (1, 2, 1.5, 27.0)


def test_where_scores_break_down() -> None:
    rows = [row(motion_px=float(at), psnr=psnr) for at, psnr in ((1, 30.0), (2, 31.0), (3, 27.5), (4, 26.5), (5, 20.0))]
    bins = binned(rows, "motion_px", "psnr", edges_of(values(rows, "motion_px")))
    found = breaks_at(bins, 3.0)
    assert found is not None and found.low == 4
    assert breaks_at(bins, 12.0) is None and breaks_at([], 3.0) is None


def test_few_values_are_a_bin_each() -> None:
    edges = edges_of(np.array([100.0, -100.0, 0.0, 0.0, NAN]))
    found = binned([row(offset_us=at, psnr=30 + at) for at in (-100.0, 0.0, 100.0)], "offset_us", "psnr", edges)
    assert [(one.at, one.score.mean) for one in found] == [(-100, -70), (0, 30), (100, 130)]


@pytest.mark.parametrize("spread", [(0.0, 250.0), (0.01, 0.9), (40.0, 60.0), (-3.0, 8.0), (0.0, 1e-4), (3.0, 1e6)])
def test_bins_hold_every_value_once(spread: tuple[float, float]) -> None:
    places = np.append(np.random.default_rng(0).uniform(*spread, 200), spread)
    rows = [row(motion_px=float(at), psnr=float(at)) for at in places]
    edges = edges_of(places)
    found = binned(rows, "motion_px", "psnr", edges)
    assert edges == sorted(edges) and 3 <= len(edges) <= 12
    assert sum(one.score.count for one in found) == len(rows)
    assert all(one.low <= one.score.mean <= one.high and one.at == pytest.approx(one.score.mean) for one in found)
    digits = {f"{abs(edge):.3e}"[:5] for edge in edges if edge}
    assert all(float(digit) == round(float(digit), 1) for digit in digits), "edges are round numbers"


def test_wide_conditions_have_round_edges_over_two_decades_and_one_bin_below() -> None:
    assert edges_of(np.geomspace(0.001, 80, 60)) == [0, 1, 2, 5, 10, 20, 50, 100]
    assert edges_of(np.linspace(0, 50, 60)) == [0, 1, 2, 5, 10, 20, 50]


def test_a_condition_that_does_not_vary_has_no_bins() -> None:
    assert edges_of(np.array([90.5, 100.0])) == edges_of(np.array([-100.0, -90.5])) == []
    assert edges_of(np.array([2.0, 2.0, NAN])) == []
    assert edges_of(np.array([0.408, 0.412, 0.418])) == [] and edges_of(np.array([0.4, 0.45])) == [0.4, 0.45, 0.45]
