"""In-pixel and external noise: a fresh Gaussian on the threshold at each potential crossing.

    theta' = theta + sigma z,   one draw per pixel, polarity and crossing; clipped like the mismatch

The draw belongs to the pixel's crossing count, so the rate of events does not depend on how densely the light is
sampled. The memory becomes the level that was reached, noise included: that is where the signal stood.

Source: the paper, section II.A: time-variant Gaussian noise, drawn "at each potentially crossed event threshold".
"""

from __future__ import annotations

import math
from functools import cache
from statistics import NormalDist
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.kernel_compiler import inlined
from vid2ev.physics.mismatch import FLOOR, clipped
from vid2ev.physics.omission import displaced, omitted
from vid2ev.physics.random import CROSSING, normal_pair, philox
from vid2ev.stream.scene import Omission, Scene

STEPS = 256  # pixels that stand for all


class CrossingNoise(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the noise at crossings."""

    crossing_noise: float = Field(
        0.035, ge=0, le=100, description="standard deviation of the threshold from crossing to crossing [nat]"
    )


@inlined
def noisy_thresholds(on, off, sigma, seed, camera, pixel, count):
    """ON and OFF threshold [nat] for the pixel's crossing number `count`."""
    words = philox(seed, CROSSING + 256 * camera, pixel, count)
    z_on, z_off = normal_pair(words[0], words[1])
    return clipped(on, sigma, z_on), clipped(off, sigma, z_off)


def chances_below(level: float, mean: float, spec: Any) -> np.ndarray:
    """The share of the thresholds of a pixel, of this mean [nat], that are at or below a level [nat]: of 256 pixels
    that stand for all, as often as their thresholds ask for."""

    if level < 0.0:
        return np.zeros(STEPS)
    pixels = _limited(np.full(STEPS, mean), spec.mismatch, _deviates())
    reached = level >= _limited(pixels, spec.crossing_noise, np.full(STEPS, -np.inf))
    chances = reached.astype(np.float64)
    if spec.crossing_noise > 0:
        normal = NormalDist()
        for k in np.flatnonzero(reached):
            chances[k] = normal.cdf((level - pixels[k]) / spec.crossing_noise)
    return np.minimum(chances * np.maximum(mean / pixels, 1.0), 1.0)


def _limited(means: np.ndarray, sigma: float, z: np.ndarray) -> np.ndarray:
    """Means + sigma z, as `clipped` has it."""
    limits = np.minimum(4.0, (1.0 - FLOOR) * means / sigma) if sigma > 0 else np.zeros(STEPS)
    return means + sigma * np.clip(z, -limits, limits)


@cache
def _deviates() -> np.ndarray:
    """Standard normal numbers that stand for all, the least first."""
    normal = NormalDist()
    return np.array([-np.inf, *(normal.inv_cdf((k + 0.5) / STEPS) for k in range(1, STEPS))])


def omission(scene: Scene, spec: Any) -> Omission:
    """The noise at crossings: the level that a pixel reaches after k events is off by a walk of k steps."""
    figure = f"{spec.crossing_noise / scene.threshold:.2g} of the threshold at each event"
    walk_nat = math.sqrt(scene.most_events) * spec.crossing_noise
    return omitted(scene, spec, displaced(scene, spec, walk_nat), figure, "every event moves")
