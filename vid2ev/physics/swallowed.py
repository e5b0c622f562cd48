"""Crossings that nothing is sent of, as an event has just been: their share, and what it costs that they are missing.

By the slopes at the crossings (`Scene.by_slope`) and the share that follows others so soon there (`thresholds.soon`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from vid2ev.bounds.scene import DISTANCE_TAU_S, Scene
from vid2ev.physics.slopes import slopes_of
from vid2ev.physics.thresholds import soon


class Swallowed(NamedTuple):
    """Of all crossings of light the share that is swallowed, at most, and D of those by themselves, for each half of a
    crossing of light: more than the share, where they are near each other."""

    share: float
    cost: float


def swallowed(scene: Scene, spec: Any, blind_s: float) -> Swallowed:
    """Those that come within a time after an event that is sent."""
    seen = np.flatnonzero(scene.by_slope[0])
    if not seen.size:
        return Swallowed(0.0, 0.0)
    (travel, near), slopes = scene.by_slope[:, seen], slopes_of(scene, spec)[seen]
    ways_nat = (slopes + spec.leak_rate_hz * spec.threshold_on) * blind_s
    chances, again = np.array([soon(float(way_nat), spec) for way_nat in ways_nat]).T
    evenly = travel * 2.0 / np.expm1(np.minimum(scene.threshold / (slopes * DISTANCE_TAU_S), 700.0))
    costs = [float(np.dot(chances, travel + again * of)) for of in (near, evenly)]  # (of either measure it is a bound)
    total = float(travel.sum())
    return Swallowed(float(np.dot(chances, travel)) / total, min(costs) / total)


def unsent(scene: Scene, spec: Any) -> Swallowed:
    """Those within the refractory period of an event, or in the same event frame."""
    blind_us = spec.refractory_us if spec.refractory == "quantised" else 0.0
    blind_s = 1e-6 * max(blind_us, 1e6 / spec.frame_rate_hz if spec.frame_rate_hz > 0 else 0.0)
    if blind_s == 0.0 or scene.still:
        return Swallowed(0.0, 0.0)
    return Swallowed(1.0, math.inf) if spec.timing == "frame" else swallowed(scene, spec, blind_s)
