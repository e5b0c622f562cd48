"""No frames in between: the frames of the source as they are."""

from __future__ import annotations

from vid2ev.stream.frames import Frame
from vid2ev.upsample import Interval


class NoUpsampling:
    """Passes frames on."""

    def between(self, a: Frame, b: Frame) -> Interval:
        """b."""
        return Interval(iter([b]))
