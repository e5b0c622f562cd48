"""Time surfaces: how long ago a pixel sent its last event.

    T_p(x, y)       instant of the newest event of polarity p at (x, y) that is not after the end t of the slice
    sae[p, y, x]    = T_p, `NEVER` where there was none                  int64 [2, height, width], microseconds
    S_p(x, y; t)    = exp(-(t - T_p) / tau), 0 where there was none      float32 [2, height, width], 0 ... 1

Pixels remember their last event over all slices since the start of the recording.  The first is the surface of active
events of Benosman et al. (2014), "Event-based visual flow", IEEE TNNLS 25(2), in integers so that late times stay
exact.  The second is that of Lagorce et al. (2017), "HOTS: a hierarchy of event-based time-surfaces for pattern
recognition", IEEE TPAMI 39(7), for all pixels at the end of the slice instead of around each event.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.compiling.cache import cached
from vid2ev.pictures.colours import GROUND, OFF, ON, in_8_bits
from vid2ev.stream.events import Events, check_within

NEVER = np.iinfo(np.int64).min
TAU_US = 30_000.0


class ActiveEvents:
    """The surface of active events, in microseconds; seen as a time surface of 30 ms."""

    tiles = (1, 1)
    dtype: np.dtype[Any] = np.dtype(np.int64)
    tau_us = TAU_US

    def __init__(self, size: tuple[int, int]):
        self.size = size
        self.shape: tuple[int, ...] = (2, size[1], size[0])
        self._newest = np.full(self.shape, NEVER, np.int64)

    def add(self, events: Events, start_us: int = 0, stop_us: int = 0) -> None:
        """Take in events in order of time."""
        check_within(events, self.size)
        _stamp(events.t, events.x, events.y, events.p, self._newest)

    def take(self, stop_us: int) -> np.ndarray:
        """The surface so far."""
        return self._newest.copy()

    def picture(self, array: np.ndarray) -> np.ndarray:
        """As that of the time surface at the newest event."""
        return _picture(decayed(array, int(array.max()), self.tau_us))


class TimeSurface(ActiveEvents):
    """The exponentially decaying time surface at the end of a slice; brighter is newer, in the colour of the newer."""

    dtype: np.dtype[Any] = np.dtype(np.float32)

    def __init__(self, size: tuple[int, int], tau_us: float = TAU_US):
        super().__init__(size)
        self.tau_us = tau_us

    def take(self, stop_us: int) -> np.ndarray:
        """The surface at an instant [us]."""
        return decayed(self._newest, stop_us, self.tau_us)

    def picture(self, array: np.ndarray) -> np.ndarray:
        """The newer polarity in its colour, the fainter the longer ago."""
        return _picture(array)


def decayed(sae: np.ndarray, t_us: int, tau_us: float) -> np.ndarray:
    """The time surface at an instant [us], float32, of a surface of active events; later events count as at it."""
    return _decayed(sae.ravel(), t_us, tau_us).reshape(sae.shape)


def _picture(surface: np.ndarray) -> np.ndarray:
    off, on = np.rint(255 * surface).astype(np.uint8)
    return COLOURS[(on >= off).astype(np.uint8), np.maximum(on, off)]


@cached
def _stamp(t, x, y, p, newest):  # type: ignore[no-untyped-def]
    for i in range(len(t)):
        newest[min(p[i], 1), y[i], x[i]] = t[i]


@cached
def _decayed(newest, t_us, tau_us):  # type: ignore[no-untyped-def]
    surface = np.zeros(len(newest), np.float32)
    for i in range(len(newest)):
        if newest[i] != NEVER:
            surface[i] = np.exp(-max(t_us - newest[i], 0) / tau_us)
    return surface


def _colours() -> np.ndarray:
    """[polarity, age, 3]"""
    level = np.arange(256)[:, None] / 255
    return np.stack([in_8_bits(GROUND + level * (colour - GROUND)) for colour in (OFF, ON)])


COLOURS = _colours()
