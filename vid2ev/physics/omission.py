"""What the omissions of effects have in common: bounds on the mean distance, become those of two recordings.

The bounds of `vid2ev.stream.scene` are for levels that lie anywhere, `random_phase`.  Where all pixels begin in step,
levels are spread by mismatch and crossing noise alone: the chance that one is in a given interval is greater by up to

    crowding = threshold / (sigma sqrt(2 pi))        sigma^2 = mismatch^2 + crossing_noise^2

and there may be as many more events, or none.  What shot noise and hot pixels send is the same in both recordings, and
the distance is the smaller for it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vid2ev.stream.scene import DISTANCE_TAU_S, Omission, Scene, at_least, at_most, off_by, surely, unlike

DEVIATIONS = 4.0  # that thresholds are at most from their mean


def echoes(spec: Any) -> bool:
    """Whether two recordings of a pixel that disagree about one event go on with other levels: thresholds are not all
    the same."""
    return bool(spec.mismatch > 0 or spec.crossing_noise > 0 or spec.threshold_on != spec.threshold_off)


def obstacle(spec: Any) -> str:
    """Why the bounds by levels do not hold for a sensor; "" where they do."""
    if spec.refractory_us > 0 and spec.refractory == "track":
        return "the memory jumps to the signal after each event, so errors add up"
    if not spec.random_phase and not (spec.mismatch > 0 or spec.crossing_noise > 0):
        return "all pixels start in step, so nothing is known of how far their levels are"
    return ""


def crowding(spec: Any) -> float:
    """How much nearer than anywhere levels may be to where they matter, at least 1; infinite if all are in step."""
    spread = math.hypot(spec.mismatch, spec.crossing_noise)
    if spec.random_phase:
        return 1.0
    return (
        max(min(spec.threshold_on, spec.threshold_off) / (spread * math.sqrt(2.0 * math.pi)), 1.0)
        if spread
        else math.inf
    )


def tau_at(light: np.ndarray, spec: Any) -> np.ndarray:
    """Time constant of the first pole at a light [us]."""
    constant = np.full(np.shape(light), spec.photoreceptor_tau_us)
    if spec.bandwidth == "constant":
        return constant
    return constant * (1.0 + spec.bandwidth_dark) / (light + spec.bandwidth_dark)


def taus_of(scene: Scene, spec: Any) -> tuple[np.ndarray, np.ndarray]:
    """Time constant of the first pole in the light and in the dark of each tile [us]."""
    return tau_at(scene.light_max, spec), tau_at(scene.light_min, spec)


def light_events(scene: Scene, spec: Any) -> float:
    """How many events of light there are at least, on average: what the poles round off at turns is missing; none where
    levels are not known."""
    if not spec.random_phase or obstacle(spec):
        return 0.0
    _, slowest_us = taus_of(scene, spec)
    reach_s = 0.5e-6 * np.hypot(slowest_us, spec.follower_tau_us)
    return max(scene.events - 2.0 * float(np.dot(reach_s, scene.bend_at_turns)) / scene.threshold, 0.0)


def noise_events(scene: Scene, spec: Any) -> tuple[float, float]:
    """How many events shot noise and hot pixels send at least and at most, each in 999 of 1000 cases, and leak with
    them at most; light is to an octave."""
    octaves = np.exp2(np.arange(len(scene.brightness) + 1) - 20.0)
    shares = 1.0 - (1.0 - spec.shot_light_factor) * np.minimum(octaves, 1.0)
    pixels = scene.brightness / max(float(scene.brightness.sum()), 1.0) * scene.pixels
    least, most = (
        spec.shot_rate_hz * float(np.dot(pixels, each)) * scene.seconds for each in (shares[1:], shares[:-1])
    )
    hot, hot_s = spec.hot_probability * scene.pixels, spec.hot_rate_hz * scene.seconds
    leaked = spec.leak_rate_hz * scene.pixels * scene.seconds
    return at_least(least) + at_least(at_least(hot) * hot_s), at_most(most) + at_most(at_most(hot) * hot_s) + leaked


def late_noise(scene: Scene, spec: Any, late_us: float) -> float:
    """Bound on the distance where all events of noise are later."""
    _, most = noise_events(scene, spec)
    bunched = 1.0 + 2.0 * DISTANCE_TAU_S * max(spec.shot_rate_hz, spec.hot_rate_hz if spec.hot_probability else 0.0)
    share = most / max(most + light_events(scene, spec), 1e-9)
    return share * bunched * min(1e-6 * late_us / DISTANCE_TAU_S, 1.0)


def omitted(
    scene: Scene,
    spec: Any,
    mean: float,
    figure: str,
    why: str,
    replace: tuple[tuple[str, Any], ...] = (),
    beside: float = 0.0,
) -> Omission:
    """The 99.9 % bound from one on the mean distance of events of light, which levels anywhere would make; infinite
    where nothing is known but how dense events are, and that up to so many are `beside` them in one recording."""
    if scene.still and not beside:
        return Omission(0.0, "99.9 % bound", figure, why, replace)
    noise, _ = noise_events(scene, spec)
    many = min(crowding(spec), 1e9) * scene.events + beside
    share = many / (many + noise)
    distance = max(unlike(scene), 2.0) * share
    if not obstacle(spec) and math.isfinite(mean):
        distance = min(distance, mean * many / max(light_events(scene, spec) + noise, 1e-9))
    return Omission(surely(scene, distance / share) * share, "99.9 % bound", figure, why, replace)


def displaced(scene: Scene, rms_nat: float) -> float:
    """Bound on the mean distance where levels are off by an rms of up to rms_nat in any pixel."""
    if rms_nat * DEVIATIONS >= scene.threshold:
        return math.inf
    return off_by(scene, np.full(len(scene.travel), rms_nat), echoes=False)
