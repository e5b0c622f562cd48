"""Lens shading (vignetting): light falls off towards the corners.

    gain(r) = 1 + c1 r + c2 r^2 + ...,   r = distance from the image centre / image width,   gain >= 0

Source: the paper, section II.A: a polynomial of the distance from the centre relative to the frame's width.
"""

from __future__ import annotations

import numpy as np
from pydantic import BaseModel, Field


class Shading(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the lens shading."""

    shading: tuple[float, ...] = Field((), max_length=16, description="coefficients of r, r^2, ... of the optical gain")


def shading_map(coefficients: tuple[float, ...], width: int, height: int) -> np.ndarray:
    """Optical gain, float32 [height, width], of the shading polynomial."""
    x = np.arange(width) - (width - 1) / 2
    y = np.arange(height) - (height - 1) / 2
    r = np.hypot(x[None, :], y[:, None]) / width
    gain = np.polynomial.polynomial.polyval(r, (1.0, *coefficients))
    return np.maximum(gain, 0.0).astype(np.float32)
