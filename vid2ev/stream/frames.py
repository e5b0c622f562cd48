"""Frames: linear light at an instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Frame:
    """The light of a scene at one instant.

    `light` is float32 [H, W], linear luminance; 1.0 is diffuse white and brighter light goes on unclipped.
    `t_ns` is the instant in nanoseconds on the clock of the source.  `original` is True for a frame of the
    source, False for one made between two of them.  `cut` is True where a new shot begins: what was seen
    before has nothing to do with it.
    """

    light: np.ndarray
    t_ns: int
    original: bool = True
    cut: bool = False
