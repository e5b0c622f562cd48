"""Methods that need no training: blends of the key frames, and integrals of the events.

Large frames are made in cells, so that memory is bounded, and become what they do at once: motion is sought in whole
frames, and what is carried comes from anywhere in them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

import torch

from interp.candidates.alone import alone, between
from interp.candidates.bridge import highest_of
from interp.candidates.guided import SEES_PX
from interp.candidates.ramps import in_doubt, ramps, risen
from interp.candidates.sight import Sight
from interp.light import Transfer
from interp.methods.gap import Gap, Together
from interp.methods.tiling import Tile, Tiling, part, strips, undivided
from interp.representation.carried import footprint_over
from interp.representation.event_counts import EventCounts
from vid2ev.errors import UsageError

AT_ONCE_PX = 1 << 22  # pixels of images that are made at a time: some 100 bytes each
Law = Callable[[Gap, torch.Tensor, Tiling], Iterator[torch.Tensor]]
Form = Callable[..., torch.Tensor]  # (frame_0, frame_1, events, times, highest=)


@dataclass(frozen=True, slots=True)
class ClosedForm(Together):
    """A law that looks at one gap alone.

    in_tiles   whether its images are made in the tiles that are asked for: others are whole, or in strips of their own
    """

    name: str
    law: Law
    needs_events: bool = True
    sequential: bool = False
    in_tiles: bool = False

    def begin(self) -> Self:
        """Itself."""
        return self

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """See `interp.methods.gap.Method`."""
        if self.needs_events and gap.events is None:
            raise UsageError(f"method '{self.name}' integrates events, and there are none; choose flow or linear")
        height, width = gap.frame_0.shape[-2:]
        return self.law(gap, times, tiling or undivided(width, height))


def nearest(gap: Gap, times: torch.Tensor, tiling: Tiling) -> Iterator[torch.Tensor]:
    """The nearer key frame; halfway the first."""
    return ((gap.frame_1 if time > 0.5 else gap.frame_0)[None] for time in times.tolist())


def linear(gap: Gap, times: torch.Tensor, tiling: Tiling) -> Iterator[torch.Tensor]:
    """A blend of the codes of both."""
    return ((time * (gap.frame_1 - gap.frame_0)).add_(gap.frame_0)[None] for time in times)


def flow(gap: Gap, times: torch.Tensor, tiling: Tiling) -> Iterator[torch.Tensor]:
    """Light carried along the motion between both: DIS, forwards and backwards."""
    return between(gap.frame_0, gap.frame_1, times)


def of_events(form: Form) -> Law:
    """Integration of events, pixel by pixel: a form of `interp.candidates`, some images at a time."""

    def law(gap: Gap, times: torch.Tensor, tiling: Tiling) -> Iterator[torch.Tensor]:
        return (_in_strips(form, gap, some) for some in _some(gap, times))

    return law


def guided_by_ramps(gap: Gap, times: torch.Tensor, tiling: Tiling) -> Iterator[torch.Tensor]:
    """Ramps in the colours of carried frames, mixed with these as either is in doubt (`candidates.guided`)."""
    return (_guided(gap, some, tiling) for some in _some(gap, times))


def _guided(gap: Gap, times: torch.Tensor, tiling: Tiling) -> torch.Tensor:
    assert gap.events is not None
    frames, seen = _frames(gap), _in_strips(ramps_and_doubt, gap, times)[None]
    by_themselves, footprint = alone(*frames, times[None]), footprint_over(gap.events, tiling.size)
    sight = Sight(frames, seen[:, :, :-1], seen[:, :, -1:], by_themselves, times[None], footprint)
    image = in_cells(sight, tiling)
    return image(sight.motion(image))[0]


def in_cells(sight: Sight, tiling: Tiling) -> Callable[[torch.Tensor], torch.Tensor]:
    """What makes images of motion, cell by cell."""

    def image(flows: torch.Tensor) -> torch.Tensor:
        return tiling.cells(lambda tile: sight.image(flows, tile.within), SEES_PX * sight.footprint)

    return image


def ramps_and_doubt(
    frame_0: torch.Tensor,
    frame_1: torch.Tensor,
    events: EventCounts,
    times: torch.Tensor,
    highest: torch.Tensor,
    transfer: Transfer = "srgb",
) -> torch.Tensor:
    """Both, one channel after the other, [B, N, C + 1, H, W]."""
    found = risen(events, times)
    pictures = ramps(frame_0, frame_1, events, times, transfer, found=found, highest=highest)
    return torch.cat([pictures, in_doubt(frame_0, frame_1, found, times, transfer)], 2)


def _in_strips(form: Form, gap: Gap, times: torch.Tensor) -> torch.Tensor:
    """Images [N, C, H, W] of a form that looks at pixels alone: in any tiles the same, so in small ones."""
    highest = highest_of(*_frames(gap))

    def law(strip: Tile) -> torch.Tensor:
        seen = part(gap, strip)
        assert seen.events is not None
        return form(*_frames(seen), seen.events, times[None], highest=highest)[0]

    height, width = gap.frame_0.shape[-2:]
    return strips(width, height).cells(law)


def _frames(gap: Gap) -> tuple[torch.Tensor, torch.Tensor]:
    return gap.frame_0[None], gap.frame_1[None]


def _some(gap: Gap, times: torch.Tensor) -> tuple[torch.Tensor, ...]:
    return times.split(max(1, AT_ONCE_PX // gap.frame_0[0].numel())) if len(times) else ()
