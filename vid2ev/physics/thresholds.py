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


def least(spec: Any) -> float:
    """The least threshold of any pixel and crossing [nat]."""
    means, lowest = np.array([spec.threshold_on, spec.threshold_off]), np.array(-np.inf)
    return float(_limited(_limited(means, spec.mismatch, lowest), spec.crossing_noise, lowest).min())


def spread_thresholds(mean: float, spec: Any, count: int) -> np.ndarray:
    """So many thresholds of this mean that stand for those of all pixels and crossings, in no order [nat]."""
    draws, normal = random.Random(0), NormalDist()
    quantiles = np.array([normal.inv_cdf((k + 0.5) / count) for k in range(count)])
    of_pixels, of_crossings = (sorted(range(count), key=lambda _: draws.random()) for _ in range(2))
    pixels = _limited(np.full(count, mean), spec.mismatch, quantiles[of_pixels])
    return _limited(pixels, spec.crossing_noise, quantiles[of_crossings])


def chances_below(level: float, mean: float, spec: Any) -> np.ndarray:
    """The share of the thresholds of this mean [nat] that are at or below a level [nat], of each of STEPS pixels."""
    pixels = _of_pixels(mean, spec)
    if level < 0.0:
        return np.zeros(STEPS)
    reached, passed = (level >= _limited(pixels, spec.crossing_noise, np.full(STEPS, end)) for end in (-np.inf, np.inf))
    chances = reached.astype(np.float64)
    if spec.crossing_noise > 0:
        normal = NormalDist()
        for k in np.flatnonzero(reached & ~passed):
            chances[k] = normal.cdf((level - pixels[k]) / spec.crossing_noise)
    return chances


@lru_cache(4096)
def soon(way_nat: float, spec: Any) -> tuple[float, float]:
    """The share of the crossings, at most, that are of no account as there is one that counts less than a way before,
    of the polarity that is the sooner reached; and how many of those near one that is, in the same pixel, are so, too,
    for each threshold of the mean that the signal goes."""
    return max(_too_soon(way_nat, mean, spec) for mean in (spec.threshold_on, spec.threshold_off))


def _too_soon(way_nat: float, mean: float, spec: Any) -> tuple[float, float]:
    """A crossing is too soon if its threshold is below the way; and after each that counts only so many are.

    These are N(way) = integral up to it of 1 + N(way - theta) on average, which is at most way E 1/theta: for
    E 1/theta E min(theta, way) >= E min(1, way / theta) >= P(theta <= way).
    """
    many = way_nat * _per_nat(mean, spec)
    chances = np.minimum(chances_below(way_nat, mean, spec), many / (1.0 + many))
    often = mean / _of_pixels(mean, spec)  # (a pixel of low thresholds has the more crossings)
    met = float((chances * often).sum())
    return met / float(often.sum()), float(((chances * often) ** 2).sum()) / met if met > 0.0 else 0.0


def _of_pixels(mean: float, spec: Any) -> np.ndarray:
    return _limited(np.full(STEPS, mean), spec.mismatch, _deviates())


@lru_cache(64)
def _per_nat(mean: float, spec: Any) -> np.ndarray:
    """1 / threshold, on average over crossings, of each of STEPS pixels [1/nat]."""
    pixels = _of_pixels(mean, spec)
    return np.mean([1.0 / _limited(pixels, spec.crossing_noise, np.full(STEPS, z)) for z in _deviates()], axis=0)


def _limited(means: np.ndarray, sigma: float, z: np.ndarray) -> np.ndarray:
    """Means + sigma z, as `clipped` has it."""
    limits = np.minimum(DEVIATIONS, (1.0 - FLOOR) * means / sigma) if sigma > 0 else np.zeros(len(means))
    return means + sigma * np.clip(z, -limits, limits)


@cache
def _deviates() -> np.ndarray:
    """Standard normal numbers that stand for all, the least first."""
    normal = NormalDist()
    return np.array([-np.inf, *(normal.inv_cdf((k + 0.5) / STEPS) for k in range(1, STEPS))])
