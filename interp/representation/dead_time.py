"""What an event counts for where its pixel was blind before it: the crossings that it saw and those that it did not.

After an event a pixel is blind for a refractory period R.  Where light changes fast it crosses more levels in that time
than it tells of, and events that are simply added up fall short.  But how long after R the next event comes says how
fast light was changing, r crossings in a second, and so how many of them there were, m, in the d seconds since the
event before, of the same sign:

    track        the memory is where the signal is when R ends, a crossing after that is a threshold away:
                 m = d / (d - R)
    quantised    the memory has followed the crossings, the next one is anything up to 1 / r away (`blind_runs.py`)

m is at least 1, for the event itself, and at most MOST.  (d - R) is at least LEAST R: neither R nor light is as even as
that.  What comes sooner than R is taken as it is.

Source of m for track: a counter whose dead time is not extended by what it misses (G. Knoll, "Radiation detection and
measurement", 4th ed., chapter 4), for single intervals.  quantised: ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from interp.representation.blind_runs import MOST, crossings_in_runs
from vid2ev.compiling.cache import cached
from vid2ev.errors import UsageError

LEAST = 0.03  # R: 0.01 and 0.1 are the same to 0.02 dB
SHORTEST_US = 1.0  # less is no dead time: times are of whole microseconds
LONGEST_US = 1e9
LOOK_BACK, LONGEST_LOOK_BACK_US = 16, 200_000  # R: an event so long after another one stands for 16 / 15 crossings

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

    @staticmethod
    def asked(refractory_us: float | None, said: DeadTime | None) -> DeadTime | None:
        """That of an event camera of which a recording says `said`, and a user another time, 0 for none."""
        if refractory_us is None:
            return said
        if refractory_us == 0:
            return None
        return replace(said, refractory_us=refractory_us) if said else DeadTime(refractory_us)

    def crossings(self, t_us: np.ndarray, pixel: np.ndarray, p: np.ndarray) -> np.ndarray:
        """m of N events, float32 [N], of one camera in order of time.

        pixel   any number for each pixel, from 0 on, int64 [N]
        p       0 for OFF, or else ON
        """
        pixels = int(pixel.max(initial=-1)) + 1
        counted = _tracked if self.law == "track" else crossings_in_runs
        return counted(t_us, pixel, p, pixels, float(self.refractory_us))  # type: ignore[no-any-return]


def look_back_us(dead_time: DeadTime | None) -> int:
    """How long before a stretch of time events still matter to what those within it stand for."""
    return min(math.ceil(LOOK_BACK * dead_time.refractory_us), LONGEST_LOOK_BACK_US) if dead_time else 0


def stated(dead_time: DeadTime | None) -> dict[str, Any] | None:
    """It as JSON."""
    return asdict(dead_time) if dead_time else None


@cached
def _tracked(t_us, pixel, p, pixels, refractory_us):  # type: ignore[no-untyped-def]
    last, seen = np.full(pixels, -1, np.int64), np.ones(t_us.size, np.float32)
    for k in range(t_us.size):
        before = last[pixel[k]]
        last[pixel[k]] = k
        if before < 0 or (p[before] > 0) != (p[k] > 0):
            continue
        d = t_us[k] - t_us[before]
        if d >= refractory_us - 1:  # (sooner: it was not blind for so long)
            seen[k] = min(max(d / max(d - refractory_us, LEAST * refractory_us), 1.0), MOST)
    return seen
