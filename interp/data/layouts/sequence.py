"""Sequences: frames and events of one recording on disk, whatever its layout."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from interp.representation.dead_time import DeadTime, look_back_us
from vid2ev import Events

if TYPE_CHECKING:
    from interp.representation.carried import Look

NO_LATER = "times of the frames do not increase"
EVEN = 0.25  # of a step, that a frame may be off its place; where one is lost, some are off by 0.4 or more


class Placed(NamedTuple):
    """Events at places between pixels: t int64 [us] in order, x and y float32 [px], p 1 for ON and 0 for OFF, uint8."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    p: np.ndarray

    def within(self, size: tuple[int, int]) -> tuple[Events, int]:
        """Those that fall into pixels of a sensor, each in the nearest, and how many others there are."""
        x, y = np.floor(self.x + np.float32(0.5)), np.floor(self.y + np.float32(0.5))
        inside = (x >= 0) & (x < size[0]) & (y >= 0) & (y < size[1])
        kept = Events(self.t[inside], x[inside].astype(np.uint16), y[inside].astype(np.uint16), self.p[inside])
        return kept, len(inside) - len(kept)

    def part(self, left: int, top: int, width: int, height: int) -> tuple[Events, int]:
        """The same of a part of a sensor, whose pixels count from its own corner."""
        return self._replace(x=self.x - np.float32(left), y=self.y - np.float32(top)).within((width, height))


class Sequence(Protocol):
    """Frames and events on one clock.

    name         of its folder
    folder       where it is
    size         width and height of the frames [px]
    event_size   the same of the event camera
    curve        the transfer curve of the codes of its frames
    times_us     when the frames were taken, int64; not always increasing in files of the field
    contrast     what an OFF and an ON event stand for [nat]; None where nobody knows
    dead_time    how long a pixel is blind after an event; None where nobody knows
    apart        whether the event camera stands elsewhere than the frame camera, or sees through another lens
    remarks      what cannot be used, with numbers, one sentence each; more may come while events are read
    """

    name: str
    folder: Path
    size: tuple[int, int]
    event_size: tuple[int, int]
    curve: str
    times_us: np.ndarray
    contrast: tuple[float, float] | None
    dead_time: DeadTime | None
    apart: bool
    remarks: list[str]

    @property
    def covered_us(self) -> tuple[int, int]:
        """The first and the last instant of which events are known; the same where there are none."""

    @property
    def unknown_us(self) -> list[tuple[int, int]]:
        """Stretches of that time of which events are not known, as their file is missing or cannot be read."""

    def frame(self, k: int) -> np.ndarray:
        """Frame k, codes uint8 [H, W, 3].  Raises DataError."""

    def key(self, k: int) -> np.ndarray:
        """Frame k as a frame camera gave it that is not as fast as the frames; frame k where there is no such camera.
        Raises DataError."""

    def looks(self, t_us: int) -> tuple[Look, ...]:
        """Where pixels of a frame may look in the event camera, as far as is known.  Raises DataError."""

    def events(self, start_us: int, stop_us: int) -> Placed:
        """The events in (start_us, stop_us].  Raises DataError for files that cannot be read."""


def matter_from_us(sequence: Sequence, start_us: int, dead_time: DeadTime | None) -> int:
    """From where on events matter to what those after an instant stand for, as far as they are known."""
    known_us = [sequence.covered_us[0], *(until for _, until in sequence.unknown_us if until <= start_us)]
    return min(start_us, max(start_us - look_back_us(dead_time), *known_us))


@dataclass(frozen=True)
class Windows:
    """Where a sequence has a frame, `multiple - 1` to rebuild, and a frame, with events all the way.

    first     indices of the first frames, int64
    unusable  why other indices are none: reason and number
    """

    first: np.ndarray
    unusable: dict[str, int]


def windows(sequence: Sequence, multiple: int, every: int = 1, begin: int = 0, even: bool = False) -> Windows:
    """The windows of a sequence that begin with each `every`-th frame from frame `begin` on.

    even   for those who take frames to be even in time: none where one is off, as around a lost one
    """
    times = sequence.times_us
    since, end = sequence.covered_us
    good, unusable = [], dict[str, int]()
    for k in range(begin, len(times) - multiple, every):
        part = times[k : k + multiple + 1]
        if (np.diff(part) <= 0).any():
            reason = NO_LATER
        elif even and not _are_even(part):
            reason = "the frames are not even in time, as where some are lost"
        elif part[-1] > end:
            reason = "the events end before the last frame"
        elif part[0] < since:
            reason = "the events begin after the first frame"
        elif any(from_us < part[-1] and until_us > part[0] for from_us, until_us in sequence.unknown_us):
            reason = "a file of events is missing or cannot be read"
        else:
            good.append(k)
            continue
        unusable[reason] = unusable.get(reason, 0) + 1
    return Windows(np.array(good, np.int64), unusable)


def _are_even(times_us: np.ndarray) -> bool:
    """Whether frames are where they would be if they were even in time between the first and the last."""
    places = (times_us - times_us[0]) / (times_us[-1] - times_us[0]) * (len(times_us) - 1)
    return bool(np.abs(places - np.arange(len(times_us))).max() <= EVEN)
