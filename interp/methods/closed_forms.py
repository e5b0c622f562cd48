"""Methods that need no training: blends of the key frames, and integrals of the events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import torch

from interp.candidates.guided import guided
from interp.candidates.ramps import in_doubt, ramps, risen
from interp.methods.gap import Gap
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts
from vid2ev.errors import UsageError

AT_ONCE_PX = 1 << 22  # pixels of images that are made at a time: some 100 bytes each
ROUNDS = 2  # of guiding, where events are coarse
Law = Callable[[Gap, torch.Tensor], torch.Tensor]
Form = Callable[[torch.Tensor, torch.Tensor, EventCounts, torch.Tensor], torch.Tensor]


@dataclass(frozen=True, slots=True)
class ClosedForm:
    """A law that looks at one gap alone."""

    name: str
    law: Law
    needs_events: bool = True
    sequential: bool = False

    def begin(self) -> Self:
        """Itself."""
        return self

    def between(self, gap: Gap, times: torch.Tensor) -> torch.Tensor:
        """See `interp.methods.gap.Method`."""
        if self.needs_events and gap.events is None:
            raise UsageError(f"method '{self.name}' integrates events, and there are none; choose flow or linear")
        return self.law(gap, times)


def nearest(gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """The nearer key frame; halfway the first."""
    return torch.where(times[:, None, None, None] > 0.5, gap.frame_1, gap.frame_0)


def linear(gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """A blend of the codes of both."""
    return gap.frame_0 + times[:, None, None, None] * (gap.frame_1 - gap.frame_0)


def of_events(form: Form) -> Law:
    """Integration of events: a form of `interp.candidates`, some images at a time."""

    def law(gap: Gap, times: torch.Tensor) -> torch.Tensor:
        assert gap.events is not None
        height, width = gap.frame_0.shape[-2:]
        events = over(gap.events, (height, width))
        some = max(1, AT_ONCE_PX // (height * width))
        frames = gap.frame_0[None], gap.frame_1[None]
        return torch.cat([form(*frames, events, part[None])[0] for part in times.split(some)])

    return law


def guided_by_ramps(
    frame_0: torch.Tensor, frame_1: torch.Tensor, events: EventCounts, times: torch.Tensor
) -> torch.Tensor:
    """Ramps in the colours of carried frames, mixed with these as either is in doubt (`candidates.guided`)."""
    found = risen(events, times)
    pictures = ramps(frame_0, frame_1, events, times, found=found)
    doubt = in_doubt(frame_0, frame_1, found, times)
    images = pictures
    for _ in range(1 if events.footprint == 1 else ROUNDS):
        carried = guided(frame_0, frame_1, pictures, footprint=events.footprint, like=images)
        images = carried.image(pictures, doubt, times)
    return images
