"""What is scored: sequences of groups, each of two key frames and the true frames between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from interp.evaluate import protocol as protocols
from interp.representation.event_counts import EventCounts


class Cameras(NamedTuple):
    """What is known of the cameras; NaN where it is not.

    exposure_us    of the key frames, in the mean
    disparity_px   mean disparity between frame and event camera [px of the frames]
    offset_us      by how much the events' clock is late
    """

    exposure_us: float = math.nan
    disparity_px: float = math.nan
    offset_us: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Two key frames and what lies between them.

    number     of the group in its sequence
    first      number of its first key frame among the frames of the sequence
    keys       the key frames, codes uint8 [2, H, W, 3]
    positions  places of the frames to score, 1 ... skip
    truth      these frames, likewise [N, H, W, 3]
    times_us   times of all its frames, int64 [skip + 2]
    events     between the key frames
    cameras    what is known of the cameras
    curve      the transfer curve of the codes
    """

    number: int
    first: int
    keys: np.ndarray
    positions: tuple[int, ...]
    truth: np.ndarray
    times_us: np.ndarray
    events: EventCounts
    cameras: Cameras
    curve: str = "srgb"

    @property
    def gap_us(self) -> int:
        """From the first key frame to the second."""
        return int(self.times_us[-1] - self.times_us[0])


class Footage(Protocol):
    """A sequence to be scored.

    name        by which it is called, and its files
    called      what folders of others' pictures of it may be called, the likeliest first
    expected    number of groups, for progress; may be an estimate
    begin       the first key frame
    protocol    which frames are rebuilt
    limit       gaps that are scored, from the first on; None for all
    identity    what tells it from another, ready for JSON
    """

    name: str
    called: tuple[str, ...]
    expected: int
    begin: int
    protocol: protocols.Protocol
    limit: int | None
    identity: dict[str, Any]

    @property
    def frames(self) -> int:
        """How many it has, key frames included."""

    @property
    def numbers(self) -> Sequence[int]:
        """Those that the names of its own pictures end in, one for each frame; none where there are none."""

    def groups(self) -> Iterator[Group]:
        """Its groups, in order, those that can be scored; again from the start each time."""

    def about(self) -> dict[str, Any]:
        """What is known of it after `groups`, ready for JSON: `frames`, `groups`, `not_scored` (reason and number),
        `remarks` (sentences), and facts of its kind."""
