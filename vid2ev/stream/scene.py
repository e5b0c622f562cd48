"""Scene: what was measured of a clip, and what follows from that about leaving an effect out.

A pixel sends events where its signal y [nat] reaches a level.  Levels one threshold theta apart, from a random start,
act as relays that switch on at s + theta/2 and off at s - theta/2; how many are on is the number of ON less OFF events.
All relays together are the **play** p of y (Krasnoselskii and Pokrovskii): y pushes it where it leads by theta/2.  So

    E events = sum |dp| / theta         E |N_a - N_b| <= |p_a - p_b| / theta       N: ON less OFF events so far

for two signals a, b of one pixel, the mean over its random start.  The play follows no faster than its signal: while
both are pushed |p_a - p_b| <= |y_a - y_b|, and at a **turn**, where pushing ends, at most what the signals differ by is
frozen until they come back.  The distance of two recordings is van Rossum's, time constant tau = 1 ms, normalised:

    distance = 2 sum D / (n_a + n_b),    D = 1/tau integral (H N)^2 dt,    H a high-pass of gain <= 1

A stretch of N = 1 of length d costs 1 - exp(-d/tau) <= min(1, d/tau), stretches of both signs at most twice the sum.
With n events that are pushed for the time A and turn C times, and signals that differ by e,

    distance <= 2 (e A / tau + e C) / (n theta)

Where thresholds differ from pixel to pixel or crossing to crossing, two recordings of a pixel that disagree at a turn
go on with other levels: up to one more for each event after it (`echo`).

Sources: M. van Rossum, "A novel spike distance", Neural Computation 13(4), 2001; M. Krasnoselskii and A. Pokrovskii,
*Systems with Hysteresis*, Springer 1989, for play and relays; the bounds are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np

DISTANCE_TAU_S = 1e-3
RARE = math.log(1000)  # a chance of 1 in 1000: what a 99.9 % bound leaves

Kind = Literal["exact", "bound", "99.9 % bound", "estimate", "no bound yet"]
OF_TILES = ("light_min", "light_max", "slope_max", "travel", "pushed_s", "turns", "bend", "bend_at_turns")
SPREAD = ("by_slope", "by_turns", "by_bends")
LEAST, MOST = ("light_min",), ("light_max", "slope_max")  # of parts of a clip; all else is their sum


@dataclass(frozen=True)
class Omission:
    """What leaving an effect out changes.

    distance  upper bound on the headline distance, or its estimate; None where nothing is known
    kind      what kind of statement that is
    figure    the change in words, with units
    why       the reason in words
    replace   what takes the effect's place when it goes: keys of the specification
    """

    distance: float | None
    kind: Kind
    figure: str
    why: str
    replace: tuple[tuple[str, Any], ...] = ()

    @property
    def sure(self) -> bool:
        """Whether the distance is a bound, so that the effect may be left out by it."""
        return self.distance is not None and self.kind in ("exact", "bound", "99.9 % bound")


@dataclass(frozen=True)
class Scene:
    """What a sensor sees of a clip: extremes and sums over all pixels, by tiles of 2048 pixels in row-major order.

    pixels, frames, seconds   how much was measured; seconds without the intervals before cuts
    threshold                 that events are counted with [nat]
    light_min, light_max      [tiles] of the light that arrives
    slope_max                 [tiles] greatest |dy/dt| of y = ln(light + dark) [nat/s]
    travel                    [tiles] sum |dp| [nat]: events expected, times the threshold
    pushed_s                  [tiles] how long pixels were pushed, all together
    turns                     [tiles] how often pushing ended
    bend, bend_at_turns       [tiles] sum |d slope| where the signal bends while pushed, and at turns [nat/s]
    by_slope                  [2, octaves] travel, and travel x slope, by the greatest slope around it [nat/s]
    by_turns, by_bends        the same by the number of turns before it, and by the sum of the bends at these
    busiest, travel_squared   the travel of the pixel that has most [nat], and the sum of squares of all pixels'
    brightness                pixels in each octave of light from 2**-20 up, of every 16th pixel, now and then
    """

    pixels: int
    frames: int
    seconds: float
    threshold: float
    light_min: np.ndarray
    light_max: np.ndarray
    slope_max: np.ndarray
    travel: np.ndarray
    pushed_s: np.ndarray
    turns: np.ndarray
    bend: np.ndarray
    bend_at_turns: np.ndarray
    by_slope: np.ndarray
    by_turns: np.ndarray
    by_bends: np.ndarray
    busiest: float
    travel_squared: float
    brightness: np.ndarray

    @property
    def events(self) -> float:
        """Events expected, without noise and low-pass."""
        return float(self.travel.sum()) / self.threshold

    @property
    def still(self) -> bool:
        """Whether nothing is expected to be sent."""
        return self.events == 0.0

    def percentile(self, share: float) -> float:
        """The light that a share of the pixels is below, to an octave."""
        counts = np.cumsum(self.brightness)
        return float(2.0 ** (np.searchsorted(counts, share * counts[-1]) - 20))

    def merged(self, later: Scene) -> Scene:
        """Both parts of a clip as one; a turn in the one has no echo in the other."""
        both: dict[str, Any] = {}
        for each in fields(self):
            a, b = getattr(self, each.name), getattr(later, each.name)
            if each.name in LEAST:
                both[each.name] = np.minimum(a, b)
            elif each.name in MOST:
                both[each.name] = np.maximum(a, b)
            elif each.name not in ("pixels", "threshold"):
                both[each.name] = a + b
        return replace(self, **both)

    def describe(self) -> dict[str, Any]:
        """The scene in a few numbers, ready for JSON."""
        return {
            "frames": self.frames,
            "seconds": round(self.seconds, 6),
            "events_expected": round(self.events),
            "light": [
                float(self.light_min.min()),
                *map(self.percentile, (0.01, 0.5, 0.99)),
                float(self.light_max.max()),
            ],
            "slope_max_nat_per_s": float(self.slope_max.max()),
            "still_tiles": int(np.count_nonzero(self.travel == 0)),
            "tiles": len(self.travel),
        }


def off_by(scene: Scene, error_nat: np.ndarray, *, echoes: bool) -> float:
    """Bound on the mean distance where the comparator's input is off by up to error_nat [tiles]."""
    if scene.still:
        return 0.0
    many = 1.0 + np.floor(error_nat / scene.threshold)  # levels that can be between the two signals
    change = 2.0 * many * error_nat * (scene.pushed_s / DISTANCE_TAU_S + scene.turns)
    change = np.minimum(change, 4.0 * many**2 * scene.travel)  # (each stretch begins with an event of either)
    if echoes:
        return float(change.sum() / scene.travel.sum()) + _echo(scene, scene.by_turns, float(error_nat.max()))
    return float(change.sum() / scene.travel.sum())


