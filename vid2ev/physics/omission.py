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

from vid2ev.physics.slopes import slopes_of
from vid2ev.physics.thresholds import soon, spread_of
from vid2ev.stream.bounds import at_least, at_most, off_by, surely, unlike
from vid2ev.stream.scene import DISTANCE_TAU_S, QUARTER_EDGES, Kind, Omission, Scene

DEVIATIONS = 4.0  # that thresholds are at most from their mean


def tracks(spec: Any) -> bool:
    """Whether the memory jumps to the signal after each event."""
    return bool(spec.refractory_us > 0 and spec.refractory == "track")


def echoes(spec: Any) -> bool:
    """Whether two recordings of a pixel that disagree about one event go on with other levels: thresholds are not all
    the same, or memories jump to the signal."""
    return bool(tracks(spec) or spec.mismatch > 0 or spec.crossing_noise > 0 or spec.threshold_on != spec.threshold_off)


def kind_of(spec: Any) -> Kind:
    """What kind of statement a distance is that counts events of light, or follows levels.

    Where memories jump to the signal it is an estimate.  That phases are even is so for slopes that stay the same, and
    only nearly so where they change from cycle to cycle (`stream/scene.py`): noise brings phases back to even, but by
    how much is not proven.
    """
    return "estimate" if tracks(spec) else "99.9 % bound"


def obstacle(spec: Any) -> str:
    """Why the bounds by levels do not hold for a sensor; "" where they do."""
    if not spec.random_phase and not (spec.mismatch > 0 or spec.crossing_noise > 0):
        return "all pixels start in step, so nothing is known of how far their levels are"
    return ""


def crowding(spec: Any, scene: Scene) -> float:
    """How much nearer than anywhere levels may be to where they matter, at least 1; infinite if all are in step.

    Shot noise sets levels a threshold from the signal, and so does a memory that jumps to the signal as it comes to
    rest: of the pixels that these may reach, levels are spread as those of pixels in step are.
    """
    spread = spread_of(spec)
    if spread == 0.0:
        return 1.0 if spec.random_phase else math.inf
    in_step = max(min(spec.threshold_on, spec.threshold_off) / (spread * math.sqrt(2.0 * math.pi)), 1.0)
    if not spec.random_phase:
        return in_step
    return 1.0 + min(reset(scene, spec) + _at_rest(scene, spec), 1.0) * (in_step - 1.0)


def _at_rest(scene: Scene, spec: Any) -> float:
    """The share of pixels, at most, that are blind as the signal turns or comes to rest, and see again there."""
    if not tracks(spec) or scene.still:
        return 0.0
    blind_nat = spec.refractory_us * 1e-6 * QUARTER_EDGES[1:]
    shares = blind_nat / (scene.threshold + blind_nat)
    return 2.0 * float(np.dot(scene.by_slope[0], shares)) / float(scene.by_slope[0].sum())


def reset(scene: Scene, spec: Any) -> float:
    """The share of pixels, at most, whose levels shot noise has set anew before an event, on average."""
    return -math.expm1(-spec.shot_rate_hz * scene.seconds)


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
    """How many events of light there are at least, on average."""
    crossings = scene.travel_at_least / scene.threshold - _missing(scene, spec)
    return max(crossings, 0.0) * (1.0 - unsent(scene, spec))


def unsent(scene: Scene, spec: Any) -> float:
    """The share of the crossings of light, at most, of which nothing is sent, as an event has just been: within the
    refractory period, or in the same event frame."""
    blind_us = spec.refractory_us if spec.refractory == "quantised" else 0.0
    blind_s = 1e-6 * max(blind_us, 1e6 / spec.frame_rate_hz if spec.frame_rate_hz > 0 else 0.0)
    if blind_s == 0.0 or scene.still:
        return 0.0
    if spec.timing == "frame":
        return 1.0
    leaked, (travel, _) = spec.leak_rate_hz * spec.threshold_on * blind_s, scene.by_slope
    slopes, seen = slopes_of(scene, spec), np.flatnonzero(travel)
    chances = [soon(slopes[k] * blind_s + leaked, spec)[0] for k in seen]
    return min(float(np.dot(chances, travel[seen])) / float(travel.sum()), 1.0)


def _missing(scene: Scene, spec: Any) -> float:
    """How many events the poles round off at turns; of pixels in step, up to one for each time that they are pushed."""
    _, slowest_us = taus_of(scene, spec)
    reach_s = 0.5e-6 * np.hypot(slowest_us, spec.follower_tau_us)
    missing = 2.0 * float(np.dot(reach_s, scene.bend_at_turns)) / scene.threshold
    if not spec.random_phase:
        missing += float(scene.turns.sum()) + scene.moving
    return missing


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
    lag_s: np.ndarray | float = 0.0,
) -> Omission:
    """The 99.9 % bound from one on the mean distance of events of light, which levels anywhere would make; infinite
    where nothing is known but how dense events are.  Signals are no further apart than by lag_s.  Events of the leak
    are other ones, too, and those of noise that a pixel is blind to.

    Where memories jump to the signal, it is an estimate (`kind_of`), unless it is how dense events are that counts.
    """
    kind: Kind = "99.9 % bound"
    spread = spread_of(spec)
    if scene.still and not spec.leak_rate_hz:
        return Omission(0.0, "99.9 % bound", figure, why, replace)
    noise, most = noise_events(scene, spec)
    leaked = spec.leak_rate_hz * scene.pixels * scene.seconds
    light = min(crowding(spec, scene), 1e9) * scene.events
    swallowed = light * spec.refractory_us * 1e-6 * (most - leaked) / max(scene.pixels * scene.seconds, 1e-9)
    many = light + leaked + min(swallowed, noise)
    share = many / (many + noise)
    distance = max(unlike(scene, lag_s), 1.0) * share
    if not obstacle(spec) and math.isfinite(mean):
        mean += 0.0 if spread else reset(scene, spec) * unlike(scene, lag_s)
        sent = 1.0 - unsent(scene, spec)
        near = mean + (1.0 - sent) * unlike(scene, lag_s)
        near *= light / max(sent * max(scene.events - _missing(scene, spec), 0.0) + noise, 1e-9)
        distance, kind = (near, kind_of(spec)) if near < distance else (distance, kind)
    return Omission(surely(scene, distance / share) * share, kind, figure, why, replace)


def displaced(scene: Scene, spec: Any, rms_nat: float) -> float:
    """Bound on the mean distance where levels are off by an rms of up to rms_nat in any pixel; infinite where the leak
    sends events that move with them."""
    if rms_nat * DEVIATIONS >= scene.threshold or spec.leak_rate_hz > 0:
        return math.inf
    return off_by(scene, np.full(len(scene.travel), rms_nat), echoes=False)
