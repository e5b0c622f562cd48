"""In-pixel and external noise: a fresh Gaussian on the threshold at each potential crossing.

    theta' = theta + sigma z,   one draw per pixel, polarity and crossing; clipped like the mismatch

The draw belongs to the pixel's crossing count, so the rate of events does not depend on how densely the light is
sampled; jumps of the memory, by shot noise and after a blind time, count among the crossings.  The memory becomes the
level that was reached, noise included: that is where the signal stood.

Source: the paper, section II.A: time-variant Gaussian noise, drawn "at each potentially crossed event threshold".
"""

from __future__ import annotations

import math
from typing import Any

from pydantic import BaseModel, Field

from vid2ev.bounds.scene import Omission, Scene
from vid2ev.compiling.compiler import inlined
from vid2ev.physics.mismatch import clipped
from vid2ev.physics.omission import displaced, omitted
from vid2ev.physics.random import CROSSING, normal_pair, philox


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


def omission(scene: Scene, spec: Any) -> Omission:
    """The noise at crossings: the level that a pixel reaches after k events is off by a walk of k steps."""
    figure = f"{spec.crossing_noise / scene.threshold:.2g} of the threshold at each event"
    walk_nat = math.sqrt(scene.most_events) * spec.crossing_noise
    return omitted(scene, spec, displaced(scene, spec, walk_nat), figure, "every event moves")
