"""Two key frames and what the events say of the time between them; and what makes frames of that."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

import torch

from interp.representation.event_counts import EventCounts

if TYPE_CHECKING:
    from interp.methods.tiling import Tiling


@dataclass(frozen=True, slots=True)
class Gap:
    """The time between two key frames.

    frame_0, frame_1   [C, H, W] sRGB codes, 0 ... 1, float32; C is 1 or 3
    events             between them, B = 1; of any resolution, laid over the frames edge on edge; those of a camera
                       that stands elsewhere are brought there before (`candidates.calibrated`); None where unknown
    """

    frame_0: torch.Tensor
    frame_1: torch.Tensor
    events: EventCounts | None


class Method(Protocol):
    """What rebuilds frames."""

    @property
    def name(self) -> str:
        """For tables and files."""

    @property
    def needs_events(self) -> bool:
        """Whether gaps must have events."""

    @property
    def sequential(self) -> bool:
        """Whether what it makes depends on the gaps before; if not, gaps may come in any order."""

    def begin(self) -> Self:
        """The same for a new sequence, which knows of no gap before."""

    def images(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> Iterator[torch.Tensor]:
        """Images [n, C, H, W], codes, not clipped, at times [N] in order, 0 ... 1 from the first frame to the second:
        so many at a time that memory does not grow with N, until all are taken; none of no times.
        Gaps of a sequence come in their order if the method is `sequential`, those without a time, too.  What takes
        much memory is done tile by tile, if there are tiles.  Raises UsageError without events that it needs."""

    def between(self, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> torch.Tensor:
        """All of them [N, C, H, W]."""


class Together:
    """All images, of a method that gives some at a time."""

    __slots__ = ()

    def between(self: Method, gap: Gap, times: torch.Tensor, tiling: Tiling | None = None) -> torch.Tensor:
        """See `Method`."""
        made = [*self.images(gap, times, tiling)]
        return torch.cat(made) if made else gap.frame_0.new_zeros(0, *gap.frame_0.shape)
