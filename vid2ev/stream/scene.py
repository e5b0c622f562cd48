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
go on with other levels: each event after it is up to theta / |dy/dt| early or late (`echo`).

Of recordings that need have nothing in common D is at most that of either by itself, twice (`unlike`): the events that
are within tau of another in its pixel add up (`dense`), as many as |dy| there / theta.

Sources: M. van Rossum, "A novel spike distance", Neural Computation 13(4), 2001; M. Krasnoselskii and A. Pokrovskii,
*Systems with Hysteresis*, Springer 1989, for play and relays; the bounds are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

DISTANCE_TAU_S = 1e-3
RARE = math.log(1000)  # a chance of 1 in 1000: what a 99.9 % bound leaves

Kind = Literal["exact", "bound", "99.9 % bound", "estimate", "no bound yet"]
OF_TILES = ("light_min", "light_max", "slope_max", "travel", "pushed_s", "turns", "bend", "bend_at_turns", "dense")
SPREAD = ("by_slope", "by_turns", "by_bends", "by_light")
QUARTER_EDGES = np.arange(103 << 2, (143 << 2) + 1, dtype=np.int32)
QUARTER_EDGES = np.left_shift(QUARTER_EDGES, 21).view(np.float32).astype(np.float64)


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
    dense                     [tiles] travel x travel of the same pixel within tau [nat^2]
    by_slope                  [2, quarters of octaves] travel, and travel x slope, by the slope there [nat/s]
    by_turns, by_bends        the same by the number of turns before it, and by the sum of the bends at these; of travel
                              that which counts if levels are no longer the same
    by_light                  the same by the light there
    busiest                   the travel of the pixel that has most [nat]
    by_pixel                  travel of the pixels that have 0, 1, ... whole events
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
    dense: np.ndarray
    by_slope: np.ndarray
    by_turns: np.ndarray
    by_bends: np.ndarray
    by_light: np.ndarray
    busiest: float
    by_pixel: np.ndarray
    brightness: np.ndarray

    @property
    def events(self) -> float:
        """Events expected, without noise and low-pass."""
        return float(self.travel.sum()) / self.threshold

    @property
    def most_events(self) -> float:
        """Events expected of the busiest pixel, and those at its ends."""
        return self.busiest / self.threshold + 2.0

    @property
    def bunched(self) -> float:
        """D of a recording by itself, for each half of an event: 1, and more where events follow each other within
        tau."""
        return 1.0 + float(self.dense.sum()) / max(float(self.travel.sum()), 1e-300) / self.threshold

    @property
    def still(self) -> bool:
        """Whether nothing is expected to be sent."""
        return self.events == 0.0

    def percentile(self, share: float) -> float:
        """The light that a share of the pixels is below, to an octave."""
        counts = np.cumsum(self.brightness)
        return float(2.0 ** (np.searchsorted(counts, share * counts[-1]) - 20))

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


def delayed(scene: Scene, variance_s2: np.ndarray, reach_s: np.ndarray, *, echoes: bool) -> float:
    """Bound on the mean distance where a low-pass gives way to its mean delay.

    A bend of the slope by r is rounded off: the area between the two signals is r variance / 2, and their greatest
    difference r reach, reach = E (D - E D)+ for a delay D that is distributed as the low-pass responds; of each tile.
    """
    if scene.still:
        return 0.0
    change = 2.0 * (0.5 * variance_s2 * scene.bend / DISTANCE_TAU_S + reach_s * scene.bend_at_turns)
    mean = float(change.sum() / scene.travel.sum())
    return mean + _echo(scene, scene.by_bends, float(reach_s.max())) if echoes else mean


def unlike(scene: Scene) -> float:
    """Bound on the mean distance whatever becomes of the levels and the times."""
    return 0.0 if scene.still else 2.0 * scene.bunched


def _echo(scene: Scene, spread: np.ndarray, per_number_nat: float) -> float:
    """The share of the events that come after a disagreement in their pixel: no more than all of them."""
    return float(np.minimum(spread[0], spread[1] * per_number_nat / scene.threshold).sum() / scene.travel.sum())


def surely(scene: Scene, mean: float) -> float:
    """The 99.9 % bound on a distance of this mean (Chernoff): pixels are independent, each event of light is as likely
    to be the first that changes as any other, and what follows in its pixel changes with it.

    For independent X_i, even on [0, m_i] with the chance 2 mu_i / m_i and else 0, and all l > 0,

        P(sum X > t) <= exp(sum 2 mu_i ((exp(l m_i) - 1) / (l m_i) - 1) / m_i - l t)
    """
    if scene.still or mean == 0.0:
        return mean
    most = np.arange(len(scene.by_pixel)) + 2.0  # events
    means = mean * scene.by_pixel / scene.threshold  # [events]
    tries = np.geomspace(1e-6, 20.0, 300)[:, None] / most.max()
    sums = (2.0 * means * (np.expm1(tries * most) / (tries * most) - 1.0) / most).sum(axis=1)
    return float(((sums + RARE) / tries[:, 0]).min()) / scene.events


def added(events: float, extra: float, touched: float) -> float:
    """Bound on the distance where up to `extra` events of noise [number] come or go beside at least so many others, and
    up to a share `touched` of these comes after one of them in its pixel, and so from other levels."""
    return touched + extra / (2.0 * events + extra) if extra > 0.0 else 0.0


def at_most(mean: float) -> float:
    """A number that one of Poisson's exceeds in less than 1 of 1000 cases."""
    return mean + math.sqrt(2.0 * RARE * mean) + RARE / 1.5 if mean > 0 else 0.0


def at_least(mean: float) -> float:
    """A number that one of Poisson's falls short of in less than 1 of 1000 cases."""
    return max(mean - math.sqrt(2.0 * RARE * mean), 0.0)


def together(*distances: float) -> float:
    """Bound on the distance of several changes made together: its root obeys the triangle inequality."""
    return sum(math.sqrt(distance) for distance in distances) ** 2
