"""What grows while a recording is made: of each camera a sensor, and the files of what it sends; of all a recorder.

A new kind of camera is a class that satisfies `Track`, in a module of its own, and a line in `recorder._track`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from vid2ev.stream.frames import Frame

NEVER_US = -(1 << 62)  # before all times, of which some are before 0


class Track(Protocol):
    """A camera of a recording: `begin` comes first, then `add` for each frame that follows, then `finish` and `write`.

    Between two frames `state` is all there is to it beside the folder's files, and `restore` brings it back.
    """

    last_us: int  # the last thing that it sent, on its own clock; NEVER_US if it sent nothing

    @property
    def events(self) -> int:
        """How many events there are so far, if it sends any."""

    def begin(self, frame: Frame) -> None:
        """The first frame of the recording; after `restore`, the last source frame before the checkpoint."""

    def add(self, frame: Frame) -> None:
        """The next frame, and what the sensor makes of it."""

    def finish(self) -> None:
        """The end of the light: what the sensor held back."""

    def close(self) -> None:
        """Bring to the disk what the folder does not know of; a checkpoint follows."""

    def state(self) -> dict[str, np.ndarray]:
        """Everything that later frames depend on, as plain arrays."""

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state."""

    def write(self, whole: Path, start_us: int, duration_us: int) -> None:
        """Write the finished files, but for the manifest, of a recording of this start and length; raises OSError."""

    def counts(self) -> dict[str, int]:
        """How many of what came out, for the manifest."""

    def remarks(self) -> list[str]:
        """What a person should know about the result, one sentence each."""
