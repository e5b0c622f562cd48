"""Events: what an event camera sends.

Conventions, valid everywhere in vid2ev:

* `t` is int64 microseconds on the clock of the source; events are ordered by (t, y, x), and events of one pixel
  within one microsecond keep their true order.
* An event of the interval between two frames lies in (t0, t1]: after the earlier frame, not after the later one.
* `p` is 1 for ON (brighter) and 0 for OFF.
* `label` says why an event was sent (`Label`), and is there only on request.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class Label(IntEnum):
    """Why an event was sent; LEAK: ON, and the leak since the pixel's last crossing is half a threshold or more."""

    SIGNAL = 0
    SHOT = 1
    LEAK = 2
    HOT = 3


@dataclass(frozen=True, slots=True)
class Events:
    """N events as four arrays of length N: t int64 [us], x uint16, y uint16, p uint8; label uint8 or None."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray
    p: np.ndarray
    label: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.t)

    @staticmethod
    def empty(labelled: bool = False) -> Events:
        """No events."""
        pixel = np.empty(0, np.uint16)
        polarity = np.empty(0, np.uint8)
        return Events(np.empty(0, np.int64), pixel, pixel, polarity, polarity if labelled else None)

    @staticmethod
    def concatenate(parts: Iterable[Events]) -> Events:
        """The parts one after the other; they must be in order of time already."""
        parts = list(parts)
        kept = [part for part in parts if len(part)]
        if len(kept) <= 1:
            return kept[0] if kept else Events.empty(any(part.label is not None for part in parts))
        labelled = all(part.label is not None for part in kept)
        return Events(
            np.concatenate([part.t for part in kept]),
            np.concatenate([part.x for part in kept]),
            np.concatenate([part.y for part in kept]),
            np.concatenate([part.p for part in kept]),
            np.concatenate([part.label for part in kept]) if labelled else None,  # type: ignore[misc]
        )

    def stretch(self, first: int, last: int) -> Events:
        """The events number first ... last - 1; no copy."""
        if first == 0 and last == len(self):
            return self
        part = slice(first, last)
        label = None if self.label is None else self.label[part]
        return Events(self.t[part], self.x[part], self.y[part], self.p[part], label)

    def select(self, mask: np.ndarray) -> Events:
        """The events at a boolean mask or an index array."""
        label = None if self.label is None else self.label[mask]
        return Events(self.t[mask], self.x[mask], self.y[mask], self.p[mask], label)


def check_within(events: Events, size: tuple[int, int]) -> None:
    """Raise ValueError for events outside of a sensor, or in arrays of other lengths: compiled code does not look."""
    lengths = [len(each) for each in (events.t, events.x, events.y, events.p)]
    if len(set(lengths)) > 1:
        raise ValueError(
            f"events with t, x, y, p of lengths {lengths}: expected one length; select the same events of each"
        )
    x, y = events.x, events.y
    if len(events) and (x.max() >= size[0] or y.max() >= size[1] or min(x.min(), y.min()) < 0):
        raise ValueError(f"events outside of the {size[0]}x{size[1]} sensor")
