"""Refractory period: after an event a pixel is blind for a while.

    quantised   a crossing within `refractory_us` of the last event moves the memory and sends nothing (the paper)
    track       no crossing is seen; when the period ends the memory becomes the signal (silicon: the switch reopens)

What leaving it out changes: none is lost if the signal cannot go a threshold far in the period,

    min(refractory_us slope_max, the range of ln(light + dark)) < least threshold

and else at most the share of thresholds that are so low, nor more than follow one that is sent within the period
(`thresholds.soon`); the memory moves alike (`quantised`).  Events of noise come within the period of others as often as
their rate says.

Sources: the paper, algorithm step 2e; `track` as the reset of the differencing amplifier in Lichtsteiner et al. 2008.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.chances import at_most
from vid2ev.bounds.distance import together
from vid2ev.bounds.scene import DISTANCE_TAU_S, Omission, Scene
from vid2ev.physics.omission import (
    crossings,
    crowding,
    light_events,
    noise_again,
    noise_events,
    noise_soon,
    omitted,
)
from vid2ev.physics.slopes import farthest, slopes_at, steepest
from vid2ev.physics.swallowed import swallowed
from vid2ev.physics.thresholds import soon


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
    way = float(np.minimum(steepest(scene, spec) * spec.refractory_us * 1e-6, farthest(scene, spec)).max())
    figure = f"at most {way:.2g} nat in {spec.refractory_us:g} us"
    any_other = omitted(scene, spec, math.inf, figure, "", dense=_always_open(scene, spec))
    without = spec.model_copy(update={"refractory_us": 0.0})
    noise = noise_again(scene, spec, without, spec.refractory_us * 1e-6)
    any_other = replace(any_other, distance=together(any_other.distance or 0.0, noise))
    if spec.refractory == "track":
        return replace(any_other, why="the memory jumps to the signal when the period ends")
    if spec.timing == "frame":
        return replace(any_other, why="all events of a frame come at once")
    if spec.photoreceptor_noise > 0:
        return replace(any_other, why="events of noise may come at any time")
    share, cost = swallowed(scene, spec, spec.refractory_us * 1e-6)
    noise = _swallowed_with_noise(scene, spec)
    leaked = spec.leak_rate_hz * spec.threshold_on * spec.refractory_us * 1e-6
    if noise == 0.0 and soon(way + leaked, spec)[0] == 0.0:
        return Omission(0.0, "exact", figure, "no threshold is so low that an event is swallowed")
    why = f"a share of {share:.2g} of the crossings may be swallowed"
    why += f", and {noise:.2g} by noise" if noise else ""
    near = cost / share if share else 1.0
    gone, noisy = near * at_most(share * scene.events / near), at_most(noise)
    both = crossings(scene) + light_events(scene, spec) + 2.0 * noise_events(scene, without)[0] - noisy
    rate_hz = max(spec.shot_rate_hz, spec.hot_rate_hz if spec.hot_probability > 0 else 0.0)
    dense = 1.0 + 2.0 * DISTANCE_TAU_S * rate_hz * min(rate_hz * spec.refractory_us * 1e-6, 1.0)
    distance = (gone * near + noisy * dense) / max(both, 1e-9)
    return replace(any_other, distance=float(min(distance, max(any_other.distance or 0.0, dense))), why=why)


def _always_open(scene: Scene, spec: Any) -> float:
    """D of a recording by itself, for each half of an event, at most, of a pixel that is never blind: where memories
    jump to the signal, `Scene.bunched` is for gaps of a threshold and the period, and there are fewer events by it."""
    if spec.refractory != "track" or scene.still:
        return scene.bunched
    slopes = slopes_at(scene)
    events = scene.by_slope[0] * (1.0 + spec.refractory_us * 1e-6 * slopes / scene.threshold)
    near = 2.0 / np.expm1(np.minimum(scene.threshold / (slopes * DISTANCE_TAU_S), 700.0))
    return max(1.0 + float(np.dot(events, near)) / float(events.sum()), scene.bunched)


def _swallowed_with_noise(scene: Scene, spec: Any) -> float:
    """How many events, at most, follow one of noise, or are of noise and follow another, within the period: on average,
    of events of noise at their greatest rate."""
    period_s, light = spec.refractory_us * 1e-6, min(crowding(spec, scene), 1e9) * scene.events
    rate_hz = spec.shot_rate_hz + spec.hot_probability * spec.hot_rate_hz
    leaked = spec.leak_rate_hz * scene.pixels * scene.seconds
    return 2.0 * period_s * (light + leaked) * rate_hz + noise_soon(scene, spec, period_s)
