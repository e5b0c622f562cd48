"""Electrons: what light becomes in a pixel, and why two pictures of the same scene differ.

    mean    mu = white_e light exposure_gain PRNU
    shot    n  = Poisson(mu)                       with shot_noise; else n = mu
    well    n  = min(n, full_well_e)               if full_well_e > 0
    read    n' = n + DSNU + read_noise_e z,        z standard normal

`white_e` is the number of electrons that light 1.0 gives in an exposure at exposure_gain 1: it sets how strong all of
this is.  Seen in codes the shot noise has variance K x signal, with the gain K = 65535 / (white_e slope) [LSB per
electron].  Every draw is that of (seed, camera, pixel, exposure).

What leaving it out changes: levels by K (n - mu), Poisson's (Bernstein's inequality has its tails), by K times what
the well does not hold, and by K read_noise_e z.

Poisson numbers come from the inverse of their distribution: added up to a mean of 12, above it the expansion

    n = floor(mu + sqrt(mu) z + (2 + z^2)/6 - (z + z^3/2)/(36 sqrt(mu)))

whose distribution is within 4e-4 (total variation) of Poisson's there, its mean within 1e-5 electrons.

Sources: EMVA Standard 1288, release 4.0 (linear), sections 2.2 to 2.4, for the model; M. Giles, "Algorithm 955:
approximation of the inverse Poisson cumulative distribution function", ACM Trans. Math. Software 42(1), 2016, for the
expansion.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.exposed import (
    Change,
    Exposed,
    LevelChange,
    level_change,
    normal_most,
    poisson_most,
    surely_square,
)
from vid2ev.compiling.compiler import compiled
from vid2ev.compiling.intrinsics import floor, sqrt
from vid2ev.physics.adc import WHITE, lsb_per_electron
from vid2ev.physics.elementary import exp64
from vid2ev.physics.fixed_pattern import LIMIT, greatest_gain, least_gain
from vid2ev.physics.random import normal_pair

FEW = 12.0  # electrons up to which probabilities are added up
MOST = 200.0  # of FEW on average: what rounding leaves of a probability must not be searched for ever


class Electrons(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the electrons."""

    white_e: float = Field(10_000.0, gt=0, le=1e9, description="electrons of light 1.0 at exposure_gain 1")
    shot_noise: bool = Field(False, description="electrons arrive at random: their number is Poisson's")
    read_noise_e: float = Field(0.0, ge=0, le=1e6, description="standard deviation of the read noise [electrons]")
    full_well_e: float = Field(0.0, ge=0, le=1e9, description="most electrons that a pixel holds; 0: no limit")


@compiled
def poisson_many(mean, z):
    """A Poisson number of a mean above FEW, from a standard normal number."""
    mean = max(mean, FEW)
    root = sqrt(mean)
    number = mean + root * z + (2.0 + z * z) / 6.0 - (z + 0.5 * z * z * z) / (36.0 * root)
    return max(floor(number), 0.0)


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


def omission_of_shot_noise(seen: Exposed, spec: Any) -> LevelChange:
    """The shot noise: electrons are then their mean number."""
    levels = _shot_e(seen, spec).times(lsb_per_electron(spec))
    why = f"the brightest light that is not clipped is {_electrons(seen.lit_max, spec):.3g} electrons"
    return level_change(levels, "99.9 % bound", why)


def omission_of_full_well(seen: Exposed, spec: Any) -> LevelChange:
    """The full well w; `changes` has what of the light it does not hold.

    With shot noise (n - w)+ <= (mu - w)+ + |n - mu|, and it is 0 but for the share of values that are near w.  However
    much there is, levels go on from that of w to white only.
    """
    beyond = seen.changes["full_well"].times(spec.white_e * spec.exposure_gain)
    electrons = _electrons(seen.lit_max, spec)
    if spec.shot_noise and beyond.near > 0:
        reach = poisson_most(electrons, seen.draws)
        shot = surely_square(electrons * beyond.near, reach, seen.draws)
        most = max(electrons + reach - spec.full_well_e, beyond.most)
        beyond = Change(most, (beyond.rms + shot.rms) ** 2, beyond.near)
    to_white_e = max(_range_e(spec)[1] - spec.full_well_e + _fixed_e(spec), 0.0)
    random = spec.shot_noise or (spec.read_noise_e > 0 and to_white_e < beyond.most)
    beyond = Change(min(beyond.most, to_white_e), min(beyond.square, beyond.near * to_white_e**2))
    kind = "99.9 % bound" if random else "bound"
    why = f"the well holds {spec.full_well_e:g}, the brightest light that is not clipped is {electrons:.3g} electrons"
    return level_change(beyond.times(lsb_per_electron(spec)), kind, why)


def omission_of_read_noise(seen: Exposed, spec: Any) -> LevelChange:
    """The read noise."""
    sigma = spec.read_noise_e * lsb_per_electron(spec)
    levels = surely_square(sigma**2, sigma * normal_most(seen.draws), seen.draws)
    return level_change(levels, "99.9 % bound", f"{spec.read_noise_e:g} electrons, whatever the light")


def always_clipped(spec: Any) -> tuple[float, float]:
    """The light below which all levels are clipped to black, and that above which all are to white, whatever noise and
    fixed pattern do; but for one of 10^12 values."""
    e, fixed_e = spec.white_e * spec.exposure_gain, _fixed_e(spec)
    black_e, white_e = _range_e(spec)

    def reach_e(mean: float) -> float:
        return fixed_e + (poisson_most(mean, 10**12) if spec.shot_noise else 0.0)

    bright_e = white_e
    for _ in range(60):  # (a contraction: the root of the mean grows slower than the mean)
        bright_e = white_e + reach_e(bright_e)
    least = least_gain(spec)
    dark = max(black_e - reach_e(black_e), 0.0) / (e * greatest_gain(spec))
    return dark, bright_e * (1 + 1e-9) / (e * least) if least > 0 else math.inf


def _range_e(spec: Any) -> tuple[float, float]:
    """The electrons of the first code and of the last."""
    black_e = spec.min_illuminance / WHITE * spec.white_e
    return black_e, black_e + ((1 << spec.bits) - 1) / lsb_per_electron(spec)


def _fixed_e(spec: Any) -> float:
    """What read noise and dark signal add to a pixel, or take from it, at most [electrons]; but for one of 10^12."""
    return float(spec.read_noise_e * normal_most(10**12) + LIMIT * spec.dsnu)


def near_full_well(spec: Any) -> float:
    """The light from which shot noise may fill the well: in no more than one of 10^15 values that are darker."""
    room = poisson_most(spec.full_well_e, 10**15) if spec.shot_noise else 0.0
    return max(spec.full_well_e - room, 0.0) / (spec.white_e * spec.exposure_gain * greatest_gain(spec))


def _electrons(light: float, spec: Any) -> float:
    """The mean number of electrons of light in the most sensitive pixel."""
    return light * spec.white_e * spec.exposure_gain * greatest_gain(spec)


def _shot_e(seen: Exposed, spec: Any) -> Change:
    """n - mu [electrons], 99.9 %; the variance of Poisson's is its mean."""
    most = poisson_most(_electrons(seen.lit_max, spec), seen.draws)
    return surely_square(_electrons(seen.lit_mean, spec), most, seen.draws)
