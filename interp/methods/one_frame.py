"""Frames from a single frame and the events around it: what one frame and an event camera know of a scene.

    deblur        the frame is the mean of the light over all of the gap, as a long exposure is:
                  I(t) = B exp(E(0 -> t)) / mean_u exp(E(0 -> u))        u over the gap, in `steps` of the counts
    integration   the frame is the light at the middle of the gap:      I(t) = B exp(E(1/2 -> t))

E is the change of log light that the events stand for; colours are those of the frame.  There is no second frame that
would hold the drift, so noise of events and a contrast that is not quite right stay in the picture; and where light
goes below the sensor's black or above white, B is wrong.

Source: L. Pan et al., "Bringing a blurry frame alive at high frame-rate with an event camera", CVPR 2019, eq. 7 (the
event-based double integral).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Literal, Self

import torch

from interp.candidates.bridge import DARK, DARKEST, coloured, highest_of, ratios_of
from interp.light import luminance, to_codes, to_light
from interp.methods.gap import Gap, Together
from interp.methods.tiling import Tiling
from interp.precision import in_full_precision
from interp.representation.carried import over
from interp.representation.event_counts import EventCounts
from vid2ev.errors import UsageError

WAYS = ("deblur", "integration")


@dataclass(frozen=True, slots=True)
class OneFrame(Together):
    """A method that looks at a gap's first frame alone."""

    name: Literal["deblur", "integration"]
    needs_events: bool = True
    sequential: bool = False

    def begin(self) -> Self:
        """Itself."""
        return self

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """See `interp.methods.gap.Method`.  Raises UsageError without events."""
        if gap.events is None:
            raise UsageError(f"method '{self.name}' integrates events, and there are none; give some with --events")
        height, width = gap.frame_0.shape[-2:]
        light, events = to_light(gap.frame_0, "srgb"), over(gap.events, (height, width))
        logs = _beginning(light, events, self.name == "deblur")
        highest = float(highest_of(gap.frame_0[None], gap.frame_0[None]))
        return (_integrated(light, logs, events, time[None], highest)[None] for time in times)


@in_full_precision
def _beginning(light: torch.Tensor, events: EventCounts, blurred: bool) -> torch.Tensor:
    """Log of light [1, H, W] at the beginning, of that of a frame [C, H, W]."""
    logs = torch.log(luminance(light) + DARK)
    if not blurred:
        return logs - _risen(events, light.new_full((1,), 0.5))
    middles = (torch.arange(events.steps, device=light.device) + 0.5) / events.steps
    # (a pixel that is stuck rises by more than float32 has powers for)
    risen = reduce(torch.logaddexp, (_risen(events, u[None]) for u in middles))
    return logs - risen + math.log(events.steps)


@in_full_precision
def _integrated(
    light: torch.Tensor, logs: torch.Tensor, events: EventCounts, time: torch.Tensor, highest: float
) -> torch.Tensor:
    """Codes [C, H, W] at a time [1], in the colours of a frame's light, from the logs of light at the beginning."""
    level = (logs + _risen(events, time)).clamp(DARKEST, highest)
    return to_codes(coloured((torch.exp(level) - DARK).clamp(min=0), ratios_of(light)), "srgb")


def _risen(events: EventCounts, until: torch.Tensor) -> torch.Tensor:
    """The change of log light [1, H, W] from the beginning to a time [1]."""
    return events.change(torch.zeros_like(until)[None], until[None])[0]
