"""How many steps, and when."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.upsample.subframes import KAPPA_PER_PX, TOLERANCE_S, instants, steps_for

times = st.integers(-(2**62), 2**62)


@given(times, st.integers(1, 10**12), st.integers(1, 300))
def test_instants_divide_the_interval_evenly(start: int, length: int, steps: int) -> None:
    made = instants(start, start + length, steps)
    assert len(made) == min(steps, length) - 1
    assert all(a < b for a, b in pairwise([start, *made, start + length]))
    for k, t_ns in enumerate(made, 1):
        assert abs(t_ns - start - Fraction(k * length, min(steps, length))) <= Fraction(1, 2)


@given(st.floats(0.05, 100), st.floats(1e-4, 2))
def test_the_steps_are_enough_and_not_one_too_many(shift_px: float, interval_s: float) -> None:
    def misplaced_s(steps: int) -> float:
        speed = shift_px / interval_s
        return KAPPA_PER_PX * speed * (interval_s / steps) ** 2 / 8

    def good(steps: int) -> bool:
        return shift_px / steps <= 0.5 + 1e-9 and misplaced_s(steps) <= TOLERANCE_S * (1 + 1e-9)

    steps = steps_for(shift_px, interval_s)
    assert good(steps) and (steps == 1 or not good(steps - 1) or math.isclose(shift_px / (steps - 1), 0.5))


@pytest.mark.parametrize("interval_s", [1e-6, 1 / 30, 3600.0])
def test_still_intervals_take_one_step(interval_s: float) -> None:
    assert steps_for(0.0, interval_s) == steps_for(0.049, interval_s) == 1


def test_known_cases() -> None:
    assert steps_for(4.0, 1 / 30) == 12  # sqrt(0.4 * 4 / 30 / 4e-4) = 11.5
    assert steps_for(40.0, 1 / 30) == 80  # half a pixel each
    assert steps_for(0.2, 1 / 1000) == 1
