"""How far what a setting sends is from the reference.

    distance      van Rossum's at 1 ms (`compare.distance`), of all event cameras together: 2 sum D2 / (n_A + n_B)
    count error   sum over the pixels of |n_A - n_B| / n_B
    timing        median and 95th percentile of |t_A - t_B| of the events that have partners [us]
    frames        root of the mean squared difference of codes [LSB of the ADC], of exposures that both have
    views         PSNR [dB] and SSIM of what the cameras see, in 8 bits of sRGB

The noise of a sensor is a function of seed, pixel and tick, so it is the same in all settings that have it, and what is
compared are recordings of one and the same camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vid2ev.compare.comparison import Tally, absolute_percentiles
from vid2ev.compare.distance import TAUS_US, normalised
from vid2ev.compare.matching import WINDOW_US
from vid2ev.cost.passes import Sent
from vid2ev.cost.quality import Quality, quality


@dataclass(frozen=True)
class Errors:
    """Errors against the reference; None where there is nothing to compare.

    distance      vR: 0 for the same events, 1 or more for nothing in common
    count_error   share of the reference's events
    timing_us     median and 95th percentile
    matched       share of the reference's events that have partners
    rms_lsb       of frames
    views         of what the cameras see
    """

    distance: float | None = None
    count_error: float | None = None
    timing_us: tuple[int, int] | None = None
    matched: float | None = None
    rms_lsb: float | None = None
    views: Quality | None = None

    @property
    def headline(self) -> float | None:
        """The distance; without event cameras the error of frames."""
        return self.rms_lsb if self.distance is None else self.distance

    def describe(self) -> dict[str, Any]:
        """The errors, ready for JSON."""
        return asdict(self)


class Reference:
    """What the reference sent, kept to compare others with."""

    def __init__(self, sent: Sequence[Sent], span_us: tuple[int, int]):
        self._sent, self._span_us = list(sent), span_us
        self._events = [one.by_pixel(one.mount.size) if one.mount.kind == "dvs" else None for one in sent]
        for one in sent:
            one.events.clear()

    def errors_of_itself(self) -> Errors:
        """None: what was sent is what it is."""
        events = any(reference is not None for reference in self._events)
        frames = 0.0 if any(one.codes for one in self._sent) else None
        return Errors(0.0, 0.0, (0, 0), 1.0, frames) if events else Errors(rms_lsb=frames)

    def errors(self, sent: Sequence[Sent], coarse: int = 1, views: bool = False) -> Errors:
        """Errors of what another setting sent; of events as if each pixel were `coarse` by `coarse`."""
        squared = count = events = others = matched = 0.0
        pairs = np.zeros(2 * WINDOW_US - 1, np.int64)
        for one, mine, reference in zip(sent, self._sent, self._events, strict=True):
            if reference is None:
                continue
            size = mine.mount.size
            tally = Tally(size, self._span_us, taus_us=TAUS_US[:1])
            tally.add(one.by_pixel(size, coarse), reference, range(size[1]))
            found = tally.comparison()
            squared += float(found.squared_distance.sum())
            count += float(np.abs(found.difference).sum())
            events, others = events + found.events, others + found.reference_events
            matched += found.matched
            pairs += found.timing_errors
        frames = _rms_lsb(sent, self._sent)
        seen = (
            quality([pair for x, y in zip(sent, self._sent, strict=True) for pair in _pairs(x, y)]) if views else None
        )
        if all(reference is None for reference in self._events):
            return Errors(rms_lsb=frames, views=seen)
        return Errors(
            distance=normalised(squared, int(events), int(others)),
            count_error=count / others if others else (None if count else 0.0),
            timing_us=_timing(pairs),
            matched=matched / others if others else 1.0,
            rms_lsb=frames,
            views=seen,
        )


def _timing(errors_us: np.ndarray) -> tuple[int, int] | None:
    median, most = absolute_percentiles(errors_us)
    return None if median is None or most is None else (median, most)


def _rms_lsb(sent: Sequence[Sent], reference: Sequence[Sent]) -> float | None:
    squared, many = 0.0, 0
    for one, other in zip(sent, reference, strict=True):
        for a, b in zip(one.codes, other.codes, strict=False):
            if a.shape == b.shape:
                squared += float(np.square(a.astype(np.float64) - b).sum())
                many += a.size
    return float(np.sqrt(squared / many)) if many else None


def _pairs(one: Sent, other: Sent) -> list[tuple[np.ndarray, np.ndarray]]:
    return [(a, b) for a, b in zip(one.views, other.views, strict=False) if a.shape == b.shape]
