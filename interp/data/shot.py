"""Shots: the light of one gap between two key frames, as two cameras see it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from vid2ev.sensors.devices import Device

AHEAD = 8  # the event camera watches from the gap / AHEAD before the first key frame on


@dataclass(frozen=True)
class Beside:
    """Where the event camera is: by how much it stands to the right of the frame camera and below it [m], looking the
    same way, and pixels of frames per pixel of events, across."""

    right_m: float = 0.0
    down_m: float = 0.0
    coarser: int = 1

    @property
    def same(self) -> bool:
        """Whether both see the same."""
        return self == SAME


SAME = Beside()


class Shot(Protocol):
    """The light of a gap.

    moved_px   how far things move in it, the fast ones [px of frames]
    exposed    whether it was exposed already, as films are, so that aperture and shutter change nothing of it
    about      what it shows, ready for JSON
    """

    moved_px: float
    exposed: bool
    about: dict[str, Any]

    def pictures(self, steps: int, first: int, last: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """The light of both cameras at instants j / steps of the gap, j = first ... last, before it (j < 0) and after
        it too: of the frame camera [H, W, 3], and luminance for the event camera [h, w]; float32."""

    def on_device(self, device: Device, steps: int, first: int, last: int) -> tuple[Any, Any]:
        """All of them on a device, but for the last bits: tensors [n, H, W, 3] and [n, h, w]."""


def coarse(light: np.ndarray, factor: int) -> np.ndarray:
    """Means over squares of pixels of an image [H, W]."""
    if factor == 1:
        return light
    height, width = light.shape
    return light.reshape(height // factor, factor, width // factor, factor).mean(axis=(1, 3), dtype=np.float32)
