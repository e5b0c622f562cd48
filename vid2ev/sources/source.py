"""What a source is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from vid2ev.sources.kept import Kept
from vid2ev.stream.frames import Frame

LARGEST = 65535  # pixels along a side: what the lens of a camera is described for (`rig/intrinsics.py`)


class Source(Protocol):
    """A clip that can be read from its start as often as one likes, one frame at a time, in memory that does not grow.

    Making one opens it, and raises `UsageError` or `DataError` if its first frame cannot be had.
    """

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px] of every frame, upright."""

    @property
    def frames_expected(self) -> int | None:
        """How many frames there should be, by the header; in some formats an estimate, None if there is no telling."""

    @property
    def duration_expected_s(self) -> float | None:
        """From the first frame to the end [s], by the header; None if there is no telling."""

    @property
    def rewindable(self) -> bool:
        """Whether it can be read again; standard input and cameras cannot, and a second `frames` raises UsageError."""

    @property
    def kept(self) -> Kept | None:
        """Of standard input what was read: it can be read again by whoever wants that in time."""

    @property
    def dense(self) -> bool:
        """Whether its frames are as close in time as light asks for, so that nothing has to be made between them."""

    @property
    def warnings(self) -> list[str]:
        """What a person should know, one sentence each; more may come while the frames are read to their end."""

    def describe(self) -> dict[str, Any]:
        """What the source is, how its codes were taken and how it was edited, ready for JSON."""

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on, in order of presentation, with strictly increasing times."""


def begins_s(source: Source) -> float:
    """The time of the first frame on the source's own clock [s]; 0 for a source without frames.  It opens the source
    once more, so ask it of one that is rewindable."""
    first = next(source.frames(), None)
    return 0.0 if first is None else first.t_ns / 1e9
