"""Thresholds that are spread: the clip keeps their mean, and what is left of the spread is said."""

from __future__ import annotations

import numpy as np
import pytest
from against.clips import uneven
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.physics.crossing_noise import noisy_thresholds
from vid2ev.physics.mismatch import FLOOR, clipped, fill_thresholds, reached_spread

pytestmark = pytest.mark.long

MEAN = 0.2


def thresholds(sigma: float, pixels: int, seed: int = 0) -> np.ndarray:
    """ON and OFF thresholds of so many pixels, float32 [n, 2]."""
    theta = np.empty((pixels, 2), np.float32)
    fill_thresholds(theta, np.uint64(seed), 0, MEAN, MEAN, sigma)
    return theta


@settings(derandomize=True)
@given(st.floats(1e-3, 10), st.floats(1e-9, 100), st.floats(-6.8, 6.8))
def test_thresholds_are_above_zero_and_as_far_above_the_mean_as_below(mean, sigma, z):
    """So their mean is the one asked for, whatever the spread."""
    above, below = clipped(mean, sigma, z), clipped(mean, sigma, -z)
    assert FLOOR * mean * (1 - 1e-12) <= min(above, below)
    assert above + below == pytest.approx(2 * mean, rel=1e-12)


@pytest.mark.parametrize("sigma_rel", [0.01, 0.1, 0.35, 0.5, 1.0, 3.0, 500.0])
def test_the_mean_stays_and_the_spread_is_the_one_that_is_said(sigma_rel):
    """The mean to 1e-3 of itself for any sigma; the spread to 1 % of sigma up to 0.35 of the mean."""
    sigma, pixels = sigma_rel * MEAN, 3_000_000
    theta = thresholds(sigma, pixels).astype(np.float64)
    assert theta.min() >= FLOOR * MEAN * (1 - 1e-6)
    assert theta.mean() == pytest.approx(MEAN, rel=1e-3)
    reached = reached_spread(MEAN, sigma)
    assert theta.std(axis=0) == pytest.approx(np.array([reached, reached]), rel=5 / np.sqrt(2 * pixels) + 1e-4)
    if sigma_rel <= 0.35:
        assert reached == pytest.approx(sigma, rel=0.01)
    else:
        assert reached < 0.99 * sigma


def test_the_spread_that_is_reached_never_leaves_its_bounds():
    """It grows with sigma, from none to where every threshold is at the clip."""
    sigmas = np.geomspace(1e-6, 1e3, 200)
    reached = np.array([reached_spread(MEAN, sigma) for sigma in sigmas])
    assert (np.diff(reached) > 0).all() and (reached <= sigmas).all()
    assert reached[-1] == pytest.approx((1 - FLOOR) * MEAN, rel=1e-3) and reached_spread(MEAN, 0.0) == 0.0


def test_noise_at_crossings_is_clipped_alike():
    drawn = np.array([noisy_thresholds(MEAN, MEAN, 0.3, np.uint64(1), 0, k % 1000, k // 1000) for k in range(200_000)])
    assert drawn.min() >= FLOOR * MEAN * (1 - 1e-12)
    assert drawn.mean() == pytest.approx(MEAN, abs=5 * reached_spread(MEAN, 0.3) / np.sqrt(drawn.size))
    assert drawn.std() == pytest.approx(reached_spread(MEAN, 0.3), rel=5 / np.sqrt(2 * drawn.size))


def test_a_sensor_says_what_spread_it_reaches():
    """Where it is not the one asked for; ON and OFF apart."""
    assert uneven(mismatch=0.05, threshold_on=0.2, threshold_off=0.2).reached_spreads() == {}
    said = uneven(mismatch=0.3, threshold_on=0.2, threshold_off=0.9).reached_spreads()
    assert said == {"mismatch": (reached_spread(0.2, 0.3), reached_spread(0.9, 0.3))}
    both = uneven(mismatch=0.3, crossing_noise=3.0, threshold_on=0.2, threshold_off=0.9).reached_spreads()
    assert both["crossing_noise"] == (reached_spread(0.2, 3.0), reached_spread(0.9, 3.0))
