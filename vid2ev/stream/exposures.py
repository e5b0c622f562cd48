"""Exposures: what a frame sensor sends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Exposure:
    """A picture of a frame sensor.

    `codes` is uint16, [H, W] or red, green, blue [H, W, 3]; `start_ns` is when its first row opens, `end_ns` when its
    last row closes, on the clock of the camera, and `index` counts from 0.  `light`, on request, is what an ideal
    sensor would have said: the mean of the light [float32, 1.0 is diffuse white] that fell on each pixel while it was
    open, lens shading included; before electrons, noise and ADC.
    """

    codes: np.ndarray
    start_ns: int
    end_ns: int
    index: int
    light: np.ndarray | None = None
