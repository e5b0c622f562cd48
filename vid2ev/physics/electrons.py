"""Electrons: what light becomes in a pixel, and why two pictures of the same scene differ.

    mean    mu = white_e light exposure_gain PRNU
    shot    n  = Poisson(mu)                       with shot_noise; else n = mu
    well    n  = min(n, full_well_e)               if full_well_e > 0
    read    n' = n + DSNU + read_noise_e z,        z standard normal

`white_e` is the number of electrons that light 1.0 gives in an exposure at exposure_gain 1: it sets how strong all of
this is.  Seen in codes the shot noise has variance K x signal, with the gain K = 65535 / (white_e slope) [LSB per
electron].  Every draw is that of (seed, camera, pixel, exposure).

Poisson numbers come from the inverse of their distribution: added up to a mean of 12, above it the expansion

    n = floor(mu + sqrt(mu) z + (2 + z^2)/6 - (z + z^3/2)/(36 sqrt(mu)))

whose distribution is within 4e-4 (total variation) of Poisson's there, its mean within 1e-5 electrons.

Sources: EMVA Standard 1288, release 4.0 (linear), sections 2.2 to 2.4, for the model; M. Giles, "Algorithm 955:
approximation of the inverse Poisson cumulative distribution function", ACM Trans. Math. Software 42(1), 2016, for the
expansion.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.kernel_compiler import compiled
from vid2ev.physics.elementary import exp64
from vid2ev.physics.random import normal_pair

FEW = 12.0  # electrons up to which probabilities are added up
MOST = 200.0  # of FEW on average: what rounding leaves of a probability must not be searched for ever
MANY = 1e15  # beyond, a single electron is below the precision of float64


class Electrons(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the electrons."""

    white_e: float = Field(10_000.0, gt=0, le=1e9, description="electrons of light 1.0 at exposure_gain 1")
    shot_noise: bool = Field(False, description="electrons arrive at random: their number is Poisson's")
    read_noise_e: float = Field(0.0, ge=0, le=1e6, description="standard deviation of the read noise [electrons]")
    full_well_e: float = Field(0.0, ge=0, le=1e9, description="most electrons that a pixel holds; 0: no limit")


@compiled
def poisson_many(mean, z):
    """A Poisson number of a mean above FEW, from a standard normal number."""
    mean = min(max(mean, FEW), MANY)
    root = np.sqrt(mean)
    number = mean + root * z + (2.0 + z * z) / 6.0 - (z + 0.5 * z * z * z) / (36.0 * root)
    return max(np.floor(number), 0.0)


@compiled
def poisson_few(mean, high, low):
    """A Poisson number of a mean up to FEW, from two words; 0 for a mean that is not above 0."""
    left = np.float64(high) * 2.0**-32 + (np.float64(low) + 0.5) * 2.0**-64
    number, chance = 0.0, exp64(-mean)
    while left > chance and number < MOST:
        left -= chance
        number += 1.0
        chance *= mean / number
    return number


@compiled
def shoot(electrons, high, low):
    """Poisson numbers take the place of mean numbers of electrons, float64 [n]; of two words each, uint32 [n]."""
    for i in range(electrons.size):
        z, _ = normal_pair(high[i], low[i])
        mean = electrons[i]
        electrons[i] = poisson_many(mean, z) if mean > FEW else -mean
    for i in range(electrons.size):
        if electrons[i] <= 0.0:
            electrons[i] = poisson_few(-electrons[i], high[i], low[i])
