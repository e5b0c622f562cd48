"""What the omissions of effects have in common: bounds on the mean distance, become those of two recordings.

The bounds of `vid2ev.bounds.scene` are for levels that lie anywhere, `random_phase`.  Where all pixels begin in step,
levels are spread by mismatch and crossing noise alone: the chance that one is in a given interval is greater by up to

    crowding = threshold / (sigma sqrt(2 pi))        sigma^2 = mismatch^2 + crossing_noise^2

and there may be as many more events, or none.  What shot noise and hot pixels send is the same in both recordings, and
the distance is the smaller for it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vid2ev.bounds.chances import at_least, at_most, surely
from vid2ev.bounds.distance import off_by, unlike
from vid2ev.bounds.scene import DISTANCE_TAU_S, QUARTER_EDGES, Kind, Omission, Scene
from vid2ev.physics.swallowed import unsent
from vid2ev.physics.thresholds import DEVIATIONS, STEPS, spread_of, spread_thresholds

SPREAD_MOST = 1 / 3  # of a threshold: up to there levels lie as evenly as bounds take them to


def tracks(spec: Any) -> bool:
    """Whether the memory jumps to the signal after each event."""
    return bool(spec.refractory_us > 0 and spec.refractory == "track")


def echoes(spec: Any) -> bool:
    """Whether two recordings of a pixel that disagree about one event go on with other levels: thresholds are not all
    the same, or memories jump to the signal."""
    return bool(tracks(spec) or spread_of(spec) > 0 or spec.threshold_on != spec.threshold_off)


def kind_of(spec: Any) -> Kind:
    """What kind of statement a distance is that counts events of light, or follows levels.

    Where memories jump to the signal it is an estimate.  That phases are even is so for slopes that stay the same, and
    only nearly so where they change from cycle to cycle (`bounds/scene.py`): noise brings phases back to even, but by
    how much is not proven.
    """
    return "estimate" if tracks(spec) else "99.9 % bound"


def obstacle(spec: Any) -> str:
    """Why the bounds by levels do not hold for a sensor; "" where they do."""
    if spec.photoreceptor_noise > 0:
        return "noise that trembles sends events wherever levels are, and others if these move"
    if spread_of(spec) > SPREAD_MOST * min(spec.threshold_on, spec.threshold_off):
        return "thresholds are spread so far that levels crowd where light trembles"
    if not spec.random_phase and spread_of(spec) == 0:
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
    in_step = max(_in_step(spec), 1.0)
    if not spec.random_phase:
        return in_step
    ever_reset = -math.expm1(-spec.shot_rate_hz * scene.seconds)  # (where levels matter may be late in the clip)
    return 1.0 + min(ever_reset + _at_rest(scene, spec), 1.0) * (in_step - 1.0)


def _at_rest(scene: Scene, spec: Any) -> float:
    """The share of pixels, at most, that are blind as the signal turns or comes to rest, and see again there."""
    if not tracks(spec) or scene.still:
        return 0.0
    blind_nat = spec.refractory_us * 1e-6 * QUARTER_EDGES[1:]
    shares = blind_nat / (scene.threshold + blind_nat)
    return 2.0 * float(np.dot(scene.by_slope[0], shares)) / float(scene.by_slope[0].sum())


def reset(scene: Scene, spec: Any) -> float:
    """The share of events of light, at most, before which shot noise has set the levels of their pixels anew since the
    shot began, on average; such noise comes the more often the darker it is."""
    if scene.still:
        return 0.0
    rates_hz = spec.shot_rate_hz * (1.0 - (1.0 - spec.shot_light_factor) * np.clip(scene.light_min, 0.0, 1.0))
    return float(np.dot(-np.expm1(-rates_hz * scene.travelled_when_s), scene.travel) / scene.travel.sum())


def tau_at(light: np.ndarray, spec: Any) -> np.ndarray:
    """Time constant of the first pole at a light [us]."""
    constant = np.full(np.shape(light), spec.photoreceptor_tau_us)
    if spec.bandwidth == "constant":
        return constant
    return constant * (1.0 + spec.bandwidth_dark) / (light + spec.bandwidth_dark)


def levels_between(nat: np.ndarray, spec: Any) -> np.ndarray:
    """How many levels are between two signals so far apart at most, for each that is there on average."""
    often = 1.0 / spread_thresholds(min(spec.threshold_on, spec.threshold_off), spec, STEPS)
    return (1.0 + np.floor(np.multiply.outer(nat, often))) @ often / often.sum()


def taus_of(scene: Scene, spec: Any) -> tuple[np.ndarray, np.ndarray]:
    """Time constant of the first pole in the light and in the dark of each tile [us]."""
    return tau_at(scene.light_max, spec), tau_at(scene.light_min, spec)


def light_events(scene: Scene, spec: Any) -> float:
    """How many events of light there are at least, on average, in a sensor without hot and cold pixels.

    These send neither events of light nor those that an effect adds, nearly all of which bounds count in all pixels,
    too; and it is the ratio of both that they hang on.
    """
    return crossings(scene) * (1.0 - unsent(scene, spec).share)


def crossings(scene: Scene) -> float:
    """How many crossings of light there are at least, on average; the second pole takes something from peaks."""
    return max(float(scene.travel_at_least.sum() - 2.0 * scene.off_peaks.sum()) / scene.threshold, 0.0)


def sent_share(scene: Scene, spec: Any) -> float:
    """The share of the events of light expected that is sent at least."""
    return min(light_events(scene, spec) / scene.events, 1.0) if not scene.still else 0.0


def set_anew(scene: Scene, spec: Any, share: float) -> float:
    """Bound on the distance where memories have been set to the signal before a share of the events [mean], which may
    all be others then.

    Two memories on one signal take turns, one event of this after one of that, and so each two cost no more than one
    by itself.  Where a pixel is blind after an event, not all are sent, and of either recording others: then one may
    have the ON events of light that flickers, and the other the OFF events.  What is missing of both adds up by the
    triangle inequality.  Levels that start from the signal are as crowded as those of pixels in step; there is one
    event more, at most, each time that the pixel is pushed.
    """
    if scene.still:
        return 0.0
    spread = spread_of(spec)
    in_step = max(_in_step(spec) - 1.0, 0.0) if spread > 0.0 else math.inf
    more = 1.0 + 0.5 * min(float(scene.turns.sum()) / scene.events, in_step)
    apart = apart_at_most(scene, spec)
    each = min((1.0 + math.sqrt(2.0 * unsent(scene, spec).cost)) ** 2, apart)
    return min(surely(scene, share * more * each, sent_share(scene, spec)), apart)


def by_itself(scene: Scene, spec: Any) -> float:
    """D of a recording by itself at most, for each half of an event: events are as dense as light makes them, and no
    denser than a pixel that is blind for R after each, or sends one in each event frame: coth x, of x = R / (2 tau).
    Times that are rounded to event frames are off by up to R / 2 each way: pairs are (sinh x / x)^2 times as near."""
    frame_s = 1.0 / spec.frame_rate_hz if spec.frame_rate_hz > 0 else 0.0
    blind, x = max(1e-6 * (spec.refractory_us - 1.0), frame_s) / DISTANCE_TAU_S, 0.5 * frame_s / DISTANCE_TAU_S
    nearer = (math.sinh(x) / x) ** 2 if 0.0 < x < 100.0 else 1.0
    dense = 1.0 + nearer * (scene.bunched - 1.0)
    return min(dense, 1.0 / math.tanh(0.5 * blind)) if blind > 0.0 else dense


def apart_at_most(scene: Scene, spec: Any, lag_s: np.ndarray | float = math.inf) -> float:
    """Bound on the mean distance of two recordings of a sensor, whatever becomes of the levels (`unlike`)."""
    return unlike(scene, by_itself(scene, spec), lag_s)


def _in_step(spec: Any) -> float:
    """How crowded levels are that start together, for thresholds that are spread."""
    return min(spec.threshold_on, spec.threshold_off) / (spread_of(spec) * math.sqrt(2.0 * math.pi))


def readout_shifts(scene: Scene, spec: Any) -> float:
    """By how many times more than by itself a shift in time counts at a fixed rate, at most: a signal that goes in an
    interval of the light meets its levels evenly in that time, and of so many event frames each has its border."""
    if spec.frame_rate_hz == 0:
        return 1.0
    return 1.0 + 1.0 / (spec.frame_rate_hz * scene.shortest_s)


def _missing(scene: Scene, spec: Any) -> float:
    """How many events poles round off; of pixels in step, up to one more for each time that they are pushed."""
    in_step = 0.0 if spec.random_phase else float(scene.turns.sum()) + scene.moving
    return _rounded(scene, spec) + in_step


def _rounded(scene: Scene, spec: Any) -> float:
    """How many events the poles round off at turns."""
    _, slowest_us = taus_of(scene, spec)
    reach_s = 0.5e-6 * np.hypot(slowest_us, spec.follower_tau_us)
    return 2.0 * float(np.dot(reach_s, scene.bend_at_turns)) / scene.threshold


def noise_events(scene: Scene, spec: Any) -> tuple[float, float]:
    """How many events shot noise and hot pixels send at least and at most, each in 999 of 1000 cases, and with them
    leak and noise of the photoreceptor at most; light is to an octave.

    A pixel that is blind for a time R after an event, or sends one in each event frame of R, sends events of a rate r
    no more rarely than r / (1 + r R): from one to the next it waits R, and then for as long as it did before.
    """
    octaves = np.exp2(np.arange(len(scene.brightness) + 1) - 20.0)
    shares = 1.0 - (1.0 - spec.shot_light_factor) * np.minimum(octaves, 1.0)
    pixels = scene.brightness / max(float(scene.brightness.sum()), 1.0) * scene.pixels
    blind_s = 1e-6 * spec.refractory_us + (1.0 / spec.frame_rate_hz if spec.frame_rate_hz > 0 else 0.0)
    least_hz, most_hz = spec.shot_rate_hz * shares[1:], spec.shot_rate_hz * shares[:-1]
    least_hz /= 1.0 + least_hz * blind_s
    least, most = (float(np.dot(pixels, rate_hz)) * scene.seconds for rate_hz in (least_hz, most_hz))
    hot, hot_s = spec.hot_probability * scene.pixels, spec.hot_rate_hz * scene.seconds
    hot_least = at_least(at_least(hot) * hot_s / (1.0 + spec.hot_rate_hz * blind_s))
    return at_least(least) + hot_least, at_most(most) + at_most(at_most(hot) * hot_s) + _unforced(scene, spec)


def noise_soon(scene: Scene, spec: Any, within_s: float) -> float:
    """How many events of noise follow others of noise of their pixel within a time, on average, at the greatest rate
    and of as many hot pixels as there may be."""
    shot_hz, hot_hz = spec.shot_rate_hz, spec.hot_rate_hz
    hot = at_most(spec.hot_probability * scene.pixels)
    return within_s * scene.seconds * (scene.pixels * shot_hz**2 + hot * hot_hz * (hot_hz + 2.0 * shot_hz))


def noise_again(scene: Scene, spec: Any, without: Any, within_s: float) -> float:
    """Bound on the distance where those events come to which a sensor is blind, and `without` an effect it is not."""
    least, _ = noise_events(scene, spec)
    all_least, all_most = noise_events(scene, without)
    come = min(at_most(noise_soon(scene, spec, within_s)), all_most)
    rate_hz = spec.shot_rate_hz + (spec.hot_rate_hz if spec.hot_probability > 0 else 0.0)
    both = crossings(scene) + light_events(scene, spec) + least + all_least
    return come * (1.0 + 2.0 * DISTANCE_TAU_S * rate_hz) / max(both, 1e-9)


def _unforced(scene: Scene, spec: Any) -> float:
    """How many events leak and noise of the photoreceptor send at most; they depend on where levels are."""
    return spec.leak_rate_hz * scene.pixels * scene.seconds + trembling(scene, spec)[0]


def trembling(scene: Scene, spec: Any) -> tuple[float, float]:
    """How many events noise of the photoreceptor sends at most, in 999 of 1000 cases, and what each half of one costs
    beside the others.

    Of levels that lie anywhere, the one that is s away from the middle switches there and back no more often than the
    noise reaches |s| + theta/2, so by Rice's rate nu they send, for a pixel's theta,

        2/theta integral nu(|s| + theta/2) ds = 2 nu(0) sqrt(2 pi) rms/theta erfc(theta / (sqrt(8) rms))  [1/s]

    and those at the middle 2 nu(theta/2); once more for each threshold that the greatest excursion reaches over.  A
    level sends ON and OFF in turn, so by itself each costs no more than the half of one; and as the root of D is a
    metric, levels m thresholds farther, that switch less often by exp(-m (m + 1) theta^2 / (2 rms^2)), cost together
    the square of the sum of the roots.
    """
    rms = spec.photoreceptor_noise
    if rms == 0.0:
        return 0.0, 1.0
    per_s = 1e6 / (2.0 * math.pi * math.sqrt(spec.photoreceptor_tau_us * spec.follower_tau_us))
    reach_nat = rms * math.sqrt(2.0 * math.log(2.0 + per_s * scene.seconds))
    thetas = spread_thresholds(min(spec.threshold_on, spec.threshold_off), spec, STEPS) / rms
    anywhere = math.sqrt(2.0 * math.pi) / thetas * np.array([math.erfc(theta / math.sqrt(8.0)) for theta in thetas])
    rates_hz = 2.0 * per_s * np.maximum(anywhere, np.exp(-0.125 * thetas**2))
    events = rates_hz * scene.seconds + 2.0 * reach_nat / rms / thetas
    farther = np.arange(1.0, 64.0)[:, None]
    less = np.exp(-0.5 * farther * (farther + 1.0) * thetas**2)
    costs = (1.0 + 2.0 * np.sqrt(less).sum(axis=0)) ** 2 / (1.0 + 2.0 * less.sum(axis=0))
    return at_most(scene.pixels * float(events.mean())), float(np.dot(costs, events) / events.sum())


def late_noise(scene: Scene, spec: Any, late_us: float) -> float:
    """Bound on the distance where all events of noise are later."""
    _, most = noise_events(scene, spec)
    bunched = 1.0 + 2.0 * DISTANCE_TAU_S * max(spec.shot_rate_hz, spec.hot_rate_hz if spec.hot_probability else 0.0)
    bunched = max(bunched, trembling(scene, spec)[1])
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
    dense: float | None = None,
) -> Omission:
    """The 99.9 % bound from one on the mean distance of events of light, which levels anywhere would make; infinite
    where nothing is known but how dense events are.  Signals are no further apart than by lag_s, and by themselves
    recordings are as dense as the sensor's, or as is said.  Events of the leak
    and of the photoreceptor's noise are other ones, too, and those of noise that a pixel is blind to.

    Where memories jump to the signal, it is an estimate (`kind_of`), unless it is how dense events are that counts.
    """
    spread = spread_of(spec)
    if scene.still and not spec.leak_rate_hz and not spec.photoreceptor_noise:
        return Omission(0.0, "99.9 % bound", figure, why, replace)
    noise, most = noise_events(scene, spec)
    unforced = _unforced(scene, spec)
    crowded = min(crowding(spec, scene), 1e9)
    light = crowded * scene.events
    swallowed = light * spec.refractory_us * 1e-6 * (most - unforced) / max(scene.pixels * scene.seconds, 1e-9)
    many = light + unforced + min(swallowed, noise)
    if not many:  # (as of a single picture)
        return Omission(0.0, "99.9 % bound", figure, why, replace)
    share = many / (many + noise)
    apart = apart_at_most(scene, spec, lag_s) if dense is None else unlike(scene, dense, lag_s)
    distance = max(apart, trembling(scene, spec)[1]) * share
    if not obstacle(spec) and math.isfinite(mean):
        mean += 0.0 if spread else reset(scene, spec) * apart
        sent = 1.0 - unsent(scene, spec).share
        mean *= readout_shifts(scene, spec)
        near = (mean + (1.0 - sent) * apart) * crowded
        least = max(scene.events - _missing(scene, spec), crossings(scene))
        per_event = scene.events / max(sent * least + noise, 1e-9)
        if near * per_event < distance:
            return Omission(surely(scene, near) * per_event, kind_of(spec), figure, why, replace)
    return Omission(surely(scene, distance / share) * share, "99.9 % bound", figure, why, replace)


def displaced(scene: Scene, spec: Any, rms_nat: float) -> float:
    """Bound on the mean distance where levels are off by an rms of up to rms_nat in any pixel; infinite where the leak
    sends events that move with them."""
    if rms_nat * DEVIATIONS >= scene.threshold or spec.leak_rate_hz > 0:
        return math.inf
    return off_by(scene, np.full(len(scene.travel), rms_nat), echoes=False)
