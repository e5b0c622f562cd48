"""What the intervals of a sensor are counted from, one after the other."""

from __future__ import annotations

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import Flags, Interval, Numbers
from vid2ev.sensors.compiled import interval_of
from vid2ev.sensors.limits import time_ns

LONGEST_INTERVAL_NS = 1 << 44  # 4.9 hours: what an event key can count in microseconds, with room to spare
LEAK_REBASE_NAT = 0.5  # a leak that has risen so far goes into the memories, as the scan compares levels in float32

Step = tuple[Interval, float]  # and what the leak has risen before it that goes into the memories [nat]


def later(t_ns: int, last_ns: int | None) -> int:
    """The time of a frame [int, ns]; raises UsageError for none, and one not after the last or too long after."""
    t_ns = time_ns(t_ns)
    if last_ns is not None and not last_ns < t_ns < last_ns + LONGEST_INTERVAL_NS:
        raise UsageError(
            f"frame time {t_ns} ns after {last_ns} ns: expected a later one, by at most 4.8 hours;"
            " sort the frames and drop repeated times"
        )
    return t_ns


def pace_of(num: Numbers) -> tuple[float, ...]:
    """All that intervals have from a sensor: sensors of the same pace, clock and times have the same intervals."""
    return num.tau1_ns, num.tau2_ns, num.leak_nat_per_ns, num.noise_rms, num.curve.dark


class Clock:
    """The clock of a sensor that has settled at t_ns, where steps are counted from `step`."""

    def __init__(self, t_ns: int, step: int, leak_since_ns: int | None = None, fresh_noise: bool = True):
        self.t_ns, self.step, self.fresh_noise = t_ns, step, fresh_noise
        self.leak_since_ns = t_ns if leak_since_ns is None else leak_since_ns

    def __eq__(self, other: object) -> bool:
        """Whether the next intervals are the same, up to the same times."""
        return isinstance(other, Clock) and vars(self) == vars(other)

    def step_to(self, t_ns: int, flags: Flags, num: Numbers) -> Step:
        """The interval up to t_ns [int, ns], which must be after the last one."""
        rate, risen = num.leak_nat_per_ns, 0.0
        if rate * (t_ns - self.leak_since_ns) > LEAK_REBASE_NAT and self.t_ns > self.leak_since_ns:
            risen, self.leak_since_ns = rate * (self.t_ns - self.leak_since_ns), self.t_ns
        interval = interval_of(flags, num, self.t_ns, t_ns, self.leak_since_ns, self.step, self.fresh_noise)
        self.t_ns, self.step, self.fresh_noise = t_ns, self.step + 1, not interval.noise_resolved
        return interval, risen


def first_count(t_ns: int, origin_ns: int) -> int:
    """What a sensor that settles at t_ns counts steps and crossings from: the microseconds since the origin.

    So what is drawn by count depends on nothing before a cut, and hardly ever twice on one number; and a clip that
    begins later has the same noise later.
    """
    return (t_ns - origin_ns) // 1000


def as_counted(count: int) -> np.uint32:
    """The count as pixels have it."""
    return np.uint32(count & 0xFFFFFFFF)
