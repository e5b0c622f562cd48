"""Pixels that see light that does not change: how often they fire, against their light, and which are hot.

    rate      events / (pixels time), with its standard error sqrt(events) / (pixels time) if events come by chance
    hot       pixels with so many events that less than one such pixel is expected, if each of the others fires at
              random at their mean rate:   pixels P(N >= n) < 1,   N Poisson, its mean that of the pixels below n

Pixels differ in their thresholds, so rates spread more than chance does, and some that the law calls hot are the tail
of an ordinary sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np


@dataclass(frozen=True, slots=True)
class RateAtLight:
    """Pixels of a class of light: its mean light, pixels, events per pixel and second, its standard error, ON share."""

    light: float
    pixels: int
    rate_hz: float
    error_hz: float
    on_share: float | None


def rates_by_light(counts: np.ndarray, light: np.ndarray, seconds: float, edges: np.ndarray) -> list[RateAtLight]:
    """The rates of pixels with edges[k] <= light < edges[k + 1]; NaN is left out, and so are classes without a pixel.

    counts   OFF and ON events of each pixel [2, H, W]
    light    light of each pixel [H, W], in the unit of `edges`, ascending; NaN where it is not still
    """
    if seconds <= 0:
        raise ValueError(f"{seconds} seconds: expected more than 0")
    rates = []
    for low, high in pairwise(edges.tolist()):
        chosen = (light >= low) & (light < high)
        pixels = int(np.count_nonzero(chosen))
        if pixels:
            off, on = (int(count[chosen].sum()) for count in counts)
            exposure, events = pixels * seconds, off + on
            share = on / events if events else None
            mean = float(light[chosen].mean())
            rates.append(RateAtLight(mean, pixels, events / exposure, math.sqrt(events) / exposure, share))
    return rates


def hot_from(counts: np.ndarray) -> int:
    """The least number of events of a hot pixel, given the events of each pixel; more than any has if none is hot."""
    from scipy.stats import poisson

    many = np.bincount(np.ravel(counts))
    pixels, events = np.cumsum(many), np.cumsum(many * np.arange(len(many)))
    least = len(many)
    while pixels[least - 1]:
        others = int(pixels[least - 1])
        found = 1 + int(poisson.isf(1 / others, events[least - 1] / others)) if others > 1 else least
        if found >= least:
            break
        least = found
    return least
