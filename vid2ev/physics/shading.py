"""Lens shading (vignetting): light falls off towards the corners.

    gain(r) = 1 + c1 r + c2 r^2 + ...,   r = distance from the image centre / image width,   gain >= 0

What leaving it out changes: on ln(light + dark) nothing but

    h = ln((light + dark) / (gain light + dark)),   from its least to its greatest in the range of light of a pixel

On a frame camera: light by (1 - gain), which is looked at in every value of every exposure.

Source: the paper, section II.A: a polynomial of the distance from the centre relative to the frame's width.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.physics.adc import lsb_per_light
from vid2ev.physics.fixed_pattern import greatest_gain
from vid2ev.physics.omission import echoes, omitted
from vid2ev.stream.exposed import Exposed, LevelChange, level_change
from vid2ev.stream.scene import Omission, Scene, off_by


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


def omission_of_levels(seen: Exposed, spec: Any) -> LevelChange:
    """The shading of a frame camera."""
    levels = seen.changes["shading"].times(lsb_per_light(spec) * greatest_gain(spec))
    return level_change(levels, "bound", "light is dimmer towards the corners")


def omission(scene: Scene, spec: Any) -> Omission:
    """The shading; the scene's light is what arrives behind it."""
    gains = [float(np.polynomial.polynomial.polyval(r, (1.0, *spec.shading))) for r in np.linspace(0.0, 1.0, 65)]
    reason = ""
    if spec.log_curve != "offset":
        reason = f"of the curve {spec.log_curve} the contrast changes with light"
    elif (spec.bandwidth == "light" and spec.photoreceptor_tau_us > 0) or spec.shot_rate_hz > 0:
        reason = "bandwidth or shot noise depend on light, too"
    gain = min(gains)
    figure = f"light x {max(gain, 0.0):.2g} at a distance of one width"
    if reason or gain <= 0.0 or max(gains) > 1.0:
        return omitted(scene, spec, math.inf, figure, reason or "the gain is not between 0 and 1")
    dark, least, most = spec.dark_level, scene.light_min, scene.light_max
    error = np.log((most / gain + dark) / (most + dark)) - np.log((least / gain + dark) / (least + dark))
    mean, figure = off_by(scene, np.abs(error), echoes=echoes(spec)), f"{np.abs(error).max():.2g} nat"
    return omitted(scene, spec, mean, figure, "a constant gain does not change the log")
