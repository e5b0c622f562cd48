"""What an event counts for where its pixel was blind before it: the crossings that it saw and those that it did not.

After an event a pixel is blind for a refractory period R.  Where light changes fast it crosses more levels in that time
than it tells of, and events that are simply added up fall short.  But how long after R the next event comes says how
fast light was changing, r crossings in a second, and so how many of them there were, m, in the d seconds since the
event before, of the same sign:

    track        the memory is where the signal is when R ends, a crossing after that is a threshold away:
                 m = d / (d - R)
    quantised    the memory has followed the crossings, the next one is anything up to 1 / r away:
                 m = 1 + P q (d r - 1)        x = max(d_i - R) / R
                 r = n / (n + 1) (1 - x^(n+1)) / (1 - x^n) / (x R)
                 q = 3 max |d_i - d| / (x R)        P = 1 - N(1 <= x < 1.5) / N(x < 0.4) / 8

m is at least 1, for the event itself, and at most MOST; P and q are from 0 to 1.  The maxima are over n intervals, that
one and its neighbours of the same sign.  r is the mean of all above 1 / R by which the (d_i - R) are places on
(0, 1 / r); where x > 1 it cannot be above, and nothing is hidden.  Intervals that are alike say nothing: those that
hide none are so, too, which is then taken.  And light that is just slow enough hides nothing either: P is the share of
the N events of small x that are not there by such light, which has an eighth of the number beyond.  (d - R) is at least
LEAST R: neither R nor light is as even as that.  What comes sooner than R is taken as it is.

A white ball before dark trousers is 3.6 nats, of which events of R = 100 us tell 2.8 (quantised) and 2.2 (track); so
they tell 3.5 and 3.6.  Measured at x8, PSNR of guided on 6 gaps of fast real videos and on 12 of scenes, in place of
m = 1: quantised, R = 100 us +1.6 and 0.0 dB, with a noisy sensor +0.6 and 0.0; 800 us +1.9 and +1.3; track, 100 us +3.5
and +0.6, 800 us +3.9 and +2.5.  None of these gaps, and none of flicker, is worse by more than 0.01 dB; without P,
flicker is by 0.4.  The other law gives a sixth of that (for track) or costs up to 1.4 dB.

Source of m for track: a counter whose dead time is not extended by what it misses (G. Knoll, "Radiation detection and
measurement", 4th ed., chapter 4), for single intervals.  quantised: ours; r by Bayes, as likely whatever it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np
from numba import njit

from vid2ev.errors import UsageError

MOST = 8.0  # crossings that an event may stand for: 4 to 16 are within 0.1 dB at 100 us
LEAST = 0.03  # R: 0.01 and 0.1 are the same to 0.02 dB
CLOSE, FAR, OF_SLOW = 0.4, 1.5, 0.12  # R; of slow light (flicker, turning things) 0.12 to 0.13 times as many are close
UNEVEN = 3.0  # of pairs of places between 0 and an end, 4 in 9 are a third of that apart or more
SHORTEST_US = 1.0  # less is no dead time: times are of whole microseconds
LONGEST_US = 1e9

Law = Literal["track", "quantised"]


@dataclass(frozen=True, slots=True)
class DeadTime:
    """How long a pixel is blind after an event [us], and where its memory is then (`vid2ev.physics.refractory`).

    Raises UsageError for a time that is not from 1 us to 1000 s, or a law that is none.
    """

    refractory_us: float
    law: Law = "track"

    def __post_init__(self) -> None:
        if not (isinstance(self.refractory_us, int | float) and SHORTEST_US <= self.refractory_us <= LONGEST_US):
            raise UsageError(f"refractory period {self.refractory_us} us: expected {SHORTEST_US:g} to {LONGEST_US:g}")
        if self.law not in get_args(Law):
            raise UsageError(f"refractory law {self.law!r}: expected one of {', '.join(get_args(Law))}")

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> DeadTime | None:
        """That of a sensor's parameters; None without one, or where events come by a clock that says nothing of it.

        Raises KeyError, TypeError, ValueError for what no sensor has.
        """
        refractory_us, law = float(parameters["refractory_us"]), parameters["refractory"]
        if not math.isfinite(refractory_us) or law not in get_args(Law):
            raise ValueError(f"refractory period {refractory_us} us, {law}")
        by_clock = parameters["timing"] == "frame" or float(parameters["frame_rate_hz"]) > 0
        return None if by_clock or not SHORTEST_US <= refractory_us <= LONGEST_US else cls(refractory_us, law)

    def crossings(self, t_us: np.ndarray, pixel: np.ndarray, p: np.ndarray) -> np.ndarray:
        """m of N events, float32 [N], of one camera in order of time.

        pixel   any number for each pixel, from 0 on, int64 [N]
        p       0 for OFF, or else ON
        """
        since_us, following = _intervals(t_us, pixel, p, int(pixel.max(initial=-1)) + 1)
        if self.law == "track":
            return _tracked(since_us, float(self.refractory_us))
        return _quantised(since_us, following, float(self.refractory_us))


def stated(dead_time: DeadTime | None) -> dict[str, Any] | None:
    """It as JSON."""
    return asdict(dead_time) if dead_time else None


@njit(cache=True, nogil=True, error_model="numpy")
def _intervals(t_us, pixel, p, pixels):  # type: ignore[no-untyped-def]
    """Time since the event before in the pixel, if that was of the same sign, or else infinite; and which one is next,
    -1 for none, or one of the other sign."""
    last = np.full(pixels, -1, np.int64)
    since_us, following = np.full(t_us.size, np.inf, np.float32), np.full(t_us.size, -1, np.int64)
    for k in range(t_us.size):
        before = last[pixel[k]]
        last[pixel[k]] = k
        if before >= 0 and (p[before] > 0) == (p[k] > 0):
            since_us[k], following[before] = t_us[k] - t_us[before], k
    return since_us, following


@njit(cache=True, nogil=True, error_model="numpy")
def _tracked(since_us, refractory_us):  # type: ignore[no-untyped-def]
    seen = np.ones(since_us.size, np.float32)
    for k in range(since_us.size):
        d = since_us[k]
        if refractory_us - 1 <= d < np.inf:  # (sooner: it was not blind for so long)
            seen[k] = min(max(d / max(d - refractory_us, LEAST * refractory_us), 1.0), MOST)
    return seen


@njit(cache=True, nogil=True, error_model="numpy")
def _quantised(since_us, following, refractory_us):  # type: ignore[no-untyped-def]
    seen = np.ones(since_us.size, np.float32)
    previous_us = np.full(since_us.size, np.inf, np.float32)  # the interval before the one before each event
    for k in range(since_us.size):
        if following[k] >= 0:
            previous_us[following[k]] = since_us[k]
    close, far = 0, 0
    for k in range(since_us.size):
        d = since_us[k]
        if not refractory_us - 1 <= d < np.inf:
            continue
        longest, n, uneven = d - refractory_us, 1, np.float32(0)
        after_us = since_us[following[k]] if following[k] >= 0 else np.float32(np.inf)
        for beside in (previous_us[k], after_us):
            if refractory_us - 1 <= beside < np.inf:
                longest, n, uneven = max(longest, beside - refractory_us), n + 1, max(uneven, abs(beside - d))
        x = max(longest / refractory_us, LEAST)
        close, far = close + (x < CLOSE), far + (1 <= x < FAR)
        if x < 1:
            rate = n / (n + 1) * (1 - x ** (n + 1)) / (1 - x**n) / x
            even = min(1.0, UNEVEN * uneven / (x * refractory_us)) if n > 1 else 1.0
            seen[k] = min(1 + even * max(d / refractory_us * rate - 1, 0.0), MOST)
    fast = max(0.0, 1 - OF_SLOW * (far + 1) / (close + 1))
    return 1 + np.float32(fast) * (seen - 1)