def delayed(scene: Scene, variance_s2: float, reach_s: float, *, echoes: bool) -> float:
    """Bound on the mean distance where a low-pass gives way to its mean delay.

    A bend of the slope by r is rounded off: the area between the two signals is r variance / 2, and their greatest
    difference r reach, reach = E (D - E D)+ for a delay D that is distributed as the low-pass responds.
    """
    if scene.still:
        return 0.0
    change = 2.0 * (0.5 * variance_s2 * scene.bend / DISTANCE_TAU_S + reach_s * scene.bend_at_turns)
    lost = 2.0 * reach_s * scene.bend_at_turns.sum()
    mean = float(change.sum() / max(scene.travel.sum() - lost, 1e-300))
    return mean + _echo(scene, scene.by_bends, reach_s) if echoes else mean


def _echo(scene: Scene, spread: np.ndarray, per_number_nat: float) -> float:
    """The share of the events that come after a disagreement in their pixel: no more than all of them."""
    return float(np.minimum(spread[0], spread[1] * per_number_nat / scene.threshold).sum() / scene.travel.sum())


def surely(scene: Scene, mean: float) -> float:
    """The 99.9 % bound on a distance of this mean (Bernstein): pixels are independent, none can change more than the
    busiest, and the mean square of a change is that of an event's pixel."""
    if scene.still or mean == 0.0:
        return mean
    most = (scene.busiest / scene.threshold + 1.0) / scene.events
    usual = (scene.travel_squared / scene.travel.sum() / scene.threshold + 1.0) / scene.events
    return mean + math.sqrt(2.0 * RARE * usual * mean) + most * RARE / 3.0


def added(scene: Scene, extra: float, touched: float) -> float:
    """Bound on the distance where up to `extra` events of noise [number] come or go, and up to a share `touched` of
    the others comes after one of them in its pixel, and so from other levels."""
    events = scene.events
    if extra == 0.0:
        return 0.0
    return min(touched + extra / (2.0 * events + extra), 2.0) if events else 1.0


def at_most(mean: float) -> float:
    """A number that one of Poisson's exceeds in less than 1 of 1000 cases."""
    return mean + math.sqrt(2.0 * RARE * mean) + RARE / 1.5 if mean > 0 else 0.0


def together(*distances: float) -> float:
    """Bound on the distance of several changes made together: its root obeys the triangle inequality."""
    return sum(math.sqrt(distance) for distance in distances) ** 2
