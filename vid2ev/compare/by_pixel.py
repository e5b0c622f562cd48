"""Events in the order of their pixels, and within a pixel in order of time: how two streams are compared.

    moments[begins[k] : begins[k + 1]]    the events of pixel k = y * width + x, ascending: 2 t_us + p

A counting sort: two looks at each event, whatever their number.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.stream.events import Events


@dataclass(frozen=True, slots=True)
class ByPixel:
    """N events of P pixels: moments int64 [N] (2 t_us + p), begins int64 [P + 1]."""

    moments: np.ndarray
    begins: np.ndarray

    def __len__(self) -> int:
        return len(self.moments)

    @property
    def counts(self) -> np.ndarray:
        """How many events each pixel has, int64 [P]."""
        return np.diff(self.begins)


def by_pixel(blocks: Iterable[Events], width: int, rows: range) -> ByPixel:
    """Events of the `rows` of a sensor, given in order of time, by pixel; those of other rows are left out.

    Raises ValueError for events right of the sensor, or out of order of time.
    """
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    begins = np.zeros(width * len(rows) + 1, np.int64)
    last_us = None
    for events in blocks:
        if not len(events):
            continue
        if np.any(events.t[1:] < events.t[:-1]) or (last_us is not None and events.t[0] < last_us):
            raise ValueError("events out of order of time")
        if int(events.x.max()) >= width:
            raise ValueError(f"events outside of a sensor {width} pixels wide")
        last_us = events.t[-1]
        parts.append(_of_rows(events.t, events.x, events.y, events.p, width, rows.start, rows.stop))
        _count(parts[-1][0], begins)
    np.cumsum(begins, out=begins)
    places, ordered = begins[:-1].copy(), np.empty(begins[-1], np.int64)
    for pixels, moments in parts:
        _scatter(pixels, moments, places, ordered)
    return ByPixel(ordered, begins)


@cached
def _of_rows(t, x, y, p, width, first, stop):  # type: ignore[no-untyped-def]
    many = 0
    for row in y:
        many += first <= row < stop
    pixels, moments = np.empty(many, np.uint32), np.empty(many, np.int64)
    many = 0
    for i in range(len(t)):
        if first <= y[i] < stop:
            pixels[many] = (np.int64(y[i]) - first) * width + np.int64(x[i])
            moments[many] = 2 * t[i] + np.int64(p[i] != 0)
            many += 1
    return pixels, moments


@cached
def _count(pixels, begins):  # type: ignore[no-untyped-def]
    for pixel in pixels:
        begins[pixel + np.uint32(1)] += 1


@cached
def _scatter(pixels, moments, places, ordered):  # type: ignore[no-untyped-def]
    for i in range(len(pixels)):
        pixel = pixels[i]
        ordered[places[pixel]] = moments[i]
        places[pixel] += 1
