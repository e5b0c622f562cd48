"""Bounds that chance exceeds in 1 of 1000 cases are those, and not much more than those."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import poisson

from vid2ev.bounds.chances import _chernoff, _counted, _pixels, at_least, at_most, surely
from vid2ev.bounds.scene import Scene
from vid2ev.physics.mismatch import clipped, fill_thresholds
from vid2ev.physics.thresholds import _of_pixels, chances_below, soon
from vid2ev.sensors.spec import DvsSpec

from .clips import clip
from .measured import scene_of

CASES = 40_000


def scene(by_pixel: np.ndarray) -> Scene:
    """A scene of so many pixels of 0, 1, ... events; they are no more than that."""
    size, frames = clip("edge")
    seen = scene_of(DvsSpec(), size, frames)
    numbers = np.flatnonzero(by_pixel)
    travel = seen.threshold * by_pixel[numbers] * numbers
    of_all = seen.travel / seen.travel.sum() * travel.sum()
    return dataclasses.replace(seen, by_pixel=np.stack([numbers, travel]), travel=of_all)


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize(
    ("by_pixel", "mean"),
    [
        (np.array([0, 400, 300, 200]), 0.03),
        (np.array([0, 5000, 0, 100, *[0] * 40, 5]), 0.001),
        (np.array([0, 500, *[0] * 60, 300]), 0.004),
        (np.array([0, 30, 20]), 0.3),
        (np.array([0, *[100] * 80]), 0.01),
    ],
)
def test_sums_exceed_the_bound_in_one_of_a_thousand_cases(by_pixel: np.ndarray, mean: float, whole: bool) -> None:
    """Of pixels that change from any of their events on, or all together, with the mean that was asked for."""
    draws, seen = np.random.default_rng(1), scene(by_pixel)
    sums = np.zeros(CASES)
    for events, pixels in enumerate(by_pixel):
        most = events + 2.0
        chance = (1.0 if whole else 2.0) * mean * events / most
        many = draws.binomial(pixels, chance, CASES)
        parts = most * (np.ones(many.sum()) if whole else draws.random(many.sum()))
        sums += np.bincount(np.repeat(np.arange(CASES), many), parts, CASES)
    assert sums.mean() == pytest.approx(mean * seen.events, rel=0.03)
    bound = surely(seen, mean, whole=whole) * seen.events
    assert np.mean(sums > bound) < 1.6e-3  # (1e-3, and four standard errors)
    near = 1.12 if mean < 0.1 and not whole else 2.2  # (Chernoff's)
    assert bound < near * np.quantile(sums, 0.999)


def test_what_is_often_is_bounded_too() -> None:
    seen = scene(np.array([0, 400, 300, 200]))
    assert surely(seen, 0.0) == surely(seen, 0.0, 0.5) == 0.0 and np.isinf(surely(seen, 0.1, 0.0))
    bounds = [surely(seen, mean) for mean in np.geomspace(1e-5, 2.0, 60)]
    assert bounds == sorted(bounds)
    assert all(bound > mean for bound, mean in zip(bounds, np.geomspace(1e-5, 2.0, 60), strict=True))
    assert surely(seen, 1e-12) == 1e-12  # (it would mostly be nothing, but all events may change so little)


@pytest.mark.parametrize(("most", "means"), [([5], [0.3]), ([3, 7], [0.2, 0.5]), ([3, 1000], [2, 20])])
def test_a_coarser_grid_makes_a_bound_no_smaller(most: list[float], means: list[float]) -> None:
    """Numbers are rounded up to it, however much larger its cells are than they."""
    pixels = np.array(most, float), np.array(means, float)
    limit = _chernoff(*pixels, False)
    bounds = [_counted(*pixels, limit * 4**k) for k in range(7)]
    assert bounds == sorted(bounds) and bounds[2] < 1.01 * bounds[0] and bounds[-1] > 1.3 * bounds[0]


def test_where_nothing_is_sent_a_mean_is_its_bound() -> None:
    still = dataclasses.replace(scene(np.array([0, 9])), travel=np.zeros(1), by_pixel=np.zeros((2, 0)))
    assert surely(still, 0.1) == 0.1


def test_numbers_of_poisson_are_beyond_their_bounds_in_less_than_one_of_a_thousand_cases() -> None:
    means = np.concatenate([np.geomspace(1e-9, 1.0, 200), np.geomspace(1.0, 1e5, 500)])
    most, least = (np.array([bound(mean) for mean in means.tolist()]) for bound in (at_most, at_least))
    assert (poisson.sf(most, means) < 1e-3).all()
    assert (poisson.cdf(np.ceil(least) - 1, means) < 1e-3).all() and (least >= 0.0).all()
    assert at_most(0.0) == at_least(0.0) == 0.0
    deviations = np.sqrt(means[200:])
    assert (most[200:] - means[200:] < 9 * deviations).all() and (means[200:] - least[200:] < 4 * deviations).all()


@pytest.mark.parametrize("whole", [False, True])
def test_the_fewer_pixels_may_send_something_the_higher_is_the_bound(whole: bool) -> None:
    """However few: of none that is likely to change nothing is said."""
    seen = scene(np.array([0, 400, 300, 200, *[10] * 30]))
    bounds = [surely(seen, 0.002, share, whole=whole) for share in np.geomspace(1.0, 1e-9, 40)]
    assert bounds == sorted(bounds) and bounds[-1] > 1e6


def test_busy_pixels_do_not_take_memory_for_each_of_their_events() -> None:
    """Nor does that they are counted to three digits make a bound smaller, or much larger."""
    many = np.zeros(3_000_000)
    many[[10, 1_000, 50_001, 2_999_999]] = 4, 30, 20, 2
    assert len(_pixels(scene(many))[0]) == 4
    crowded = np.ones(100_000)
    most, sent = _pixels(scene(crowded))
    assert len(most) < 6000 and sent.sum() == pytest.approx(np.arange(100_000).sum())
    exact = np.bincount(np.searchsorted(most, np.arange(100_000) + 2), np.arange(100_000), len(most))
    np.testing.assert_allclose(sent, exact)
    assert (np.diff(most) <= np.maximum(1, most[1:] / 300)).all()


@pytest.mark.parametrize("mismatch", [0.0, 0.05])
@pytest.mark.parametrize("noise", [0.03, 0.05, 0.15, 0.3])
def test_thresholds_are_at_or_below_a_level_as_often_as_drawn_ones(noise: float, mismatch: float) -> None:
    """Each pixel's as often as it meets them; all of them from the end of the clip on."""
    theta, mean = np.empty((2000, 2), np.float32), 0.15
    fill_thresholds(theta, np.uint64(1), 0, mean, mean, max(mismatch, 1e-9))
    pixels, draws = theta[:, 0].astype(np.float64), np.random.default_rng(2).standard_normal(500)
    drawn = np.array([[clipped(pixel, noise, z) for z in draws] for pixel in pixels])
    spec = DvsSpec(threshold_on=mean, threshold_off=mean, mismatch=mismatch, crossing_noise=noise)
    for level in (0.01, 0.05, 0.1, 0.15, 0.2, 0.25, 0.28, 0.2851, 0.4, 0.7):
        reference = np.average((drawn <= level).mean(axis=1), weights=1.0 / pixels)
        found = np.average(chances_below(level, mean, spec), weights=1.0 / _of_pixels(mean, spec))
        assert found == pytest.approx(reference, abs=0.06)
    assert (chances_below(1.91 * pixels.max(), mean, spec) == 1.0).all()


