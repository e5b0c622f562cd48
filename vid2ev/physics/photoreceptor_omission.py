"""What leaving a pole of the response time out changes (`photoreceptor.py` has the law).

An exponential of mean tau delays by tau on average, with variance tau^2, and as light is straight but for its bends,
shifting the events by tau is all that happens away from these.  A bend of the slope by r is rounded off: within r reach
of the shifted line, over an area of r variance / 2 (`bounds/distance.py: delayed`), with

    variance = tau1^2 + tau2^2 of the poles left out
    reach = E (D - E D)+ = tau/e for one,   <= sqrt(variance)/2 for two

At a turn from slope r to -r' the peaks differ by no more than sqrt(r r') sqrt(variance), whatever the distribution (H.
Scarf, "A min-max solution of an inventory problem", 1958), nor by more than r + r' times reach; by what the second pole
takes from the peaks of a first that stays, `peaks.py` has the law.  Before the log, bends are relative to the light
where they are.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vid2ev.bounds.chances import at_most
from vid2ev.bounds.distance import PIXELS_DIFFER, Left, delayed, later, steeper
from vid2ev.bounds.scene import DISTANCE_TAU_S, QUARTER_EDGES, Omission, Scene
from vid2ev.physics.log_curve import curve_of
from vid2ev.physics.omission import echoes, late_noise, levels_between, omitted, tau_at, taus_of, tracks
from vid2ev.physics.slopes import slopes_at

FOLLOWER_OFF: dict[str, Any] = {"follower_tau_us": 0.0}
BOTH_OFF: dict[str, Any] = {"photoreceptor_tau_us": 0.0, "follower_tau_us": 0.0, "bandwidth": "constant"}


def omission_of_follower(scene: Scene, spec: Any) -> Omission:
    """The second pole alone, replaced by its mean delay."""
    tau2_s = spec.follower_tau_us * 1e-6
    fastest_s = 1e-6 * float(taus_of(scene, spec)[0].min())
    share = float(_reach_s(0.0, tau2_s) / _reach_s(fastest_s, tau2_s))
    left_out = LeftOut(
        spec.follower_tau_us,
        np.full(len(scene.travel), tau2_s**2),
        scene.off_peaks_often,
        scene.by_peaks,
        0.5 * tau2_s**2 * steeper(scene.by_felt, share),
        0.0,  # (of peaks that is counted)
        Left(tau2_s**2, _at_events(scene, _second_reach_s(_taus_s(spec), tau2_s)), 0.0),
    )
    return _delay_instead(scene, spec, left_out, 0.0, FOLLOWER_OFF)


def _reach_s(tau1_s: Any, tau2_s: float) -> Any:
    """E (D - E D)+ of two poles at most, or of one."""
    slower_s = np.maximum(tau1_s, tau2_s)
    return np.where(np.minimum(tau1_s, tau2_s) > 0.0, 0.5 * np.hypot(tau1_s, tau2_s), slower_s / math.e)


def _second_reach_s(tau1_s: np.ndarray, tau2_s: float) -> np.ndarray:
    """The same of the second pole behind the first (`peaks.second_reach`)."""
    ratio = tau2_s / np.maximum(tau1_s, 1e-30)
    return tau2_s * np.minimum(0.5 * ratio * np.maximum(1.0, 0.27 / np.sqrt(np.maximum(ratio, 1e-30))), 1.0 / math.e)


def _rounded_off(scene: Scene, reach_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By how much signals differ at turns, where bends are rounded off within reach [tiles, nat]; the travel that
    counts, by the sum of that before it."""
    travel, bends = scene.by_bends
    return reach_s * scene.bend_at_turns, np.stack([travel, float(reach_s.max()) * bends])


