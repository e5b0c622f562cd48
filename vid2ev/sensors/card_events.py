"""Events of some clips on a GPU: keys in order, and what they say, without a copy to the host."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.kernels.layout import Interval
from vid2ev.stream.events import Events

PIXEL_BITS, KEY_BITS = 28, 63


class Moments:
    """The microseconds of the intervals [clips, frames] of some clips, one after the other, so that no two are alike.

    The k-th microsecond of an interval is the moment `begins` + k.
    """

    def __init__(self, intervals: list[list[Interval]]):
        last_us = np.array([[iv.last_us for iv in row] for row in intervals], np.int64)
        ends = np.cumsum(last_us, axis=1)
        self._bits = int(ends[:, -1].max()).bit_length()
        if self._bits + (len(intervals) - 1).bit_length() + PIXEL_BITS > KEY_BITS:
            longest = int(ends[:, -1].max())
            raise UsageError(f"{len(intervals)} clips of {longest} us at a time: expected fewer clips or frames")
        self.begins = ends - last_us + (np.arange(len(intervals))[:, None] << self._bits)
        self.first_us = np.array([[iv.first_us for iv in row] for row in intervals], np.int64)

    def bases(self) -> np.ndarray:
        """What is added to the keys of each interval, uint64 [clips, frames]."""
        return self.begins.astype(np.uint64) << np.uint64(PIXEL_BITS)


@dataclass(frozen=True)
class CardSent:
    """Events of some clips in no order but that of each pixel: arrays of the device, int64."""

    clip: Any
    t: Any  # [us]
    pixel: Any  # row x width + column
    p: Any


def sent_of(memory: Any, keys: Any, moments: Moments) -> CardSent:
    """What keys (int64) say, in any order."""
    moment = keys >> PIXEL_BITS
    interval = memory.searchsorted(memory.put(moments.begins.reshape(-1)), moment) - 1
    clip = interval // moments.begins.shape[1]
    offset = memory.put((moments.first_us - moments.begins).reshape(-1))
    return CardSent(clip, moment + offset[interval], (keys >> 3) & ((1 << 25) - 1), (keys >> 2) & 1)


@dataclass(frozen=True)
class CardEvents:
    """Events of some intervals of some clips, in order of clip, interval and (t, y, x): arrays of the device.

    `ends` [clips x frames + 1, host] is where those of each interval begin and end.
    """

    t: Any  # int64 [us]
    x: Any  # int32
    y: Any
    p: Any  # uint8
    label: Any  # uint8, or None
    ends: np.ndarray
    frames: int
    memory: Any

    def of(self, clip: int) -> list[Events]:
        """Those of each interval of a clip, on the host."""
        ends = self.ends[clip * self.frames : (clip + 1) * self.frames + 1]
        part, get = slice(int(ends[0]), int(ends[-1])), self.memory.get
        x, y = get(self.x[part]).astype(np.uint16), get(self.y[part]).astype(np.uint16)
        label = get(self.label[part]) if self.label is not None else None
        events = Events(get(self.t[part]), x, y, get(self.p[part]), label)
        return [events.stretch(*each) for each in pairwise((ends - ends[0]).tolist())]

    def __len__(self) -> int:
        return len(self.t)


def events_of(memory: Any, keys: Any, moments: Moments, width: int, labels: bool) -> CardEvents:
    """What ordered keys (int64) say."""
    sent = sent_of(memory, keys, moments)
    y = sent.pixel // width
    ends = memory.get(memory.searchsorted(keys >> PIXEL_BITS, memory.put(moments.begins.reshape(-1) + 1)))
    return CardEvents(
        sent.t,
        memory.cast(sent.pixel - y * width, np.int32),
        memory.cast(y, np.int32),
        memory.cast(sent.p, np.uint8),
        memory.cast(keys & 3, np.uint8) if labels else None,
        np.append(ends, len(keys)),
        moments.begins.shape[1],
        memory,
    )
