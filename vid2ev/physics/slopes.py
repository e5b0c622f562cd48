"""How steep the comparator's input is, and how far it goes, at most, by the slopes and the light that were measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.bounds.scene import QUARTER_EDGES, Scene
from vid2ev.physics.log_curve import curve_of, log_level


def steepest(scene: Scene, spec: Any) -> np.ndarray:
    """Bound on the slope of the comparator's input [tiles, nat/s].

    A filtered signal's slope is a mean of its input's (and before the log both are means by one weight).  A pole that
    is faster in the light may follow a change in the dark with the speed of the light.
    """
    if spec.bandwidth != "light" or spec.photoreceptor_tau_us == 0:
        return scene.slope_max
    dark = min(spec.bandwidth_dark, spec.dark_level) if spec.log_curve == "offset" else spec.bandwidth_dark
    return scene.slope_max * (scene.light_max + spec.bandwidth_dark) / (scene.light_min + dark)


def farthest(scene: Scene, spec: Any) -> np.ndarray:
    """Bound on how far the comparator's input goes [tiles, nat]: what is filtered stays within its light."""
    curve = curve_of(spec.log_curve, spec.dark_level)
    darkest, brightest = (
        np.array([log_level(float(light), curve) for light in lights]) for lights in (scene.light_min, scene.light_max)
    )
    return brightest - darkest


def slopes_of(scene: Scene, spec: Any) -> np.ndarray:
    """Bound on the slope of the comparator's input in each quarter of an octave of `Scene.by_slope` [nat/s]."""
    faster = float((steepest(scene, spec) / np.maximum(scene.slope_max, 1e-30)).max())
    return slopes_at(scene) * max(faster, 1.0)


def slopes_at(scene: Scene) -> np.ndarray:
    """The greatest slope in each quarter of an octave of `Scene.by_slope` [nat/s]."""
    slopes = np.minimum(QUARTER_EDGES[1:], float(scene.slope_max.max()))
    slopes[-1] = float(scene.slope_max.max())
    return slopes
