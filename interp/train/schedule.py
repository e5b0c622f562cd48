"""Learning rates, step by step.

    rate(n) = peak * min(1, (n + 1) / warm_up) * (end + (1 - end) (1 + cos(pi u)) / 2)

up, level, and down half a cosine, with u, the way down, within 0 ... 1.  It depends on the step alone, so that
training which goes on has the rates of training that was never interrupted.  Where the steps come from a time, they are
not known at first; until then the rate is level, and it goes down from the step at which they were planned.  Where they
are planned again, what is left of the way down is spread evenly over the steps that are left: the rate does not jump.

Source: Loshchilov and Hutter (2017), "SGDR: stochastic gradient descent with warm restarts", ICLR, without restarts.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

MOST_STEPS = 1 << 40  # of a run
Plans = tuple[tuple[int, int], ...]  # (step at which steps were planned, how many there are in all), one after another


@dataclass(frozen=True, slots=True)
class Steps:
    """How many steps training has.

    plans            (step at which they were planned, how many there are in all), one after another; at least one
    validate_every   steps from one validation to the next
    """

    plans: Plans
    validate_every: int

    @property
    def last(self) -> int:
        """The step with which training ends."""
        return self.plans[-1][1]


@dataclass(frozen=True, slots=True)
class Schedule:
    """Rates in relation to the highest.

    warm_up   steps until it is reached
    end       after the last step
    plans     how many steps there are; none while that is not known
    """

    warm_up: int
    end: float
    plans: Plans = ()

    @property
    def steps(self) -> int | None:
        """How many steps there are; None while that is not known."""
        return self.plans[-1][1] if self.plans else None

    def progress(self, step: int) -> float:
        """How much of the way down a step is, 0 ... 1; steps count from 0."""
        down = 0.0
        for (at, steps), (until, _) in itertools.pairwise((*self.plans, (step, 0))):
            gone = max(min(step, until) - at, 0)
            down += (1 - down) * min(gone / max(steps - at, 1), 1)
        return down

    def share(self, step: int) -> float:
        """The share of the highest rate that a step has."""
        rising = min(1.0, (step + 1) / self.warm_up) if self.warm_up else 1.0
        down = (1 + math.cos(math.pi * self.progress(step))) / 2
        return rising * (self.end + (1 - self.end) * down)
