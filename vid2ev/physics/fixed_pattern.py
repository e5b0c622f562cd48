"""Fixed pattern: pixels that are more sensitive than others, or darker, for good.

    electrons = PRNU mean + DSNU,   PRNU = 1 + prnu z,   DSNU = dsnu z'       z, z' standard normal

One draw per pixel, camera and seed.  The photo response non-uniformity `prnu` is a share of the signal, the dark signal
non-uniformity `dsnu` a number of electrons (`electrons.py` has their scale).  z is clipped symmetrically at 4 and at
1 / prnu, so that no pixel answers light with its opposite and the mean stays.  Defective rows and columns are not
simulated.

What leaving it out changes: a level of mean light L by lsb L prnu z + K dsnu z' with the codes `lsb` of light 1.0
and K of an electron; at most 4 standard deviations.

Source: EMVA Standard 1288, release 4.0 (linear), section 4: PRNU and DSNU of a Gaussian sensor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.exposed import Exposed, LevelChange, level_change, normal_most, surely_square
from vid2ev.compiling.compiler import compiled
from vid2ev.physics.adc import lsb_per_electron, lsb_per_light
from vid2ev.physics.random import FIXED_PATTERN, normal_pair, philox

LIMIT = 4.0  # standard deviations


class FixedPattern(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the fixed pattern."""

    prnu: float = Field(0.0, ge=0, le=1, description="standard deviation of the pixels' sensitivity, of their mean")
    dsnu: float = Field(0.0, ge=0, le=1e6, description="standard deviation of the pixels' dark signal [electrons]")


@compiled
def fixed_pattern(n, seed, camera, prnu, dsnu):
    """Relative sensitivity and dark signal [electrons] of n pixels, float32 each."""
    gain, dark = np.empty(n, np.float32), np.empty(n, np.float32)
    limit = LIMIT if prnu * LIMIT <= 1.0 else 1.0 / prnu
    for pixel in range(n):
        words = philox(seed, FIXED_PATTERN + 256 * camera, pixel, 0)
        z, other = normal_pair(words[0], words[1])
        gain[pixel] = np.float32(1.0 + prnu * min(max(z, -limit), limit))
        dark[pixel] = np.float32(dsnu * min(max(other, -LIMIT), LIMIT))
    return gain, dark


def greatest_gain(spec: Any) -> float:
    """The most that a pixel is more sensitive than the mean."""
    return 1.0 + min(LIMIT * spec.prnu, 1.0)


def least_gain(spec: Any) -> float:
    """The least sensitivity of a pixel, as a share of the mean."""
    return 1.0 - min(LIMIT * spec.prnu, 1.0)


def omission(seen: Exposed, spec: Any) -> LevelChange:
    """The fixed pattern: one draw for each value of an exposure."""
    lsb, lsb_per_e = lsb_per_light(spec), lsb_per_electron(spec)
    reach = min(normal_most(2 * seen.values), LIMIT)
    gain, dark = lsb * spec.prnu, lsb_per_e * spec.dsnu
    square = gain**2 * seen.lit_square + dark**2
    levels = surely_square(square, reach * (gain * seen.lit_max + dark), seen.values if seen.exposures else 0)
    return level_change(levels, "99.9 % bound", f"{100 * spec.prnu:g} % of the light, {spec.dsnu:g} electrons")