@pytest.mark.parametrize("mismatch", [0.0, 0.015, 0.06])
@pytest.mark.parametrize("noise", [0.0, 0.035, 0.1])
@pytest.mark.parametrize("way", [0.03, 0.1, 0.14, 0.16, 0.2, 0.29, 0.31, 0.5, 2.0])
def test_crossings_too_soon_after_one_that_counts_are_no_more_than_is_said(
    way: float, noise: float, mismatch: float
) -> None:
    """A signal that goes steadily: whatever is less than a way behind an event that was sent is swallowed."""
    mean, draws = 0.15, np.random.default_rng(3)
    spec = DvsSpec(threshold_on=mean, threshold_off=mean, mismatch=mismatch, crossing_noise=noise)
    crossings = swallowed = near = 0.0
    for pixel in _of_pixels(mean, spec):
        gaps = [clipped(pixel, noise, z) if noise else pixel for z in draws.standard_normal(2000)]
        places = np.cumsum(gaps)
        places = places[places < 100 * mean]
        gone, sent = [], -np.inf
        for place in places:
            if place - sent < way:
                gone.append(place)
            else:
                sent = place
        crossings, swallowed = crossings + len(places), swallowed + len(gone)
        apart = np.abs(np.subtract.outer(gone, gone)) / (7.0 * mean)
        near += (np.exp(-apart).sum() - len(gone)) / 14.0
    chance, chance_again = soon(way, spec)
    assert swallowed / crossings <= chance + 0.01
    assert chance <= 1.6 * swallowed / crossings + 0.02
    assert near <= (chance_again + 0.01) * swallowed
