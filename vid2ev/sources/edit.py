"""A source seen through a change: what all changes have in common."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vid2ev.stream.frames import Frame

if TYPE_CHECKING:
    from vid2ev.sources.kept import Kept
    from vid2ev.sources.source import Source


def unedited(source: Source) -> Source:
    """The source below all changes."""
    while isinstance(source, Edit):
        source = source.source
    return source


class Edit:
    """The source itself, but for what a subclass changes; `describe` says so under "edits"."""

    def __init__(self, source: Source):
        self.source = source

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.source.size

    @property
    def frames_expected(self) -> int | None:
        """How many frames there should be."""
        return self.source.frames_expected

    @property
    def duration_expected_s(self) -> float | None:
        """From the first frame to the end [s]."""
        return self.source.duration_expected_s

    @property
    def rewindable(self) -> bool:
        """Whether it can be read again."""
        return self.source.rewindable

    @property
    def kept(self) -> Kept | None:
        """What was read of standard input."""
        return self.source.kept

    @property
    def dense(self) -> bool:
        """Whether nothing has to be made between its frames."""
        return self.source.dense

    @property
    def warnings(self) -> list[str]:
        """What a person should know."""
        return self.source.warnings

    def edits(self) -> dict[str, Any]:
        """The change, ready for JSON."""
        return {}

    def describe(self) -> dict[str, Any]:
        """What the source is, and how it was changed."""
        about = self.source.describe()
        edits = {**about.get("edits", {}), **self.edits()}
        about |= {"size": list(self.size), "frames_expected": self.frames_expected}
        if "duration_expected_s" in about:
            about["duration_expected_s"] = self.duration_expected_s
        return about | {"edits": edits} if edits else about

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        return self.source.frames(start)


class Grey(Edit):
    """RGB of a source that has luminance only: three times the same."""

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames [H, W, 3] from index `start` on."""
        for frame in self.source.frames(start):
            yield replace(frame, light=np.repeat(frame.light[..., None], 3, axis=-1))
