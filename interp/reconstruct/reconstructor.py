"""What makes pictures of events, slice after slice."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from vid2ev import Events


class Reconstructor(Protocol):
    """Slices follow each other, and come in one or more pieces each; what was seen of them is remembered."""

    @property
    def name(self) -> str: ...

    def add(self, events: Events, start_us: int, stop_us: int, worth: np.ndarray | None = None) -> None:
        """Events of a slice, in order of time; of each, how many crossings it stands for, float32 [N], by default 1."""

    def picture(self, stop_us: int) -> np.ndarray:
        """Light [H, W] float32 at the end of the slice."""

    def memory(self) -> dict[str, np.ndarray]:
        """All that it knows between two slices."""

    def remember(self, memory: dict[str, np.ndarray]) -> None:
        """Take that up."""
