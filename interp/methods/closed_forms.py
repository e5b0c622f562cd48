"""Methods that need no training: blends of the key frames, and integrals of the events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import torch

from interp.candidates.bridge import Method as Way
from interp.candidates.bridge import bridge
from interp.candidates.guided import guided
from interp.candidates.ramps import ramps
from interp.methods.gap import Gap
from interp.representation.carried import over
from vid2ev.errors import UsageError

AT_ONCE_PX = 1 << 22  # pixels of images that are made at a time: some 100 bytes each
Law = Callable[[Gap, torch.Tensor], torch.Tensor]


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


def of_ramps(gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """Integration of events, as `candidates.ramps` does it."""
    assert gap.events is not None
    height, width = gap.frame_0.shape[-2:]
    return ramps(gap.frame_0[None], gap.frame_1[None], over(gap.events, (height, width)), times[None])[0]


def of_guided(gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """Integration in the colours of carried frames, half and half with these where they agree (`candidates.guided`)."""
    pictures = of_ramps(gap, times)[None]
    return guided(gap.frame_0[None], gap.frame_1[None], pictures).image(pictures, times[None])[0]


def of_events(way: Way) -> Law:
    """Integration of events, as `candidates.bridge` does it."""

    def law(gap: Gap, times: torch.Tensor) -> torch.Tensor:
        assert gap.events is not None
        height, width = gap.frame_0.shape[-2:]
        events = over(gap.events, (height, width))
        some = max(1, AT_ONCE_PX // (height * width))
        frames = gap.frame_0[None], gap.frame_1[None]
        return torch.cat([bridge(*frames, events, part[None], method=way)[0] for part in times.split(some)])

    return law