def omission(scene: Scene, spec: Any) -> Omission:
    """Both poles, replaced by their mean delay at the light where the events are."""
    _, slowest_s = (each * 1e-6 for each in taus_of(scene, spec))
    tau2_s = spec.follower_tau_us * 1e-6
    variance_s2 = slowest_s**2 + tau2_s**2
    reach_s = _reach_s(slowest_s, tau2_s)
    usual_us, late_us = delay_at_events(scene, spec)
    late_us += _changing_us(scene, spec)
    at_events_s = _taus_s(spec)
    left_out = LeftOut(
        usual_us + spec.follower_tau_us,
        variance_s2,
        *_rounded_off(scene, reach_s),
        0.5 * float(variance_s2.max()) * steeper(scene.by_felt, 1.0),
        float(reach_s.max()) * steeper(scene.by_felt_at_turns, 1.0),
        Left(
            _at_events(scene, at_events_s**2) + tau2_s**2,
            _at_events(scene, _reach_s(at_events_s, tau2_s)),
            _left_by_light(scene, spec),
        ),
    )
    return _delay_instead(scene, spec, left_out, late_us, BOTH_OFF)


def omission_of_bandwidth(scene: Scene, spec: Any) -> Omission:
    """The first pole's dependence on light: events are late by what its time constant differs by."""
    late_us = delay_at_events(scene, spec, spec.photoreceptor_tau_us)[1] + _changing_us(scene, spec)
    figure, why = f"{late_us:.3g} us on average", "the first pole is slower in the dark"
    return omitted(scene, spec, _late(scene, spec, late_us), figure, why, lag_s=lag_s(scene, spec))


def otherwise_late(scene: Scene, spec: Any, gains: tuple[float, ...]) -> float:
    """Bound on the mean distance where the first pole, whose bandwidth depends on light, sees light / gain."""
    taus, edges = tau_at(QUARTER_EDGES[:-1], spec), QUARTER_EDGES[:-1]
    late_us = max(_at_events(scene, np.abs(tau_at(edges / gain, spec) - taus)) for gain in gains)
    return _late(scene, spec, late_us + _changing_us(scene, spec))


def _changing_us(scene: Scene, spec: Any) -> float:
    """By how much the delay differs from the time constant at the events, as that changes meanwhile, on average.

    The delay of a pole of changing tau is smoothed by that pole, D' = (tau - D) / tau, so |D - tau| is no more on
    average than tau |tau'| = tau^2 |u'| / (u + bandwidth_dark), nor than tau; by Cauchy and Schwarz, as slopes and
    lights of the events are known apart.
    """
    if spec.bandwidth != "light" or scene.still:
        return 0.0
    taus_s = _taus_s(spec)
    seen = taus_s[scene.by_light[0] > 0.0]
    floor = curve_of(spec.log_curve, spec.dark_level).floor
    slopes = np.minimum(slopes_at(scene) * max(floor / spec.bandwidth_dark, 1.0), 1.0 / seen.min())
    fourth = _at_events(scene, taus_s**4)
    return 1e6 * math.sqrt(fourth * float(np.dot(slopes**2, scene.by_slope[0])) / float(scene.by_slope[0].sum()))


def _late(scene: Scene, spec: Any, late_us: float) -> float:
    """Bound on the mean distance where a first pole is faster or slower, by so much at the events on average."""
    _, slowest_s = (each * 1e-6 for each in taus_of(scene, spec))
    left = Left(0.0, 0.0, _left_by_light(scene, spec))
    frozen_nat, after_turns = _rounded_off(scene, slowest_s / math.e)
    frozen_nat = frozen_nat * levels_between(2.0 * scene.slope_max * slowest_s / math.e, spec)
    rounded = delayed(scene, 0.0 * slowest_s, frozen_nat, echoes(spec) * after_turns, left=left)
    return rounded + _at_other_times(scene, spec, late_us)


def _at_other_times(scene: Scene, spec: Any, late_us: float) -> float:
    """Bound on the mean distance where events are early or late, by so much on average."""
    apart_nat = PIXELS_DIFFER * 1e-6 * late_us * scene.slope_max
    return later(scene, 1e-6 * late_us, levels_between(apart_nat, spec))


