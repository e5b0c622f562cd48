"""How thresholds are spread, by mismatch from pixel to pixel and by noise from crossing to crossing.

A few that stand for all, of the law of `mismatch.clipped`:

    theta_k = mean + sigma z_k,   z_k the (k + 1/2) / n quantile of the standard normal distribution, clipped alike
"""

from __future__ import annotations

import math
import random
from functools import cache, lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np

FLOOR = 0.1  # smallest threshold, as a share of the mean
DEVIATIONS = 4.0  # standard ones that a threshold is at most from the mean
STEPS = 256  # pixels that stand for all


def spread_of(spec: Any) -> float:
    """The standard deviation of the thresholds of all pixels and crossings [nat]."""
    return math.hypot(spec.mismatch, spec.crossing_noise)


def widest(spec: Any) -> float:
    """How far the ON level and the OFF level of a pixel are apart at most, whatever is drawn at its crossings, on
    average over all pixels [nat]."""
    means = np.array([spec.threshold_on, spec.threshold_off])
    return float(_limited(means, spec.crossing_noise, np.array(np.inf)).sum())


def spread_thresholds(mean: float, spec: Any, count: int) -> np.ndarray:
    """So many thresholds of this mean that stand for those of all pixels and crossings, in no order [nat]."""
    draws, normal = random.Random(0), NormalDist()
    quantiles = np.array([normal.inv_cdf((k + 0.5) / count) for k in range(count)])
    of_pixels, of_crossings = (sorted(range(count), key=lambda _: draws.random()) for _ in range(2))
    pixels = _limited(np.full(count, mean), spec.mismatch, quantiles[of_pixels])
    return _limited(pixels, spec.crossing_noise, quantiles[of_crossings])


def chances_below(level: float, mean: float, spec: Any) -> tuple[float, float]:
    """The share of the thresholds of this mean [nat] that are at or below a level [nat]: as they are met, lower ones
    the more often; and how many of those near one that is, in the same pixel, are so, too, for each threshold of the
    mean that the signal goes."""
    if level < 0.0:
        return 0.0, 0.0
    pixels = _limited(np.full(STEPS, mean), spec.mismatch, _deviates())
    reached, passed = (level >= _limited(pixels, spec.crossing_noise, np.full(STEPS, end)) for end in (-np.inf, np.inf))
    chances = reached.astype(np.float64)
    if spec.crossing_noise > 0:
        normal = NormalDist()
        for k in np.flatnonzero(reached & ~passed):
            chances[k] = normal.cdf((level - pixels[k]) / spec.crossing_noise)
    often = mean / pixels
    met = float((chances * often).sum())
    return met / float(often.sum()), float(((chances * often) ** 2).sum()) / met if met > 0.0 else 0.0


@lru_cache(4096)
def soon(way_nat: float, spec: Any) -> tuple[float, float]:
    """`chances_below` of the polarity that is the sooner reached after an event, while the signal goes so far."""
    return max(chances_below(way_nat, mean, spec) for mean in (spec.threshold_on, spec.threshold_off))


@lru_cache(64)
def per_nat(spec: Any) -> float:
    """1 / threshold on average, as thresholds are met, lower ones the more often [1/nat].

    So many crossings there are on average in each nat that a signal goes after one, at most: by the renewal equation
    N(x) = integral up to x of 1 + N(x - theta), and E 1/theta E min(theta, x) >= E min(1, x / theta) >= P(theta <= x).
    """
    often = 1.0 / spread_thresholds(min(spec.threshold_on, spec.threshold_off), spec, STEPS)
    return float((often**2).sum() / often.sum())


def _limited(means: np.ndarray, sigma: float, z: np.ndarray) -> np.ndarray:
    """Means + sigma z, as `clipped` has it."""
    limits = np.minimum(DEVIATIONS, (1.0 - FLOOR) * means / sigma) if sigma > 0 else np.zeros(len(means))
    return means + sigma * np.clip(z, -limits, limits)


@cache
def _deviates() -> np.ndarray:
    """Standard normal numbers that stand for all, the least first."""
    normal = NormalDist()
    return np.array([-np.inf, *(normal.inv_cdf((k + 0.5) / STEPS) for k in range(1, STEPS))])
