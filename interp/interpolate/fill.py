"""Frames for the instants of a stretch: key frames as they are, what is between them by a method.

    a cut                        the nearer key frame
    unrelated pictures           the same, unless the method has events to go by
    events that are not known    `fallback`, which needs none; what remembers begins anew after them

Events are read gap by gap, so that memory does not grow with the length of a recording.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from math import ceil
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch

from interp.candidates.calibrated import calibrated
from interp.interpolate.instants import Instant
from interp.interpolate.memory import as_arrays, nested
from interp.interpolate.stretches import CUT, UNRELATED, Stretch
from interp.interpolate.take import Key, Take
from interp.methods import Gap, Method
from interp.methods.tiling import Tiling
from interp.representation.event_counts import EventCounts, count_events

FEWEST, MOST = 32, 128  # sub-intervals in which events are counted
NO_EVENTS = "events that are not known"


@runtime_checkable
class Remembering(Protocol):
    """A method whose images depend on the gaps before, by its states alone: nested tuples of tensors."""

    states: Any


@dataclass(frozen=True, slots=True)
class Filled:
    """A frame: sRGB codes float32 [H, W, C], not clipped.

    key    whether it is a key frame, as it came
    shot   how many cuts there were before it
    light  that of a key frame, where it is known better than by its codes
    """

    instant: Instant
    key: bool
    shot: int
    codes: np.ndarray = field(repr=False)
    light: np.ndarray | None = field(default=None, repr=False)


@dataclass(frozen=True, slots=True)
class Work:
    """The frames of a stretch, in order of time, to be taken once.

    first    the key frame that it begins with, whether or not it is one of the frames
    shot     how many cuts there were before that
    remark   why the method was not asked; empty if it was
    events   what the events of the stretch say, where anybody asks for them and they are known
    """

    frames: Iterator[Filled]
    first: Key
    shot: int
    remark: str = ""
    events: EventCounts | None = None


@dataclass(slots=True)
class Fill:
    """Makes the frames of a take's stretches, which come in their order.

    multiple   how many frames the grid has to a key frame
    events   whether somebody else needs the events, too
    shot     how many cuts there were
    """

    take: Take
    method: Method
    fallback: Method
    tiling: Tiling
    multiple: Fraction
    device: torch.device | str = "cpu"
    events: bool = False
    shot: int = 0

    def fill(self, stretch: Stretch) -> Work:
        """The frames of a stretch."""
        shot = self.shot
        if stretch.between == CUT:
            self.shot += 1
            self.method = self.method.begin()  # (what it remembers is of another shot)
        asked = any(instant.share or not stretch.first.known for instant in stretch.instants)
        held = stretch.between == CUT or (stretch.between == UNRELATED and not self.method.needs_events)
        remark = stretch.between * (held and asked)
        looked_at = self.events or ((asked or self.method.sequential) and not held)
        if stretch.second is None or stretch.between == CUT or not looked_at:
            return Work(self._held(stretch, shot), stretch.first, shot, remark)
        gap = self._gap(stretch, stretch.second)
        events = gap.events if self.events else None
        unknown = self.method.needs_events and gap.events is None
        if held or (unknown and stretch.between == UNRELATED):
            return Work(self._held(stretch, shot), stretch.first, shot, stretch.between * asked, events)
        method = self.fallback if unknown else self.method
        self.method = self.method.begin() if unknown else self.method
        made = self._made(stretch, gap, method, shot)
        return Work(made, stretch.first, shot, NO_EVENTS * (asked and unknown), events)

    def memory(self) -> dict[str, np.ndarray]:
        """What the method has to remember of the stretches so far."""
        return as_arrays((self.method.states,)) if isinstance(self.method, Remembering) else {}

    def remember(self, arrays: dict[str, np.ndarray]) -> None:
        """Take that up."""
        if arrays and isinstance(self.method, Remembering):
            (self.method.states,) = nested(arrays, self.device)

    def _made(self, stretch: Stretch, gap: Gap, method: Method, shot: int) -> Iterator[Filled]:
        instants = [instant for instant in stretch.instants if instant.share or not stretch.first.known]
        if len(instants) < len(stretch.instants):
            yield Filled(stretch.instants[0], True, shot, stretch.first.codes, stretch.first.light)
        times = torch.tensor([float(instant.share) for instant in instants], device=self.device)
        coming = iter(instants)
        for images in method.images(gap, times, self.tiling):
            pictures = images.movedim(1, -1).cpu().numpy()
            # (each for itself: all of them are not to be kept with the last one while others are made)
            yield from (Filled(next(coming), False, shot, np.ascontiguousarray(picture)) for picture in pictures)
            del images, pictures

    def _held(self, stretch: Stretch, shot: int) -> Iterator[Filled]:
        """The nearer key frames."""
        for instant in stretch.instants:
            later = stretch.second is not None and 2 * instant.share > 1
            nearer = stretch.second if later and stretch.second is not None else stretch.first
            its_shot = shot + (later and stretch.between == CUT)
            yield Filled(instant, not instant.share, its_shot, nearer.codes, nearer.light)

    def _gap(self, stretch: Stretch, second: Key) -> Gap:
        frames = [_tensor(key).to(self.device) for key in (stretch.first, second)]
        return Gap(frames[0], frames[1], self._counts(stretch.first, second, frames))

    def _counts(self, first: Key, second: Key, frames: list[torch.Tensor]) -> EventCounts | None:
        """What the events between two key frames say; None where they are not needed, or not known."""
        size = self.take.event_size
        if not (self.method.needs_events or self.events) or size is None:
            return None
        events = self.take.events(first.t_us, second.t_us)
        if events is None:
            return None
        steps, dead_time = steps_for(self.multiple), self.take.dead_time
        counts = count_events(events, size, first.t_us, second.t_us, steps, dead_time=dead_time).to(self.device)
        looks = self.take.looks((first.t_us + second.t_us) // 2)
        return calibrated(frames, counts, self.take.contrast, self.take.apart, looks)


def steps_for(multiple: Fraction) -> int:
    """In how many sub-intervals events are counted, of so many frames to a key frame: so that all frames lie at the
    ends of some, or where that takes more than MOST and they are a whole number, as many as do."""
    parts = multiple.numerator  # (frames lie at whole parts of so many: 2 and 4 fifths, then 1 and 3, of 5/2)
    if parts <= MOST:
        return parts * ceil(FEWEST / parts)
    if multiple.denominator > 1:
        return 2 * FEWEST
    return max((steps for steps in range(FEWEST, MOST + 1) if parts % steps == 0), default=MOST)


def _tensor(key: Key) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(key.codes, -1, 0)))
