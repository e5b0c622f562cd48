"""What a stream of events is like, whatever the scene: intervals, polarities, rates, noise.

    interval     t_i - t_(i-1) of one pixel [us], apart for two events of one polarity and of opposite ones, in bins
                     0, 1, and on by 10^(1/8), rounded up to whole us, to 10^10 us and whatever is longer
    isolated     an event without another within `neighbour_us` in the 3x3 pixels around it, before or after
    ON share     ON events / events

A Poisson process of rate r per pixel, seen for a time T, has r^2 (T - s) exp(-r s) ds intervals of s ... s + ds in
each pixel (a long one does not fit in often: short recordings show short intervals), and r exp(-2 (9 r) neighbour_us)
isolated events per second off the border.  A refractory period is a floor below which there is no interval.  Light
that moves puts events beside each other, noise does not: isolated events are an estimate of noise from below, for
noise amid moving light, or within `neighbour_us` of noise, is not isolated.

Events are looked at once, in order of time; the memory is 25 bytes per pixel.

Source: the filter of background activity, an event without a recent one beside it is noise, T. Delbruck, "Frame-free
dynamic digital vision", Symposium on Secure-Life Electronics 2008; here it looks both ways, so that the first event of
an edge is not noise, and counts the pixel itself, which makes one pass exact: who is isolated is settled by the next
event of the pixel, or by `neighbour_us`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vid2ev.compare.comparison import percentile
from vid2ev.compiling.cache import cached
from vid2ev.stream.events import Events, check_within
from vid2ev.terminal import counted

NEIGHBOUR_US = 5000
PER_DECADE = 8
DECADES = 10  # 10^10 us are 2.8 hours
EDGES_US = np.unique(np.append(0, np.ceil(10 ** (np.arange(DECADES * PER_DECADE + 1) / PER_DECADE)))).astype(np.int64)
BESIDE = 4  # what is remembered of the last event of a pixel: 1 OFF, 2 ON, and this if another is beside it


@dataclass(frozen=True)
class Statistics:
    """What came out, of events with span_us[0] <= t <= span_us[1].

    size           (width, height) [px]
    span_us        first and last instant looked at [us]
    counts         OFF and ON events of each pixel, int64 [2, H, W]
    intervals      of events of opposite and of one polarity, in the bins of `EDGES_US`, int64 [2, bins]
    isolated       isolated events, OFF and ON
    shortest_us    the shortest interval [us]; None without any
    neighbour_us   how far apart events may be that belong together [us]
    """

    size: tuple[int, int]
    span_us: tuple[int, int]
    counts: np.ndarray = field(repr=False, compare=False)
    intervals: np.ndarray = field(repr=False, compare=False)
    isolated: tuple[int, int]
    shortest_us: int | None
    neighbour_us: int

    @property
    def events(self) -> int:
        """How many there are."""
        return int(self.counts.sum())

    @property
    def seconds(self) -> float:
        """How long was looked."""
        return (self.span_us[1] - self.span_us[0]) / 1e6

    @property
    def on_share(self) -> float | None:
        """ON events / events."""
        return int(self.counts[1].sum()) / self.events if self.events else None

    @property
    def rate_hz(self) -> float | None:
        """Events per pixel and second."""
        return self._rate(self.events)

    @property
    def isolated_hz(self) -> float | None:
        """Isolated events per pixel and second."""
        return self._rate(sum(self.isolated))

    def interval_us(self, percent: int) -> int | None:
        """The upper edge of the bin in which this percentile of the intervals is; None without any, and of the last
        bin, which has whatever is longer, too."""
        bin_of = percentile(self.intervals.sum(axis=0), percent)
        return None if bin_of in (None, self.intervals.shape[1] - 1) else int(EDGES_US[bin_of + 1])

    def about_us(self, percent: int) -> float | None:
        """This percentile of the intervals, as if within their bin all logarithms of intervals came as often."""
        counts = self.intervals.sum(axis=0)
        high_us, bin_of = self.interval_us(percent), percentile(counts, percent)
        if high_us is None or bin_of is None:
            return None
        low_us, before = max(int(EDGES_US[bin_of]), self.shortest_us or 1), int(counts[:bin_of].sum())
        share = (int(counts.sum()) * percent / 100 - before) / int(counts[bin_of])
        return float(low_us * (high_us / low_us) ** share)

    def __str__(self) -> str:
        if self.rate_hz is None or self.on_share is None:
            return counted(self.events, "event")
        text = f"{self.rate_hz:.3g} events/pixel/s, {100 * self.on_share:.3g} % ON; {self.isolated_hz:.3g} isolated"
        if self.shortest_us is None:
            return text
        middle_us = self.interval_us(50)
        half = f"above {EDGES_US[-2]}" if middle_us is None else f"below {middle_us}"
        return f"{text}; intervals from {self.shortest_us} us, half {half} us"

    def as_dict(self) -> dict[str, Any]:
        """All numbers, ready for JSON."""
        pixels, active = self.size[0] * self.size[1], int(np.count_nonzero(self.counts.sum(axis=0)))
        return {
            "events": self.events,
            "rate_hz": self.rate_hz,
            "on_share": self.on_share,
            "active_share": active / pixels,
            "isolated_hz": self.isolated_hz,
            "isolated_on_share": self.isolated[1] / sum(self.isolated) if sum(self.isolated) else None,
            "neighbour_us": self.neighbour_us,
            "interval_shortest_us": self.shortest_us,
            "interval_us": {str(percent): self.interval_us(percent) for percent in (5, 50, 95)},
            "interval_edges_us": EDGES_US.tolist(),
            "intervals_opposite": self.intervals[0].tolist(),
            "intervals_same": self.intervals[1].tolist(),
        }

    def _rate(self, count: int) -> float | None:
        return count / (self.size[0] * self.size[1] * self.seconds) if self.seconds > 0 else None


class Gathering:
    """Statistics that grow by blocks of events, in order of time; they do not depend on how the blocks are cut."""

    def __init__(self, size: tuple[int, int], neighbour_us: int = NEIGHBOUR_US):
        width, height = size
        self._size, self._neighbour_us = size, neighbour_us
        self._counts = np.zeros((2, height, width), np.int64)
        self._last_us = np.zeros((height, width), np.int64)
        self._last_kind = np.zeros((height, width), np.uint8)
        self._intervals = np.zeros((2, len(EDGES_US) - 1), np.int64)
        self._isolated = np.zeros(2, np.int64)
        self._shortest = np.full(1, np.iinfo(np.int64).max)
        self._ends_us: tuple[int, int] | None = None

    def add(self, events: Events) -> None:
        """The next events.  Raises ValueError for events out of order of time or outside of the sensor, or in
        arrays of other lengths."""
        check_within(events, self._size)
        if not len(events):
            return
        if np.any(events.t[1:] < events.t[:-1]) or (self._ends_us is not None and events.t[0] < self._ends_us[1]):
            raise ValueError("events out of order of time")
        first_us = int(events.t[0]) if self._ends_us is None else self._ends_us[0]
        self._ends_us = first_us, int(events.t[-1])
        _gather(
            events.t, events.x, events.y, events.p, self._neighbour_us, EDGES_US, self._counts, self._last_us,
            self._last_kind, self._intervals, self._isolated, self._shortest,
        )  # fmt: skip

    def statistics(self, span_us: tuple[int, int] | None = None) -> Statistics:
        """What came out; span_us is how long was looked, from the first event to the last unless it is given."""
        waiting = np.bincount(self._last_kind[self._last_kind < BESIDE].ravel(), minlength=3)[1:3]
        off, on = (self._isolated + waiting).tolist()
        return Statistics(
            size=self._size,
            span_us=span_us or self._ends_us or (0, 0),
            counts=self._counts.copy(),
            intervals=self._intervals.copy(),
            isolated=(off, on),
            shortest_us=int(self._shortest[0]) if self._intervals.any() else None,
            neighbour_us=self._neighbour_us,
        )


def statistics_of(
    blocks: Iterable[Events],
    size: tuple[int, int],
    span_us: tuple[int, int] | None = None,
    *,
    neighbour_us: int = NEIGHBOUR_US,
) -> Statistics:
    """The statistics of events in order of time, of a sensor of `size` (width, height); raises as `Gathering.add`."""
    gathering = Gathering(size, neighbour_us)
    for events in blocks:
        gathering.add(events)
    return gathering.statistics(span_us)


@cached
def _gather(t, x, y, p, reach_us, edges, counts, last_us, last_kind, intervals, isolated, shortest):  # type: ignore[no-untyped-def]
    height, width = last_us.shape
    for i in range(len(t)):
        now, column, row = t[i], np.int64(x[i]), np.int64(y[i])
        polarity = np.int64(p[i] != 0)
        counts[polarity, row, column] += 1
        before = last_kind[row, column]
        if before:
            gap = now - last_us[row, column]
            same = np.int64((before & 3) - 1 == polarity)
            intervals[same, min(np.searchsorted(edges, gap, side="right") - 1, intervals.shape[1] - 1)] += 1
            shortest[0] = min(shortest[0], gap)
            if before < BESIDE and gap > reach_us:
                isolated[before - 1] += 1
        beside = False
        for r in range(row - 1, row + 2):
            for c in range(column - 1, column + 2):
                if 0 <= r < height and 0 <= c < width and last_kind[r, c] and now - last_us[r, c] <= reach_us:
                    beside = True
                    last_kind[r, c] |= BESIDE
        last_us[row, column] = now
        last_kind[row, column] = (polarity + 1) | (BESIDE if beside else 0)
