"""Part of a source, and a source whose time runs slower or faster.

    Cut      frames at start_s <= t <= stop_s on the source's own clock
    Slowed   t -> t / slowdown: footage that plays `slowdown` times slower than the world went is put right

Both ends belong to a part: the events of two parts that share a frame are together those of the whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import islice, takewhile
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from vid2ev.errors import DataError, UsageError
from vid2ev.requests import is_finite
from vid2ev.sources.edit import Edit
from vid2ev.sources.times import LONGEST_NS, round_ns
from vid2ev.stream.frames import Frame

if TYPE_CHECKING:
    from vid2ev.sources.source import Source

FASTEST, SLOWEST = 1e-6, 1e3


@runtime_checkable
class Divisible(Protocol):
    """A source that need not read all that comes before a part of it."""

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """The frames from `since_ns` to `until_ns`, both included, None without end; from index `start` among these."""


class Cut(Edit):
    """The frames from start_s to stop_s [s], both included; None is the very start, or the very end.

    Raises UsageError for instants that cannot be meant, and if the source has no frame between them; of a source that
    passes once this is known at its end only, and a DataError.
    """

    def __init__(self, source: Source, start_s: float | Fraction | None, stop_s: float | Fraction | None):
        super().__init__(source)
        self._start, self._stop = _instant(start_s, "start"), _instant(stop_s, "stop")
        if self._start is not None and self._stop is not None and self._stop < self._start:
            raise UsageError(f"stop {stop_s} s: before start {start_s} s; expected a later instant")
        self._duration_s = None if self._stop is None else float(self._stop - (self._start or 0))
        if source.rewindable:
            self._duration_s = self._measured()

    @property
    def frames_expected(self) -> int | None:
        """In proportion to the part of the duration."""
        whole, whole_s = super().frames_expected, super().duration_expected_s
        if whole is None or not whole_s or self._duration_s is None:
            return None
        both_ends = self._stop is not None
        return max(1, min(whole, round(whole * self._duration_s / whole_s) + both_ends))

    @property
    def duration_expected_s(self) -> float | None:
        """The part of the source's duration."""
        return self._duration_s

    def edits(self) -> dict[str, Any]:
        """Start and stop [s]."""
        return {"start_s": _shown(self._start), "stop_s": _shown(self._stop)}

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` of the part on."""
        nothing = not self.rewindable and start == 0
        for frame in self._between(start):
            nothing = False
            yield frame
        if nothing:
            raise DataError(self._empty("wait longer, or leave --start and --stop out"))

    def ends_ns(self) -> tuple[int | None, int | None]:
        """The first and the last instant that may be in the part [ns], as far as it has ends."""
        since_ns = None if self._start is None else math.ceil(self._start * 10**9)
        return since_ns, None if self._stop is None else math.floor(self._stop * 10**9)

    def _between(self, start: int) -> Iterator[Frame]:
        since_ns, until_ns = self.ends_ns()
        if isinstance(self.source, Divisible):
            return self.source.frames_between(since_ns, until_ns, start)
        coming = self.source.frames(start if since_ns is None else 0)
        if since_ns is not None:
            coming = islice((frame for frame in coming if frame.t_ns >= since_ns), start, None)
        return coming if until_ns is None else takewhile(lambda frame: frame.t_ns <= until_ns, coming)

    def _measured(self) -> float | None:
        """From the first frame of the part to its end [s], as far as that is known."""
        opening, first = next(self.source.frames(), None), next(self.frames(), None)
        whole_s = self.source.duration_expected_s
        if opening is None or first is None:
            begin_s = 0.0 if opening is None else opening.t_ns / 1e9
            end = "" if whole_s is None else f" to {begin_s + whole_s:g} s"
            raise UsageError(self._empty(f"it goes from {begin_s:g} s{end}"))
        ends: list[Fraction] = [] if whole_s is None else [Fraction(opening.t_ns, 10**9) + Fraction(whole_s)]
        ends += [] if self._stop is None else [self._stop]
        return max(float(min(ends) - Fraction(first.t_ns, 10**9)), 0.0) if ends else None

    def _empty(self, remedy: str) -> str:
        begin = "its beginning" if self._start is None else f"{float(self._start):g} s"
        end = "its end" if self._stop is None else f"{float(self._stop):g} s"
        about = self.source.describe()
        return f"{about.get('path', about.get('name', 'source'))}: no frame from {begin} to {end}; {remedy}"


class Slowed(Edit):
    """A source with its times divided by `slowdown`.  Raises UsageError for one that is not from 1e-6 to 1000."""

    def __init__(self, source: Source, slowdown: float | Fraction):
        super().__init__(source)
        self._slowdown = Fraction(str(slowdown_of(slowdown)))

    @property
    def duration_expected_s(self) -> float | None:
        """The source's duration divided."""
        whole_s = super().duration_expected_s
        return None if whole_s is None else float(Fraction(whole_s) / self._slowdown)

    def edits(self) -> dict[str, Any]:
        """The factor."""
        return {"slowdown": str(self._slowdown)}

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on, each at the nearest nanosecond; DataError if two come to lie on one, or
        beyond what the clock can say."""
        before_ns: int | None = None
        for frame in self.source.frames(start):
            t_ns = self.slowed_ns(frame.t_ns)
            if abs(t_ns) > LONGEST_NS:
                raise DataError(
                    f"slowdown {float(self._slowdown):g}: a frame at {frame.t_ns / 1e9:g} s would be beyond 146 years;"
                    " use more, or times that begin nearer to 0"
                )
            if before_ns is not None and t_ns <= before_ns:
                raise DataError(
                    f"slowdown {float(self._slowdown):g}: two frames come to lie on one nanosecond; use less"
                )
            yield replace(frame, t_ns=t_ns)
            before_ns = t_ns

    def slowed_ns(self, t_ns: int) -> int:
        """When what the source has at t_ns comes."""
        return round_ns(Fraction(t_ns, 10**9) / self._slowdown)


def slowdown_of(slowdown: float | Fraction) -> float | Fraction:
    """The same.  Raises UsageError for one that is not from 1e-6 to 1000."""
    if not is_finite(slowdown) or not FASTEST <= slowdown <= SLOWEST:
        raise UsageError(
            f"slowdown {slowdown}: expected a number from 1e-6 to 1000, such as 8 for 240 fps that play at 30"
        )
    return slowdown


def _instant(seconds: float | Fraction | None, name: str) -> Fraction | None:
    if seconds is None:
        return None
    if not is_finite(seconds) or abs(float(seconds)) * 1e9 > LONGEST_NS:
        raise UsageError(f"{name} {seconds}: expected a number of seconds on the source's clock")
    return Fraction(str(seconds))


def _shown(seconds: Fraction | None) -> float | None:
    return None if seconds is None else float(seconds)
