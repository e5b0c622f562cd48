"""How different two streams of events are: A, held against the reference B.

    distance        van Rossum's at 1 ms, normalised, signed, per pixel (`distance`); at 100 us beside it
    count error     sum over the pixels of |n_A - n_B| / n_B
    matched share   of the events of B, and of A: how many have a partner in the other (`matching`)
    timing error    t_A - t_B of the partners [us], positive where A is late: its median; median and
                    95th percentile of its size
    polarity errors events without a partner that have one of the opposite polarity

Percentiles are those of the inverted distribution: whole microseconds that occur, not means of two.  What is undefined,
such as a timing error without a pair, or a share of no events, is None.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vid2ev.compare.by_pixel import ByPixel, by_pixel
from vid2ev.compare.distance import TAUS_US, normalised, squared_distances
from vid2ev.compare.matching import WINDOW_US, match
from vid2ev.stream.events import Events, check_within
from vid2ev.terminal import counted

BINS = 100  # parts of the time for which the distance is kept
LATEST_US = 2 * 10**18  # 63,000 years, nanoseconds since 1970 among them: of differences, twice as much fits in 64 bits


@dataclass(frozen=True)
class Comparison:
    """What came out; the errors are those of A against the reference B.

    size, span_us                   sensor (width, height) [px]; first and last instant compared [us]
    events, reference_events        how many events A and B have
    window_us                       partners are less than this apart [us]
    distances                       vR by time constant [us]
    polarity_errors                 pairs of events of opposite polarity
    squared_distance                van Rossum's D2 of each pixel at the first time constant, float64 [H, W]
    difference                      n_A - n_B of each pixel, int64 [H, W]
    timing_errors                   int64 [2 window_us - 1]: pairs with t_A - t_B = k - (window_us - 1) us
    by_time                         float64 [2, BINS]: D2 and events in equal parts of the span
    """

    size: tuple[int, int]
    span_us: tuple[int, int]
    events: int
    reference_events: int
    window_us: int
    distances: dict[int, float]
    polarity_errors: int
    squared_distance: np.ndarray = field(repr=False, compare=False)
    difference: np.ndarray = field(repr=False, compare=False)
    timing_errors: np.ndarray = field(repr=False, compare=False)
    by_time: np.ndarray = field(repr=False, compare=False)

    @property
    def distance(self) -> float:
        """The headline: vR at the first time constant."""
        return next(iter(self.distances.values()))

    @cached_property
    def count_error(self) -> float | None:
        """sum |n_A - n_B| / n_B, pixel by pixel; 0 if neither has an event, None if only B has none."""
        wrong = int(np.abs(self.difference).sum())
        return wrong / self.reference_events if self.reference_events else (None if wrong else 0.0)

    @cached_property
    def matched(self) -> int:
        """How many pairs there are."""
        return int(self.timing_errors.sum())

    @cached_property
    def timing_error_us(self) -> int | None:
        """The median of t_A - t_B: positive where A is late."""
        return percentile(self.timing_errors, 50, 1 - self.window_us)

    @cached_property
    def absolute_timing_error_us(self) -> tuple[int | None, int | None]:
        """Median and 95th percentile of |t_A - t_B|."""
        return absolute_percentiles(self.timing_errors)

    def as_dict(self) -> dict[str, Any]:
        """All numbers, ready for JSON."""
        median_us, most_us = self.absolute_timing_error_us
        return {
            "size": list(self.size),
            "span_us": list(self.span_us),
            "events": self.events,
            "reference_events": self.reference_events,
            "distance": self.distance,
            "distance_by_tau_us": {str(tau): distance for tau, distance in self.distances.items()},
            "count_error": self.count_error,
            "window_us": self.window_us,
            "matched": self.matched,
            "matched_share": self.matched / self.events if self.events else None,
            "matched_share_of_reference": self.matched / self.reference_events if self.reference_events else None,
            "timing_error_median_us": self.timing_error_us,
            "timing_error_abs_median_us": median_us,
            "timing_error_abs_p95_us": most_us,
            "polarity_errors": self.polarity_errors,
        }

    def facts(self) -> list[tuple[str, str]]:
        """The same for people: a name and a line for each."""
        span, events = self._span(), (self.events, self.reference_events)
        if not any(events):
            return [("events", "none in either: there is nothing to compare"), span]
        headline, *others = (f"{distance:.3g} at {_time(tau)}" for tau, distance in self.distances.items())
        beside = "".join(f", {text}" for text in others)
        wrong = "" if self.count_error is None else f"; count error {_percent(self.count_error)}, pixel by pixel"
        facts = [
            ("distance", f"{headline}{beside} (van Rossum; 0: the same, 1 or more: nothing in common)"),
            ("counts", f"{counted(self.events, 'event')} against {self.reference_events:,} of the reference{wrong}"),
        ]
        if not all(events):
            return [*facts, ("matched", f"nothing: {'the reference' if self.events else 'it'} has no events"), span]
        share, other_share = (_percent(self.matched / count) for count in events)
        facts.append(("matched", f"{share} of them, {other_share} of the reference's, within {_time(self.window_us)}"))
        if self.matched:
            median_us, most_us = self.absolute_timing_error_us
            bias_us = self.timing_error_us or 0
            lateness = f"{abs(bias_us)} us {'early' if bias_us < 0 else 'late'}"
            facts.append(("timing", f"{median_us} us median error, {most_us} us 95th percentile; {lateness} (median)"))
        return [*facts, ("polarity", f"{counted(self.polarity_errors, 'event')} of the wrong polarity"), span]

    def _span(self) -> tuple[str, str]:
        first_us, last_us = self.span_us
        size = "x".join(map(str, self.size))
        return "compared", f"{(last_us - first_us) / 1e6:.10g} s from {first_us} us on, {size}"

    def __str__(self) -> str:
        return "\n".join(f"{name:<9} {text}" for name, text in self.facts())


def compare(
    events: Events,
    reference: Events,
    size: tuple[int, int],
    *,
    taus_us: tuple[int, ...] = TAUS_US,
    window_us: int = WINDOW_US,
) -> Comparison:
    """Compare events with those of a reference, both in order of time, of a sensor of `size` (width, height).

    Raises ValueError for events out of order of time, later or earlier than `LATEST_US`, outside of the sensor, or in
    arrays of other lengths.
    """
    for side in (events, reference):
        check_within(side, size)
    ends = [t for side in (events, reference) if len(side) for t in (int(side.t[0]), int(side.t[-1]))]
    if max(map(abs, ends), default=0) > LATEST_US:
        raise ValueError(f"events from {min(ends)} to {max(ends)} us: expected times within {LATEST_US} us")
    tally = Tally(size, (min(ends, default=0), max(ends, default=0)), taus_us=taus_us, window_us=window_us)
    rows = range(size[1])
    tally.add(by_pixel([events], size[0], rows), by_pixel([reference], size[0], rows), rows)
    return tally.comparison()


class Tally:
    """A comparison that grows by bands of rows, in order from the first; it does not depend on how they are cut."""

    def __init__(
        self,
        size: tuple[int, int],
        span_us: tuple[int, int],
        *,
        taus_us: tuple[int, ...] = TAUS_US,
        window_us: int = WINDOW_US,
    ):
        self._size, self._span_us, self._window_us = size, span_us, window_us
        self._squared = {tau: np.zeros(size[::-1]) for tau in taus_us}
        self._difference = np.zeros(size[::-1], np.int64)
        self._errors = np.zeros(2 * window_us - 1, np.int64)
        self._by_time = np.zeros((2, BINS))
        self._events = self._reference_events = self._polarity_errors = 0

    def add(self, a: ByPixel, b: ByPixel, rows: range) -> None:
        """All events of the rows."""
        band, shape = slice(rows.start, rows.stop), (len(rows), self._size[0])
        bin_us = (self._span_us[1] - self._span_us[0] + 1) / BINS
        for k, (tau_us, squared) in enumerate(self._squared.items()):
            timing = (self._by_time, self._span_us[0], bin_us) if k == 0 else ()
            squared[band] = squared_distances(a, b, tau_us, *timing).reshape(shape)
        self._difference[band] = (a.counts - b.counts).reshape(shape)
        found = match(a, b, self._window_us)
        self._errors += found.errors
        self._polarity_errors += found.polarity_errors
        self._events += len(a)
        self._reference_events += len(b)

    def comparison(self) -> Comparison:
        """What came out."""
        many = self._events, self._reference_events
        return Comparison(
            size=self._size,
            span_us=self._span_us,
            events=self._events,
            reference_events=self._reference_events,
            window_us=self._window_us,
            distances={tau: normalised(squared.sum(), *many) for tau, squared in self._squared.items()},
            polarity_errors=self._polarity_errors,
            squared_distance=next(iter(self._squared.values())),
            difference=self._difference,
            timing_errors=self._errors,
            by_time=self._by_time,
        )


def percentile(counts: np.ndarray, percent: int, lowest: int = 0) -> int | None:
    """The least whole number at or below which are `percent` of them, where counts[k] of them are lowest + k."""
    total = int(counts.sum())
    if total == 0:
        return None
    return lowest + int(np.searchsorted(np.cumsum(counts) * 100, total * percent))


def absolute_percentiles(errors_us: np.ndarray) -> tuple[int | None, int | None]:
    """Median and 95th percentile of |t_A - t_B| [us], of how many pairs have each t_A - t_B, 0 in the middle."""
    middle = len(errors_us) // 2
    late = errors_us[middle:].copy()
    late[1:] += errors_us[:middle][::-1]
    return percentile(late, 50), percentile(late, 95)


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _time(us: int) -> str:
    return f"{us / 1000:g} ms" if us >= 1000 else f"{us} us"
