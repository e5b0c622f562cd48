"""Scene: what was measured of a clip, and what follows from that about leaving an effect out.

A pixel sends events where its signal y [nat] reaches a level.  Levels one threshold theta apart, from a random start,
act as relays that switch on at s + theta/2 and off at s - theta/2; how many are on is the number of ON less OFF events.
All relays together are the **play** p of y (Krasnoselskii and Pokrovskii): y pushes it where it leads by theta/2.  So

    E events = sum |dp| / theta         E |N_a - N_b| <= |p_a - p_b| / theta       N: ON less OFF events so far

for two signals a, b of one pixel, the mean over its random start.  The play follows no faster than its signal: while
both are pushed |p_a - p_b| <= |y_a - y_b|, and at a **turn**, where pushing ends, at most what the signals differ by is
frozen until they come back.  The distance of two recordings is van Rossum's, time constant tau = 1 ms, normalised:

    distance = 2 sum D / (n_a + n_b),    D = 1/tau integral (H N)^2 dt,    H a high-pass of gain <= 1

A stretch of N = 1 of length d costs 1 - exp(-d/tau) <= min(1, d/tau), those of one sign at most the sum, and those of
both signs at most 1 to 2 times the sum: 1 where they are rare (`distance.py`).  With n events that are pushed for the
time A and turn C times, and signals that differ by e,

    distance <= (1 + min(1, 2 e/theta)) (e A / tau + e C) / (n theta)

More where they are several levels apart: x on average are x + x^2 - x + 1/4 squared, at most.

Where thresholds differ from pixel to pixel or crossing to crossing, two recordings of a pixel that disagree at a turn
go on with other levels: each event after it is up to theta / |dy/dt| early or late (`echo`).  A signal that stays
within theta moves the pixels whose thresholds are lower, and these send the more, and more densely.  So each pixel is
measured with a threshold of its own, spread as the sensor's are, of 2048 that stand for all, and what it adds to a sum
weighs theta / its own: all sums are those of events, times the mean theta.

Light that trembles brings such levels to rest where it does not reach them, and there they stay: sooner or later a
pixel whose ON and OFF levels are farther apart than light goes sends nothing, however often that plays would have it.
What is sent **at least** goes by W, what the levels of a pixel are apart at most.  The memory keeps within them, and so
goes as far as the play of width W does, which goes least of all that keeps within W of the signal (truncated
variation: R. Lochowski, "On truncated variation, upward truncated variation and downward truncated variation", 2011).
This is sup sum (|dy| - W)+ over all partitions of the time, and so convex in y and in W: noise in y, and thresholds
that differ from pixel to pixel, make it no less on average.

**Memories that jump to the signal** a blind time R after each event (`refractory = "track"`) follow each other by
t -> t':  y(t') = y(t + R) +- theta.  Events are theta + R |dy/dt| of the signal apart, so travel is counted as that
much less.  Let b = a + e.  From event to event the error of the memory grows by e(t + R) - e(t'), its share of a
cycle stays as it is: a slope that has changed by the time that the pixel sees again stretches the error and the
cycle alike, on average over phases that are even.  So errors do not add up but for what e changes by within cycles:
that is 0 for a shift in time or level, and for a bend of the slope by r the chance that an event falls where it is
still felt, twice (at t' and at t + R):

    2 (|dy/dt| / theta) integral |e| dt  =  r |dy/dt| variance / theta    (`by_stirs`: the sum over all bends so far)

Where events are often felt by bends, what they leave goes both ways: it is 0 on average, as e is felt at t + R as it is
at t', and so the sum of many goes no farther than the root of their squares.  Of poles by which a bend is rounded off
within reach, that is  2 (|dy/dt| / theta) integral e^2 dt <= 0.54 r^2 |dy/dt| reach variance / theta   (`by_strays`:
the root; 0.54 was found by trying all ratios of the poles).

That phases are even is argued, not proven: from one event to the next their density changes by the slope at t' over
that at t + R.  So what follows from it is an estimate, and nothing is left out by it.

Of recordings that need have nothing in common D is at most that of either by itself (`unlike`): events that are near
each other in a pixel add up,

    2 D <= sum over all pairs exp(-|t - t'| / tau) = n + 2 sum of the traces that are left of the events before each

which is counted of the events of one recording: the phases of its levels are spread evenly over the pixels (`bunched`).

Sources: M. van Rossum, "A novel spike distance", Neural Computation 13(4), 2001; M. Krasnoselskii and A. Pokrovskii,
*Systems with Hysteresis*, Springer 1989, for play and relays; the bounds are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

DISTANCE_TAU_S = 1e-3

Kind = Literal["exact", "bound", "99.9 % bound", "estimate", "no bound yet"]
OF_TILES = (
    "light_min",
    "light_max",
    "slope_max",
    "travel",
    "travel_at_least",
    "pushed_s",
    "turns",
    "bend",
    "bend_at_turns",
    "off_peaks",
    "off_peaks_often",
)
OF_BARE = ("bare_apart", "bare_frozen", "bare_travel")
SPREAD = (
    "by_slope",
    "by_turns",
    "by_bends",
    "by_peaks",
    "by_light",
    "by_felt",
    "by_felt_at_turns",
    "by_stirs",
    "by_stirs_before",
    "by_stirs_at_turns",
    "by_strays",
    "by_strays_before",
    "by_strays_at_turns",
)
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

    size, frames, seconds     width and height, and how much was measured; seconds without the intervals before cuts
    shortest_s, longest_s     the shortest of the intervals, infinite without any; and the longest shot
    longest_interval_s        the longest of the intervals, 0 without any
    threshold                 that events are counted with [nat]: the lesser mean
    light_min, light_max      [tiles] of the light that arrives
    slope_max                 [tiles] greatest |dy/dt| of y = ln(light + dark) [nat/s]
    travel                    [tiles] sum |dp| [nat]: events expected, times the threshold
    travel_at_least           [tiles] that of the play as wide as levels may be apart, of the signal behind the first
                              pole [nat]
    pushed_s                  [tiles] how long pixels were pushed, all together
    turns                     [tiles] how often pushing ended
    travelled_when_s, pushed_when_s, turned_when_s   [tiles] the mean time of each since a shot began, 0 of none
    bend, bend_at_turns       [tiles] sum |d slope| where the signal bends while pushed, and at turns and ends [nat/s]
    off_peaks                 [tiles] what the second pole takes from peaks [nat]
    off_peaks_often           [tiles] the same as often as there are levels in it [nat]
    by_slope                  [2, quarters of octaves] travel, and what its events have near them, by the slope there
                              [nat/s]
    by_turns, by_bends, by_peaks   the same by the number of turns before it, by the sum of the bends at these, and of
                              what the second pole takes there [nat]; of travel that which counts if levels are no
                              longer the same
    by_light                  the same by the light there
    by_felt, by_felt_at_turns   of bends that bring signals behind the poles and delayed ones more than a threshold
                              apart, and of such turns: the sums of bends felt there [nat/s] by how many thresholds
    by_stirs ...              of memories that jump to the signal, the same by what bends have left in them, the sum of
                              bend x slope / threshold [nat/ms^2]: by it times the time that a nat takes; of the travel
                              that counts by its sum at turns; and of the turns themselves
    by_strays ...             the same by the root of the sum of bend^2 x slope / threshold [nat/ms^1.5]
    bare_apart, bare_frozen   [tiles] of light without the lens shading: |p_a - p_b| over the time that either is pushed
                              [nat s], and at turns and ends of either [nat]
    bare_travel               [tiles] its travel
    by_bare                   the travel that counts, by the sum of |p_a - p_b| at turns before it
    moving                    how many pixels have any travel
    busiest                   the travel of the pixel that has most [nat]
    by_pixel                  [2, numbers] whole events of pixels, ascending, and the travel of all that have so many
    brightness                pixels in each octave of light from 2**-20 up, of every 16th pixel, now and then
    """

    size: tuple[int, int]
    frames: int
    seconds: float
    shortest_s: float
    longest_s: float
    longest_interval_s: float
    threshold: float
    light_min: np.ndarray
    light_max: np.ndarray
    slope_max: np.ndarray
    travel: np.ndarray
    travel_at_least: np.ndarray
    pushed_s: np.ndarray
    turns: np.ndarray
    travelled_when_s: np.ndarray
    pushed_when_s: np.ndarray
    turned_when_s: np.ndarray
    bend: np.ndarray
    bend_at_turns: np.ndarray
    off_peaks: np.ndarray
    off_peaks_often: np.ndarray
    by_slope: np.ndarray
    by_turns: np.ndarray
    by_bends: np.ndarray
    by_peaks: np.ndarray
    by_light: np.ndarray
    by_felt: np.ndarray
    by_felt_at_turns: np.ndarray
    by_stirs: np.ndarray
    by_stirs_before: np.ndarray
    by_stirs_at_turns: np.ndarray
    by_strays: np.ndarray
    by_strays_before: np.ndarray
    by_strays_at_turns: np.ndarray
    bare_apart: np.ndarray
    bare_frozen: np.ndarray
    bare_travel: np.ndarray
    by_bare: np.ndarray
    moving: int
    busiest: float
    by_pixel: np.ndarray
    brightness: np.ndarray

    @property
    def pixels(self) -> int:
        """How many there are."""
        return self.size[0] * self.size[1]

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
        return 1.0 + float(self.by_slope[1].sum()) / max(float(self.travel.sum()), 1e-300)

    @property
    def still(self) -> bool:
        """Whether nothing is expected to be sent."""
        return self.events == 0.0

    @property
    def finite(self) -> bool:
        """Whether all that was measured are numbers: slopes of light that jumps by many decades at once may be none."""
        return all(np.isfinite(part).all() for part in vars(self).values() if isinstance(part, np.ndarray))

    def percentile(self, share: float) -> float:
        """The light that a share of the pixels is below, to an octave."""
        counts = np.cumsum(self.brightness)
        return float(2.0 ** (np.searchsorted(counts, share * counts[-1]) - 20))

    def describe(self) -> dict[str, Any]:
        """The scene in a few numbers, ready for JSON; None for a slope that is none."""
        steepest = float(self.slope_max.max())
        return {
            "frames": self.frames,
            "seconds": round(self.seconds, 6),
            "events_expected": round(self.events),
            "light": [
                float(self.light_min.min()),
                *map(self.percentile, (0.01, 0.5, 0.99)),
                float(self.light_max.max()),
            ],
            "slope_max_nat_per_s": steepest if math.isfinite(steepest) else None,
            "still_tiles": int(np.count_nonzero(self.travel == 0)),
            "tiles": len(self.travel),
        }
