"""What leaving a pole of the response time out changes (`photoreceptor.py` has the law).

An exponential of mean tau delays by tau on average, with variance tau^2, and as light is straight but for its bends,
shifting the events by tau is all that happens away from these.  A bend of the slope by r is rounded off: within r reach
of the shifted line, over an area of r variance / 2 (`stream/bounds.py: delayed`), with

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
from typing import Any

import numpy as np

from vid2ev.physics.log_curve import curve_of
from vid2ev.physics.omission import echoes, late_noise, omitted, tau_at, taus_of, tracks
from vid2ev.physics.slopes import slopes_at
from vid2ev.stream.bounds import delayed, later
from vid2ev.stream.scene import DISTANCE_TAU_S, QUARTER_EDGES, Omission, Scene

FOLLOWER_OFF: dict[str, Any] = {"follower_tau_us": 0.0}
BOTH_OFF: dict[str, Any] = {"photoreceptor_tau_us": 0.0, "follower_tau_us": 0.0, "bandwidth": "constant"}


def omission_of_follower(scene: Scene, spec: Any) -> Omission:
    """The second pole alone, replaced by its mean delay."""
    square_s2 = (spec.follower_tau_us * 1e-6) ** 2
    variance_s2 = np.full(len(scene.travel), square_s2)
    at_turns = scene.off_peaks, scene.by_peaks
    return _delay_instead(
        scene, spec, spec.follower_tau_us, variance_s2, at_turns, 0.0, FOLLOWER_OFF, stir_s2=square_s2
    )


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
    reach_s = 0.5 * np.sqrt(variance_s2) if tau2_s else slowest_s / math.e
    usual_us, late_us = delay_at_events(scene, spec)
    late_us += _changing_us(scene, spec)
    stir_s2 = float(variance_s2.max()) + _left_by_light(spec, slowest_s)
    poles_us, at_turns = usual_us + spec.follower_tau_us, _rounded_off(scene, reach_s)
    return _delay_instead(scene, spec, poles_us, variance_s2, at_turns, late_us, BOTH_OFF, stir_s2=stir_s2)


def omission_of_bandwidth(scene: Scene, spec: Any) -> Omission:
    """The first pole's dependence on light: events are late by what its time constant differs by."""
    late_us = delay_at_events(scene, spec, spec.photoreceptor_tau_us)[1] + _changing_us(scene, spec)
    figure, why = f"{late_us:.3g} us on average", "the first pole is slower in the dark"
    return omitted(scene, spec, _late(scene, spec, late_us), figure, why, lag_s=lag_s(scene, spec))


def otherwise_late(scene: Scene, spec: Any, gains: tuple[float, ...]) -> float:
    """Bound on the mean distance where the first pole, whose bandwidth depends on light, sees light / gain."""
    taus, edges, travel = tau_at(QUARTER_EDGES[:-1], spec), QUARTER_EDGES[:-1], scene.by_light[0]
    changes = (np.dot(np.abs(tau_at(edges / gain, spec) - taus), travel) for gain in gains)
    late_us = max(map(float, changes)) / max(float(travel.sum()), 1e-300)
    return _late(scene, spec, late_us + _changing_us(scene, spec))


def _changing_us(scene: Scene, spec: Any) -> float:
    """By how much the delay differs from the time constant at the events, as that changes meanwhile, on average.

    The delay of a pole of changing tau is smoothed by that pole, D' = (tau - D) / tau, so |D - tau| is no more on
    average than tau |tau'| = tau^2 |u'| / (u + bandwidth_dark), nor than tau; by Cauchy and Schwarz, as slopes and
    lights of the events are known apart.
    """
    if spec.bandwidth != "light" or scene.still:
        return 0.0
    taus_s, light = 1e-6 * tau_at(QUARTER_EDGES[:-1], spec), scene.by_light[0]
    seen = taus_s[light > 0.0]
    floor = curve_of(spec.log_curve, spec.dark_level).floor
    slopes = np.minimum(slopes_at(scene) * max(floor / spec.bandwidth_dark, 1.0), 1.0 / seen.min())
    fourth = float(np.dot(taus_s**4, light)) / float(light.sum())
    return 1e6 * math.sqrt(fourth * float(np.dot(slopes**2, scene.by_slope[0])) / float(scene.by_slope[0].sum()))