def lag_s(scene: Scene, spec: Any) -> np.ndarray:
    """For how long signals through the poles, or delayed in their place, may go another way than the light [tiles, s]:
    until one in fifty is left of a bend."""
    _, slowest_us = taus_of(scene, spec)
    return np.asarray(4e-6 * (slowest_us + spec.follower_tau_us))


def _left_by_light(scene: Scene, spec: Any) -> float:
    """What a bend leaves in memories as the delay changes with light while the pixel is blind [s^2]."""
    if spec.bandwidth != "light" or not tracks(spec):
        return 0.0
    return _at_events(scene, _taus_s(spec)) * spec.refractory_us * 1e-6


def _taus_s(spec: Any) -> np.ndarray:
    """Time constant of the first pole at each quarter of an octave of light [s]."""
    return 1e-6 * tau_at(QUARTER_EDGES[:-1], spec)


def _at_events(scene: Scene, at_light: np.ndarray) -> float:
    """The mean, over all events of light, of what is so at each quarter of an octave of it."""
    travel = scene.by_light[0]
    return float(np.dot(at_light, travel)) / max(float(travel.sum()), 1e-300)


def delay_at_events(scene: Scene, spec: Any, chosen_us: float | None = None) -> tuple[float, float]:
    """A time constant of the first pole [us], by default that of the median event, and by how much those of all events
    differ from it, on average."""
    taus, travel = tau_at(QUARTER_EDGES[:-1], spec), scene.by_light[0]
    if chosen_us is None:
        chosen_us = float(taus[np.searchsorted(np.cumsum(travel), 0.5 * travel.sum())])
    return chosen_us, _at_events(scene, np.abs(taus - chosen_us))


class LeftOut(NamedTuple):
    """Poles that are left out.

    mean_us, variance_s2         of their delay, the variance [tiles]
    frozen_nat, after_turns      what signals differ by at turns, and the travel after that (`delayed`)
    steep_nat_s, steep_nat       likewise
    left                         what a bend leaves in memories
    """

    mean_us: float
    variance_s2: np.ndarray
    frozen_nat: np.ndarray
    after_turns: np.ndarray
    steep_nat_s: float
    steep_nat: float
    left: Left


def _rounded_us(off_us: float, events: float) -> float:
    """By how much later or earlier events are in the mean of which each is so with a chance, by 1 us, as times are of
    whole microseconds: of few events more of them may be than is to be expected."""
    return min(at_most(off_us * events) / max(events, 1e-9), 1.0)


def _delay_instead(scene: Scene, spec: Any, poles: LeftOut, late_us: float, off: dict[str, Any]) -> Omission:
    spread = f"{math.sqrt(poles.variance_s2.max()) * 1e6:.3g} us of spread"
    if spec.photoreceptor_noise > 0:
        return Omission(None, "no bound yet", spread, "photoreceptor noise needs both poles")
    if scene.still:
        return Omission(0.0, "99.9 % bound", spread, "nothing moves")
    delay_us = float(f"{spec.delay_us + poles.mean_us:.6g}")
    rounded_us = _rounded_us(abs(delay_us - math.floor(delay_us + 0.5)), scene.events)
    mean = delayed(
        scene,
        poles.variance_s2,
        poles.frozen_nat,
        echoes(spec) * poles.after_turns,
        steep_nat_s=poles.steep_nat_s,
        steep_nat=poles.steep_nat,
        left=poles.left,
    )
    mean += _at_other_times(scene, spec, late_us) + 1e-6 * rounded_us / DISTANCE_TAU_S
    both = " of both poles" if off is BOTH_OFF and spec.follower_tau_us else ""
    why = f"a delay of {delay_us:g} us in place{both}; what is left are rounded bends"
    if late_us > 0.0:
        why += f", and {late_us:.3g} us by the light"
    if spec.timing != "response":
        mean, why = math.inf, f"timing {spec.timing} takes the signal at the frames"
    said = omitted(scene, spec, mean, spread, why, (*off.items(), ("delay_us", delay_us)), lag_s=lag_s(scene, spec))
    return replace(said, distance=(said.distance or 0.0) + late_noise(scene, spec, poles.mean_us))
