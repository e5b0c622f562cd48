"""Pixel mismatch: each pixel's thresholds differ from the mean, for good.

    theta = mean + sigma z,   z standard normal, one draw per pixel and polarity, camera and seed

z is clipped symmetrically at min(4, (mean - floor)/sigma) with floor = mean/10, so that no threshold reaches zero and
the mean stays; up to sigma = 0.35 mean the spread stays within 1 % (a one-sided clamp would move the mean).  Beyond,
the thresholds crowd against the clip, and the spread that is reached is below the one asked for: with L the clip of z,

    reached^2 = sigma^2 (1 - 2 Q - 2 L phi(L) + 2 L^2 Q),   phi the normal density,   Q its share beyond L

Sources: the paper (time-invariant Gaussian noise on the threshold); Gaussian in Lichtsteiner et al. 2008, 2.1 %
contrast.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.scene import Omission, Scene
from vid2ev.compiling.compiler import compiled, inlined
from vid2ev.physics.omission import displaced, omitted
from vid2ev.physics.random import MISMATCH, normal_pair, philox
from vid2ev.physics.thresholds import DEVIATIONS, FLOOR

CHUNK = 1024  # pixels drawn for at a time


class Mismatch(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the mismatch."""

    mismatch: float = Field(
        0.015, ge=0, le=100, description="standard deviation of the thresholds from pixel to pixel [nat]"
    )


@inlined
def clipped(mean, sigma, z):
    """mean + sigma z, z clipped symmetrically so that the result is at least FLOOR of the mean; sigma > 0."""
    limit = min(DEVIATIONS, (1.0 - FLOOR) * mean / sigma)
    return mean + sigma * min(max(z, -limit), limit)


def reached_spread(mean: float, sigma: float) -> float:
    """Standard deviation [nat] of the thresholds that the clip leaves of sigma [nat, >= 0]."""
    if sigma == 0.0:
        return 0.0
    limit = min(DEVIATIONS, (1.0 - FLOOR) * mean / sigma)
    if limit < 0.01:  # all are at the clip, but for a share that cancels below
        return sigma * limit * math.sqrt(1.0 - limit * math.sqrt(8.0 / (9.0 * math.pi)))
    beyond = 0.5 * math.erfc(limit / math.sqrt(2.0))
    density = math.exp(-0.5 * limit * limit) / math.sqrt(2.0 * math.pi)
    return sigma * math.sqrt(1.0 - 2.0 * beyond - 2.0 * limit * density + 2.0 * limit * limit * beyond)


@compiled
def fill_thresholds(theta, seed, camera, mean_on, mean_off, sigma):
    """Thresholds of pixels 0, 1, ... into theta float32 [n, 2] (ON, OFF)."""
    drawn = np.empty((2, CHUNK), np.float32)  # (what loops of vector code write lies side by side)
    for start in range(0, len(theta), CHUNK):
        some, (on, off) = theta[start : start + CHUNK], (drawn[0], drawn[1])
        for i in range(len(some)):
            words = philox(seed, MISMATCH + 256 * camera, start + i, 0)
            z_on, z_off = normal_pair(words[0], words[1])
            on[i], off[i] = clipped(mean_on, sigma, z_on), clipped(mean_off, sigma, z_off)
        for i in range(len(some)):
            some[i, 0], some[i, 1] = on[i], off[i]


def omission(scene: Scene, spec: Any) -> Omission:
    """The mismatch: the level that a pixel reaches after k events is off by up to k draws."""
    figure = f"{spec.mismatch / scene.threshold:.2g} of the threshold in each pixel"
    return omitted(
        scene, spec, displaced(scene, spec, scene.most_events * spec.mismatch), figure, "every pixel is another"
    )
