"""Ticks: the instants of a clock with a rate, which exposures and event frames go by.

    tick k is at floor(k unit / rate + 1/2)     the nearest unit of time, halves upwards

The rate is exactly the number that is written in decimals, 29.97 as 2997/100, and all is whole numbers: a clock drifts
by nothing, however long it goes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

HALF = Fraction(1, 2)
WIDEST = 1 << 62  # of products that are taken in int64


@dataclass(frozen=True, slots=True)
class Ticks:
    """The clock whose ticks are `period` units of time apart, the first (0) at 0."""

    period: Fraction

    @classmethod
    def of(cls, rate_hz: float, unit_hz: int) -> Ticks:
        """Ticks at a rate above 0, in units of 1 / unit_hz s."""
        return cls(unit_hz / Fraction(str(rate_hz)))

    def at(self, k: int) -> int:
        """When tick k is."""
        return math.floor(k * self.period + HALF)

    def all_at(self, k: np.ndarray) -> np.ndarray:
        """When ticks k [int64] are."""
        return _floors(k, 2 * self.period.numerator, self.period.denominator, 2 * self.period.denominator)

    def first_from(self, t: np.ndarray) -> np.ndarray:
        """The first tick that is not before t [int64].  (A rounded one is not, where k period >= t - 1/2.)"""
        return -_floors(-t, 2 * self.period.denominator, self.period.denominator, 2 * self.period.numerator)


def _floors(k: np.ndarray, a: int, b: int, c: int) -> np.ndarray:
    """floor((a k + b) / c) of whole numbers, a, b and c above 0."""
    if not len(k):
        return k
    if a * (c + max(abs(int(k.min())), abs(int(k.max()))) // c + 1) + b < WIDEST:
        whole, rest = np.divmod(k, c)
        return a * whole + (a * rest + b) // c
    some, which = np.unique(k, return_inverse=True)  # (rates of many digits)
    return np.array([(a * each + b) // c for each in some.tolist()], np.int64)[which]
