"""Instants lie on an exact grid, whatever the multiple or the rate, and none is lost or made twice."""

from __future__ import annotations

from fractions import Fraction

import pytest

from interp.interpolate.instants import SAME_US, Grid, Instant, Number, Rate, Times, parse_number
from vid2ev.errors import UsageError

KEYS = [round(Fraction(10**6 * k, 30)) for k in range(61)]  # 2 s of 30 frames a second


def all_of(grid: Grid, keys: list[int] = KEYS) -> list[Instant]:
    gaps = [each for k in range(len(keys) - 1) for each in grid.between(k, keys[k], keys[k + 1], keys[0])]
    return gaps + grid.at(len(keys) - 1, keys[-1], keys[0])


@pytest.mark.parametrize("multiple", [Fraction(2), Fraction(7), Fraction(32), Fraction(5, 2), Fraction(1, 3)])
def test_a_multiple_divides_every_gap_evenly_without_drift(multiple: Fraction) -> None:
    found = all_of(Times(multiple))
    assert [each.number for each in found] == list(range(len(found))) and len(found) == Times(multiple).count(60, 0)
    for each in found:
        k, share = divmod(each.number / multiple, 1)
        assert each.share == share
        exact = KEYS[k] if not share else KEYS[k] + share * (KEYS[k + 1] - KEYS[k])
        assert abs(each.t_us - exact) <= Fraction(1, 2)
        assert share or each.t_us == KEYS[k]


@pytest.mark.parametrize(
    "rate", [Fraction(1000), Fraction(90), Fraction(30), Fraction(30000, 1001), Fraction(96001, 7)]
)
@pytest.mark.parametrize("zero_us", [0, 123_456_789_012])
def test_a_rate_is_kept_to_the_microsecond_and_meets_key_frames(rate: Fraction, zero_us: int) -> None:
    keys = [zero_us + t_us for t_us in KEYS]
    found = all_of(Rate(rate), keys)
    assert [each.number for each in found] == list(range(len(found)))
    assert len(found) == Rate(rate).count(60, keys[-1] - keys[0])
    for each in found:
        exact = zero_us + each.number * 10**6 / rate
        near = [t_us for t_us in keys if abs(t_us - exact) <= SAME_US]
        if near:
            assert each.share == 0 and each.t_us == near[0]
        else:
            assert each.share > 0 and abs(each.t_us - exact) <= Fraction(1, 2)
    if rate == 1000:
        assert sum(not each.share for each in found) == 21  # every third frame of 30 a second is at a whole millisecond
    if rate == 30:
        assert all(not each.share for each in found)


def test_frames_of_uneven_times_are_divided_gap_by_gap() -> None:
    found = all_of(Times(Fraction(2)), [0, 10, 1000, 1001 * 1000])
    assert [each.t_us for each in found] == [0, 5, 10, 505, 1000, 501000, 1001000]


@pytest.mark.parametrize("text", ["1e400", "-1e400", "1e1000000000", "1E-1000000000", "9" * 5000, 10**400, 1e300])
def test_numbers_beyond_all_meaning_are_refused_in_a_short_sentence(text: Number) -> None:
    with pytest.raises(UsageError, match=r"--fps -?[19][\de.E+-]*: expected a number from 1e-999 to 1e\+15") as refused:
        parse_number(text, "--fps")
    assert len(str(refused.value)) < 250 and "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["1e", "e5", "1e5e5", "one", "1/0", "", "nan", "-inf", "1e5/3", "1_0E0_2", "3_0"])
def test_what_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="expected a number, such as 32"):
        parse_number(text, "-x")


def test_numbers_are_what_they_say() -> None:
    small = Fraction(1, 10**400)
    said = {"1e-400": small, small: small, " 2.5e1 ": 25, "30000/1001": Fraction(30000, 1001), "10E02": 1000}
    assert {text: parse_number(text, "-x") for text in said} == said
    assert parse_number(Fraction(0.1), "-x") == Fraction(0.1) and parse_number(29.97, "-x") == Fraction(2997, 100)


def test_what_cannot_be_meant_is_refused() -> None:
    for text in ("0", "-2", "1e9"):
        with pytest.raises(UsageError, match="expected more than 0"):
            Times(parse_number(text, "-x"))
    with pytest.raises(UsageError, match="expected a number"):
        parse_number("fast", "--fps")
    with pytest.raises(UsageError, match="expected more than 0"):
        Rate(Fraction(10**7))
    with pytest.raises(UsageError, match="in a microsecond"):
        Times(Fraction(100)).between(0, 0, 33, 0)
