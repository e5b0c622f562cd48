"""Refractory period: after an event a pixel is blind for a while.

    quantised   a crossing within `refractory_us` of the last event moves the memory and sends nothing (the paper)
    track       no crossing is seen; when the period ends the memory becomes the signal (silicon: the switch reopens)

What leaving it out changes: none is lost if the signal cannot go a threshold far in the period,

    refractory_us slope_max < least threshold

and else at most the share of thresholds that are so low; the memory moves alike (`quantised`).

Sources: the paper, algorithm step 2e; `track` as the reset of the differencing amplifier in Lichtsteiner et al. 2008.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.physics.crossing_noise import chance_below
from vid2ev.physics.photoreceptor import slopes_of, steepest
from vid2ev.stream.scene import DISTANCE_TAU_S, Omission, Scene, surely


class Refractory(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the refractory period."""

    refractory_us: float = Field(
        100.0, ge=0, le=1e12, description="time after an event in which a pixel sends none [us]"
    )
    refractory: Literal["quantised", "track"] = Field(
        "quantised",
        description="in the refractory period the memory follows the crossings, or jumps to the signal at its end",
    )


def omission(scene: Scene, spec: Any) -> Omission:
    """The refractory period."""
    slope = float(steepest(scene, spec).max())
    way = slope * spec.refractory_us * 1e-6
    figure = f"at most {way:.2g} nat in {spec.refractory_us:g} us"
    if spec.refractory == "track":
        return Omission(None, "no bound yet", figure, "the memory jumps to the signal when the period ends")
    if spec.photoreceptor_noise > 0 or spec.shot_rate_hz > 0 or spec.hot_probability > 0:
        return Omission(None, "no bound yet", figure, "events of noise may come at any time")
    most = slopes_of(scene, spec)
    travel, total = scene.by_slope[0], max(float(scene.by_slope[0].sum()), 1e-300)
    leaked = spec.leak_rate_hz * spec.threshold_on * spec.refractory_us * 1e-6
    chances = [
        _swallowed(slope * spec.refractory_us * 1e-6 + leaked, spec) if some else 0.0
        for slope, some in zip(most, travel, strict=True)
    ]
    share = float(np.dot(chances, travel)) / total
    if share == 0.0:
        return Omission(0.0, "exact", figure, "no threshold is so low that an event is swallowed")
    bunched = [1.0 + 2.0 * DISTANCE_TAU_S * slope / scene.threshold for slope in most]
    mean = min(float(np.dot(np.multiply(chances, bunched), travel)) / total, 2.0)
    why = f"a share of {share:.2g} of the crossings may be swallowed"
    return Omission(surely(scene, mean), "99.9 % bound", figure, why)


def _swallowed(way_nat: float, spec: Any) -> float:
    """Bound on the chance that a crossing comes within the period, in which the signal goes so far."""
    return min(sum(chance_below(way_nat, mean, spec) for mean in (spec.threshold_on, spec.threshold_off)), 1.0)
