"""When frames are made: an exact grid of instants, each between two key frames or on one of them.

    times N   instant j lies (j / N) mod 1 of the way from key frame floor(j / N) to the next
    rate R    instant j lies j / R s after the first key frame

j / N and j / R are fractions, and each instant is rounded once, to the nearest microsecond: there is no drift.  An
instant of a rate that is within `SAME_US` of a key frame is that key frame, at the key frame's own time, since files
round times; and no instant depends on more than the key frames around it, so that work can be taken up anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil, floor
from typing import Protocol

from vid2ev.errors import UsageError

Number = str | float | Fraction
SAME_US = 1
FASTEST_HZ = 100_000
MOST = 10_000
FINEST = 1001  # denominators of rates
LARGEST = 10**15
LONGEST, FARTHEST = 100, 999  # characters of a number, and its exponent


@dataclass(frozen=True, slots=True)
class Instant:
    """One of the frames to make.

    number   among all, from 0
    t_us     on the clock of the key frames
    share    0 ... 1 of the way from the key frame before to the one after; 0 is the key frame itself
    """

    number: int
    t_us: int
    share: Fraction


class TooFine(UsageError):
    """More frames than microseconds between two key frames: what was begun of them can never be finished."""


class Grid(Protocol):
    """Says which frames are to be made.  `zero_us` is the time of the first key frame."""

    def between(self, k: int, start_us: int, stop_us: int, zero_us: int) -> list[Instant]:
        """The instants from key frame k, at start_us, up to but not including the next, at stop_us."""

    def at(self, k: int, t_us: int, zero_us: int) -> list[Instant]:
        """The instant of key frame k, the last one, if it has one."""

    def count(self, gaps: int, span_us: int) -> int:
        """How many instants there are in so many gaps that last so long altogether."""

    def multiple_of(self, key_hz: Fraction) -> Fraction:
        """How many instants there are to a key frame, of which there are so many a second."""

    def describe(self) -> dict[str, str]:
        """For JSON."""


@dataclass(frozen=True, slots=True)
class Times:
    """So many times the frames, in even steps from key frame to key frame; see above.

    Raises UsageError unless it is more than 0 and at most `MOST`.
    """

    multiple: Fraction

    def __post_init__(self) -> None:
        if not 0 < self.multiple <= MOST:
            raise UsageError(f"-x {float(self.multiple):g}: expected more than 0 and at most {MOST}, such as 32 or 2.5")

    def between(self, k: int, start_us: int, stop_us: int, zero_us: int) -> list[Instant]:
        """See `Grid`.  Raises TooFine where two instants come to lie on one microsecond."""
        numbers = range(ceil(k * self.multiple), ceil((k + 1) * self.multiple))
        shares = [Fraction(number) / self.multiple - k for number in numbers]
        times = [_rounded(start_us + share * (stop_us - start_us)) for share in shares]
        if any(t >= after for t, after in pairwise([*times, stop_us])):
            raise TooFine(
                f"-x {float(self.multiple):g} of frames {stop_us - start_us} us apart: more than one in a microsecond;"
                " choose fewer"
            )
        return [Instant(*each) for each in zip(numbers, times, shares, strict=True)]

    def at(self, k: int, t_us: int, zero_us: int) -> list[Instant]:
        """See `Grid`."""
        number = k * self.multiple
        return [Instant(int(number), t_us, Fraction(0))] if number.denominator == 1 else []

    def count(self, gaps: int, span_us: int) -> int:
        """See `Grid`."""
        return floor(gaps * self.multiple) + 1

    def multiple_of(self, key_hz: Fraction) -> Fraction:
        """See `Grid`."""
        return self.multiple

    def describe(self) -> dict[str, str]:
        """See `Grid`."""
        return {"multiple": str(self.multiple)}


@dataclass(frozen=True, slots=True)
class Rate:
    """So many frames a second; see above.  Raises UsageError unless it is more than 0 and at most `FASTEST_HZ`."""

    rate_hz: Fraction

    def __post_init__(self) -> None:
        if not 0 < self.rate_hz <= FASTEST_HZ:
            raise UsageError(f"--fps {float(self.rate_hz):g}: expected more than 0 and at most {FASTEST_HZ}")

    def between(self, k: int, start_us: int, stop_us: int, zero_us: int) -> list[Instant]:
        """See `Grid`."""
        first, stop = (ceil(self._number(t_us - SAME_US, zero_us)) for t_us in (start_us, stop_us))
        return [self._instant(number, start_us, stop_us, zero_us) for number in range(first, stop)]

    def at(self, k: int, t_us: int, zero_us: int) -> list[Instant]:
        """See `Grid`."""
        number = ceil(self._number(t_us - SAME_US, zero_us))
        return [Instant(number, t_us, Fraction(0))] if self._number(t_us + SAME_US, zero_us) >= number else []

    def count(self, gaps: int, span_us: int) -> int:
        """See `Grid`."""
        return floor(self._number(span_us + SAME_US, 0)) + 1

    def multiple_of(self, key_hz: Fraction) -> Fraction:
        """See `Grid`."""
        return self.rate_hz / key_hz

    def describe(self) -> dict[str, str]:
        """See `Grid`."""
        return {"rate_hz": str(self.rate_hz)}

    def _number(self, t_us: int, zero_us: int) -> Fraction:
        return (t_us - zero_us) * self.rate_hz / 10**6

    def _instant(self, number: int, start_us: int, stop_us: int, zero_us: int) -> Instant:
        exact = zero_us + Fraction(number) * 10**6 / self.rate_hz
        if abs(exact - start_us) <= SAME_US:
            return Instant(number, start_us, Fraction(0))
        return Instant(number, _rounded(exact), (exact - start_us) / (stop_us - start_us))


def parse_number(text: Number, option: str) -> Fraction:
    """A number as people write it: 32, 2.5, 30000/1001.  Raises UsageError, also for one that nobody means."""
    if isinstance(text, Fraction) and abs(text) <= LARGEST:
        return text
    said = str(text).strip()
    try:
        number = Fraction(said) if _is_short(said) else None
    except (ValueError, ZeroDivisionError):
        raise UsageError(f"{option} {said}: expected a number, such as 32, 2.5 or 30000/1001") from None
    if number is None or abs(number) > LARGEST:
        raise UsageError(
            f"{option} {said[:LONGEST]}: expected a number from 1e-{FARTHEST} to {LARGEST:g}, such as 32, 2.5 or"
            " 30000/1001"
        )
    return number


def _is_short(said: str) -> bool:
    """Whether a number has few digits, also as a fraction: 1e1000000000 has as many.  Raises ValueError for none, which
    1_0 is to people."""
    if "_" in said:
        raise ValueError(said)
    return len(said) <= LONGEST and abs(int(said.lower().partition("e")[2] or 0)) <= FARTHEST


def rate_of(exact: Fraction) -> Fraction:
    """A mean rate [Hz] as a person would say it: in so many frames a second, or in seconds a frame."""
    return exact.limit_denominator(FINEST) if exact >= 1 else 1 / (1 / exact).limit_denominator(FINEST)


def _rounded(t_us: Fraction) -> int:
    return floor(t_us + Fraction(1, 2))
