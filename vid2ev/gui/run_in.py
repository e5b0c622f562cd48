"""What the sensors of a preview see of a video before it begins, so that they are as they would be in its conversion.

A sensor that has just been switched on has its levels around the light that it sees, all pixels alike; in one that has
seen a while, each pixel is somewhere between its own, and where light goes back and forth it sends less.  After
`RUN_IN_S` that is nearly as it stays.  There light goes straight from frame to frame: what moves between two frames
hardly changes where the levels are in the end, and to look for it would take longer than the preview itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vid2ev.seen.instants import Instant
from vid2ev.seen.recipe import Recipe
from vid2ev.stream.frames import Frame
from vid2ev.stream.upload import Upload
from vid2ev.upsample import Interval, Upsampler
from vid2ev.upsample.none import NoUpsampling

RUN_IN_S = 0.3


@dataclass(frozen=True)
class PartRecipe(Recipe):
    """That of a part of a video: nothing is made between frames before `since_ns`."""

    since_ns: int = 0

    def upsampler(self, upload: Upload | None = None) -> Upsampler:
        """The upsampler of the part."""
        return _Since(super().upsampler(upload), self.since_ns)


class _Since:
    """An upsampler that begins late."""

    def __init__(self, upsampler: Upsampler, since_ns: int):
        self._upsampler, self._since_ns = upsampler, since_ns

    def between(self, a: Frame, b: Frame) -> Interval:
        """Of intervals that end before it begins, b."""
        return (self._upsampler if b.t_ns > self._since_ns else NoUpsampling()).between(a, b)


def since_cut(seen: Sequence[Instant], lead: int) -> tuple[Sequence[Instant], int]:
    """The instants from the last cut before instant `lead` on, at which a conversion starts its sensors afresh, and the
    lead among them."""
    first = max((k for k in range(lead + 1) if seen[k].cut), default=0)
    return seen[first:], lead - first
