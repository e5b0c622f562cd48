"""Pictures from events alone without a network: each pixel's events, integrated and slowly forgotten.

    dy/dt = -2 pi f y + sum_i c_i delta(t - t_i)        c_i = +c_ON, -c_OFF [nat]

y is the log of light, high-pass filtered: what changes faster than f is right, what stands still fades to 0 and noise
with it. Between events y decays by exp(-2 pi f (t - t_i)), which is exact whatever the instants asked for.  A picture
shows light 0.18 exp(y), so that what has no events is grey of 18 %.

Source: C. Scheerlinck, N. Barnes, R. Mahony, "Continuous-time intensity estimation using event cameras", ACCV 2018,
eq. 5 (without frames), with the cut-off frequency in Hz.
"""

from __future__ import annotations

import math

import numpy as np

from vid2ev import Events
from vid2ev.compiling.cache import cached
from vid2ev.errors import UsageError

GREY = 0.18
CUTOFF_HZ = 1.0
BRIGHTEST_NATS = 20.0  # beyond which nothing can be told apart any more


class HighPass:
    """The filter for a sensor of a size (width, height).

    cutoff_hz   f; 0 forgets nothing
    contrast    what an OFF and an ON event stand for [nat]
    Raises UsageError for a frequency that is not from 0 to 10 000.
    """

    name = "high-pass"

    def __init__(self, size: tuple[int, int], contrast: tuple[float, float], cutoff_hz: float = CUTOFF_HZ):
        if not (isinstance(cutoff_hz, int | float) and 0 <= cutoff_hz <= 1e4):
            raise UsageError(f"--cutoff {cutoff_hz}: expected from 0 to 10000 Hz, such as 1")
        self.contrast, self.per_us = contrast, 2e-6 * math.pi * cutoff_hz
        self._level = np.zeros(size[::-1], np.float64)
        self._last_us = np.zeros(size[::-1], np.int64)

    def add(self, events: Events, start_us: int, stop_us: int, worth: np.ndarray | None = None) -> None:
        """See `Reconstructor`."""
        columns = events.t, events.x, events.y, events.p
        _add(*columns, worth, self._level, self._last_us, self.per_us, -self.contrast[0], self.contrast[1])

    def picture(self, stop_us: int) -> np.ndarray:
        """Light [H, W] float32 at an instant that is not before the last event."""
        level = self._level * np.exp(-self.per_us * np.maximum(stop_us - self._last_us, 0))
        return (GREY * np.exp(np.clip(level, -BRIGHTEST_NATS, BRIGHTEST_NATS))).astype(np.float32)

    def memory(self) -> dict[str, np.ndarray]:
        """All that it knows."""
        return {"level": self._level.copy(), "last_us": self._last_us.copy()}

    def remember(self, memory: dict[str, np.ndarray]) -> None:
        """Take that up."""
        self._level[...], self._last_us[...] = memory["level"], memory["last_us"]


@cached
def _add(t, x, y, p, worth, level, last_us, per_us, off, on):  # type: ignore[no-untyped-def]
    for k in range(t.size):
        i, j = y[k], x[k]
        if level[i, j] != 0:  # (before its first event a pixel has no time to decay from)
            level[i, j] *= np.exp(-per_us * (t[k] - last_us[i, j]))
        level[i, j] += (on if p[k] > 0 else off) * (1.0 if worth is None else worth[k])
        last_us[i, j] = t[k]
