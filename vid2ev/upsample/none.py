"""No frames in between: the frames of the source as they are."""

from __future__ import annotations

from collections.abc import Iterator

from vid2ev.stream.frames import Frame


class NoUpsampling:
    """Passes frames on."""

    limited = 0

    def between(self, a: Frame, b: Frame) -> Iterator[Frame]:
        """b."""
        yield b
