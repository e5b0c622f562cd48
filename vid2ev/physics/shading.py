"""Lens shading (vignetting): light falls off towards the corners.

    gain(r) = 1 + c1 r + c2 r^2 + ...,   r = distance from the image centre / image width,   0 <= gain <= 10^6

What leaving it out changes: ln(light + dark) by

    h = ln((light + dark) / (gain light + dark)) - h at the beginning

which is nothing far above the dark level.  Signals with and without it are measured side by side, whatever the curve
(`kernels/measure_bare.py`); events are otherwise late, too, where the bandwidth depends on light, and there are other
ones of shot noise.

On a frame camera: light by (1 - gain), which is looked at in every value of every exposure.

Source: the paper, section II.A: a polynomial of the distance from the centre relative to the frame's width.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.chances import at_most
from vid2ev.bounds.distance import added, bare
from vid2ev.bounds.exposed import Exposed, LevelChange, level_change
from vid2ev.bounds.scene import Omission, Scene
from vid2ev.physics.adc import lsb_per_light
from vid2ev.physics.fixed_pattern import greatest_gain
from vid2ev.physics.omission import echoes, light_events, omitted, reset, set_anew
from vid2ev.physics.photoreceptor_omission import lag_s, otherwise_late

GREATEST = 1e6  # of a coefficient, and of the gain: the brightest light is then within float32 yet


class Shading(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the lens shading."""

    shading: tuple[Annotated[float, Field(ge=-GREATEST, le=GREATEST)], ...] = Field(
        (),
        max_length=16,
        description="coefficients of r, r^2, ... of the optical gain, r in widths of the picture from its centre",
    )


def shading_map(coefficients: tuple[float, ...], width: int, height: int) -> np.ndarray:
    """Optical gain, float32 [height, width], of the shading polynomial."""
    x = np.arange(width) - (width - 1) / 2
    y = np.arange(height) - (height - 1) / 2
    r = np.hypot(x[None, :], y[:, None]) / width
    return _gain(coefficients, r).astype(np.float32)


def _gain(coefficients: tuple[float, ...], r: np.ndarray) -> np.ndarray:
    return np.clip(np.polynomial.polynomial.polyval(r, (1.0, *coefficients)), 0.0, GREATEST)


def omission_of_levels(seen: Exposed, spec: Any) -> LevelChange:
    """The shading of a frame camera."""
    levels = seen.changes["shading"].times(lsb_per_light(spec) * greatest_gain(spec))
    return level_change(levels, "bound", "light is dimmer towards the corners")


def omission(scene: Scene, spec: Any) -> Omission:
    """The shading; the scene's light is what arrives behind it, and that before it was measured beside it."""
    width, height = scene.size
    radii = np.linspace(0.0, np.hypot(width - 1, height - 1) / 2 / width, 65)
    gains = np.maximum(_gain(spec.shading, radii), 1e-6)
    figure = f"light x {gains.min():.2g} to {gains.max():.2g} from the centre to the corners"
    mean = bare(scene, echoes=echoes(spec))
    if spec.bandwidth == "light" and spec.photoreceptor_tau_us > 0:
        mean += otherwise_late(scene, spec, tuple(gains))
    said = omitted(scene, spec, mean, figure, "a constant gain does not change the log", lag_s=lag_s(scene, spec))
    others = set_anew(scene, spec, reset(scene, spec))
    extra = added(light_events(scene, spec), _other_shots(scene, spec, gains), others)
    return replace(said, distance=(said.distance or 0.0) + 2.0 * extra)


def _other_shots(scene: Scene, spec: Any, gains: np.ndarray) -> float:
    """How many more or less events of shot noise there are at most where light is not shaded."""
    octaves = np.exp2(np.arange(len(scene.brightness)) - 19.0)  # (their upper ends)
    shaded, pixels = np.minimum(octaves, 1.0), scene.brightness / max(float(scene.brightness.sum()), 1.0) * scene.pixels
    change = max(float(np.dot(pixels, np.abs(np.minimum(octaves / gain, 1.0) - shaded))) for gain in gains)
    change = max(change, float(np.dot(pixels, shaded)) * (1.0 - 1.0 / max(gains.max(), 1.0)))
    return at_most(spec.shot_rate_hz * (1.0 - spec.shot_light_factor) * change * scene.seconds)