def _late(scene: Scene, spec: Any, late_us: float) -> float:
    """Bound on the mean distance where a first pole is faster or slower, by so much at the events on average."""
    _, slowest_s = (each * 1e-6 for each in taus_of(scene, spec))
    stir_s2 = _left_by_light(spec, slowest_s)
    frozen_nat, after_turns = _rounded_off(scene, slowest_s / math.e)
    rounded = delayed(scene, 0.0 * slowest_s, frozen_nat, echoes(spec) * after_turns, stir_s2=stir_s2)
    return rounded + later(scene, 1e-6 * late_us)


def lag_s(scene: Scene, spec: Any) -> np.ndarray:
    """For how long signals through the poles, or delayed in their place, may go another way than the light [tiles, s]:
    until one in fifty is left of a bend."""
    _, slowest_us = taus_of(scene, spec)
    return np.asarray(4e-6 * (slowest_us + spec.follower_tau_us))


def _left_by_light(spec: Any, slowest_s: np.ndarray) -> float:
    """What a bend leaves in memories as the delay changes with light while the pixel is blind [s^2]."""
    depends = spec.bandwidth == "light" and spec.photoreceptor_tau_us > 0
    return float(slowest_s.max()) * spec.refractory_us * 1e-6 if depends and tracks(spec) else 0.0


def delay_at_events(scene: Scene, spec: Any, chosen_us: float | None = None) -> tuple[float, float]:
    """A time constant of the first pole [us], by default that of the median event, and by how much those of all events
    differ from it, on average."""
    taus, travel = tau_at(QUARTER_EDGES[:-1], spec), scene.by_light[0]
    if chosen_us is None:
        chosen_us = float(taus[np.searchsorted(np.cumsum(travel), 0.5 * travel.sum())])
    return chosen_us, float(np.dot(np.abs(taus - chosen_us), travel)) / max(float(travel.sum()), 1e-300)


def _delay_instead(
    scene: Scene,
    spec: Any,
    poles_us: float,
    variance_s2: np.ndarray,
    at_turns: tuple[np.ndarray, np.ndarray],
    late_us: float,
    off: dict[str, Any],
    *,
    stir_s2: float,
) -> Omission:
    spread = f"{math.sqrt(variance_s2.max()) * 1e6:.3g} us of spread"
    if spec.photoreceptor_noise > 0:
        return Omission(None, "no bound yet", spread, "photoreceptor noise needs both poles")
    if scene.still:
        return Omission(0.0, "99.9 % bound", spread, "nothing moves")
    delay_us = float(f"{spec.delay_us + poles_us:.6g}")
    rounded_us = abs(delay_us - math.floor(delay_us + 0.5))
    frozen_nat, after_turns = at_turns
    mean = delayed(scene, variance_s2, frozen_nat, echoes(spec) * after_turns, stir_s2=stir_s2)
    mean += later(scene, 1e-6 * late_us) + 1e-6 * rounded_us / DISTANCE_TAU_S
    both = " of both poles" if off is BOTH_OFF and spec.follower_tau_us else ""
    why = f"a delay of {delay_us:g} us in place{both}; what is left are rounded bends"
    if late_us > 0.0:
        why += f", and {late_us:.3g} us by the light"
    if spec.timing != "response":
        mean, why = math.inf, f"timing {spec.timing} takes the signal at the frames"
    said = omitted(scene, spec, mean, spread, why, (*off.items(), ("delay_us", delay_us)), lag_s=lag_s(scene, spec))
    return replace(said, distance=(said.distance or 0.0) + late_noise(scene, spec, poles_us))
