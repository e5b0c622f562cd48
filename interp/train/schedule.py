"""Learning rates, step by step.

    rate(n) = peak * min(1, (n + 1) / warm_up) * (end + (1 - end) (1 + cos(pi u)) / 2)
    u       = (n - level) / (steps - level)

with u within 0 ... 1: up, level, and down half a cosine.  It depends on the step alone, so that training which goes
on has the rates of training that was never interrupted.  Where the steps come from a time, they are not known at
first; until then the rate is level, and it goes down from the step `level` at which they were fixed.

Source: Loshchilov and Hutter (2017), "SGDR: stochastic gradient descent with warm restarts", ICLR, without restarts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Schedule:
    """Rates in relation to the highest.

    warm_up   steps until it is reached
    end       after the last step
    steps     how many there are; None while that is not known
    level     the step from which the rate goes down
    """

    warm_up: int
    end: float
    steps: int | None = None
    level: int = 0

    def progress(self, step: int) -> float:
        """How much of the way down a step is, 0 ... 1; steps count from 0."""
        if self.steps is None:
            return 0.0
        return min(max((step - self.level) / max(self.steps - self.level, 1), 0.0), 1.0)

    def share(self, step: int) -> float:
        """The share of the highest rate that a step has."""
        rising = min(1.0, (step + 1) / self.warm_up) if self.warm_up else 1.0
        down = (1 + math.cos(math.pi * self.progress(step))) / 2
        return rising * (self.end + (1 - self.end) * down)
