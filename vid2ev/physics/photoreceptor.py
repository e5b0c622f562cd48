"""Response time: a two-pole low-pass, exact for an input that is linear between frames.

    tau1 y1' = u - y1      (photoreceptor)        tau2 y2' = y1 - y2      (source follower)

u is the light itself (`filter = "before"` the log, the paper's order; the light is linear between frames) or its
logarithm (`filter = "after"`, v2e's; the log light is linear between frames).  Without poles that is all that is left
of the choice: `after` is then the model of ESIM.

The state is the **lag** of each pole, e1 = u - y1 and e2 = u - y2, not its output: lags are exact for a steady input,
contract for every step, and do not stall in float32 when the step is small against tau.  Over a fraction s of an
interval of length T in which u rises by du, with a = T/tau1 and b = T/tau2:

    y2(s) = y2(0) + du s + c1 (exp(-a s) - 1) + c2 (exp(-b s) - 1)
    c1 = -(e1 - du/a) b/(b-a)      c2 = -e2 + e1 b/(b-a) - du a / (b (b-a))

Two equal poles are held apart by 1e-4 of their mean (`separate`), which keeps the one formula.  The output depends on
the two alike, so it moves by the square of that: by (1e-4 t/tau)**2 / 24 of itself, and four digits of float64 cancel.

What leaving a pole out changes: an exponential of mean tau delays by tau on average, with variance tau^2, and as
u is straight but for its bends, shifting the events by tau is all that happens away from these.  A bend of the slope by
r is rounded off: within r reach of the shifted line, over an area of r variance / 2 (`stream/bounds.py: delayed`), with

    variance = tau1^2 + tau2^2 of the poles left out
    reach = E (D - E D)+ = tau/e for one,   <= sqrt(variance)/2 for two

At a turn from slope r to -r' the peaks differ by no more than sqrt(r r') sqrt(variance), whatever the distribution (H.
Scarf, "A min-max solution of an inventory problem", 1958), nor by more than r + r' times reach.  A first pole that
stays rounds off what the second does by reach <= tau2^2 / (2 tau1), and where the peak is still at the bend, r << r',
by 0.27 sqrt(tau1 / tau2) of that (found by trying all ratios; the tests do so again).  Before the log, bends are
relative to the light where they are.

Sources: the cascade is the paper's "two-pole low pass filter"; weights by the variation of constants (any text on
linear systems), checked against 60-digit arithmetic in the tests. `bandwidth = "light"` is v2e's intensity-dependent
first pole (Hu, Liu, Delbruck 2021): tau1(light) = tau1 (1 + dark)/(light + dark), dark = 20/255.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.kernel_compiler import compiled
from vid2ev.physics.elementary import exp64, expm1_32, expm1_64, fma, log64
from vid2ev.physics.log_curve import curve_of
from vid2ev.physics.omission import echoes, late_noise, omitted, tau_at, taus_of, tracks
from vid2ev.stream.bounds import delayed, later
from vid2ev.stream.scene import DISTANCE_TAU_S, QUARTER_EDGES, Omission, Scene

F = np.float32
_APART = 1e-4
_APART_RATES = 2e-7
FOLLOWER_OFF: dict[str, Any] = {"follower_tau_us": 0.0}
BOTH_OFF: dict[str, Any] = {"photoreceptor_tau_us": 0.0, "follower_tau_us": 0.0, "bandwidth": "constant"}


class Photoreceptor(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the response time."""

    photoreceptor_tau_us: float = Field(
        300.0, ge=0, le=1e12, description="time constant of the first pole at light 1 [us]; 0: none"
    )
    follower_tau_us: float = Field(100.0, ge=0, le=1e12, description="time constant of the second pole [us]; 0: none")
    filter: Literal["before", "after"] = Field(
        "before", description="the low-pass acts on the light before the log, or on its logarithm"
    )
    bandwidth: Literal["constant", "light"] = Field(
        "constant",
        description="first pole constant, or faster with light: tau1 (1 + bandwidth_dark)/(light + bandwidth_dark)",
    )
    bandwidth_dark: float = Field(
        20.0 / 255.0,
        gt=0,
        le=10,
        description="light below which the bandwidth no longer falls (bandwidth light)",
    )


class Weights(NamedTuple):
    """One step of the lags: e1 <- e1 - x1 e1 + w1 du;  e2 <- e2 - x2 e2 + g e1 + w2 du."""

    x1: float
    w1: float
    x2: float
    g: float
    w2: float


def phi1(x: float) -> float:
    """(1 - exp(-x)) / x for x >= 0, 1 at 0 and 0 at infinity."""
    if x == 0.0:
        return 1.0
    return -math.expm1(-x) / x


def separate(tau1: float, tau2: float) -> tuple[float, float]:
    """Both time constants, moved apart about their mean where they are closer than 1e-4 of it."""
    mean = 0.5 * (tau1 + tau2)
    if mean > 0.0 and abs(tau2 - tau1) < _APART * mean:
        return mean * (1.0 - 0.5 * _APART), mean * (1.0 + 0.5 * _APART)
    return tau1, tau2


def step_weights(dt: float, tau1: float, tau2: float) -> Weights:
    """Weights of a step dt for time constants in the same unit (either may be 0: no pole), in float64.

    The divided difference is taken as exp(-aL) phi1(aS - aL), L the slower and S the faster pole, which never cancels.
    """
    a1 = dt / tau1 if tau1 > 0 else math.inf
    a2 = dt / tau2 if tau2 > 0 else math.inf
    x1, w1 = -math.expm1(-a1), phi1(a1) if a1 < math.inf else 0.0
    if tau2 == 0.0:
        return Weights(x1, w1, 1.0, math.exp(-a1), w1)
    if tau1 == 0.0:
        return Weights(1.0, 0.0, -math.expm1(-a2), 0.0, phi1(a2))
    slow, fast = min(a1, a2), max(a1, a2)
    difference = math.exp(-slow) * phi1(fast - slow)
    g = a2 * difference if a2 < math.inf else math.exp(-a1)
    w2 = phi1(slow) + (-math.expm1(-slow) - slow * difference) / fast if fast > 0 else 1.0
    return Weights(x1, w1, -math.expm1(-a2), g, w2)


@compiled
def light_weights_32(a1, a2):
    """`step_weights` in float32 for a first pole that differs from pixel to pixel; a = dt/tau > 0."""
    slow, fast = min(a1, a2), max(a1, a2)
    x_slow = -expm1_32(-slow)
    apart = max(fast - slow, F(1e-6))
    difference = (F(1.0) - x_slow) * (-expm1_32(-apart) / apart)
    w2 = x_slow / slow + (x_slow - slow * difference) / fast
    x1, x2 = -expm1_32(-a1), -expm1_32(-a2)
    return x1, x1 / a1, x2, a2 * difference, w2


@compiled
def response_terms(du, e1, e2, a, b, two):
    """(c1, c2) of the response above; with one pole (`two` False) e1 is its lag, a its rate, and c2 is 0."""
    if not two:
        return du / a - e1, 0.0
    k = b / (b - a)
    return (du / a - e1) * k, e1 * k - e2 - du * (a / (b * (b - a)))


@compiled
def response(s, y0, du, c1, c2, a, b):
    """y(s): the filtered signal at a fraction s of the interval."""
    return y0 + fma(c2, expm1_64(-b * s), fma(c1, expm1_64(-a * s), du * s))


@compiled
def response_slope(s, du, c1, c2, a, b):
    """dy/ds at a fraction s of the interval."""
    return du - a * c1 * exp64(-a * s) - b * c2 * exp64(-b * s)


@compiled
def slope_zero(lo, hi, slope_lo, du, c1, c2, a, b):
    """Where the slope changes sign in [lo, hi]: bracketed Newton steps, to 1e-8 of the faster time constant."""
    enough = 1e-8 / max(1.0, max(a, b))
    s = 0.5 * (lo + hi)
    for k in range(60):
        k1, k2 = a * c1 * exp64(-a * s), b * c2 * exp64(-b * s)
        slope = du - k1 - k2
        if (slope > 0.0) == (slope_lo > 0.0):
            lo = s
        else:
            hi = s
        newton = s - slope / (a * k1 + b * k2)
        here = newton if (newton > lo) & (newton < hi) & (k % 4 != 3) else 0.5 * (lo + hi)
        if abs(here - s) < enough:
            return here
        s = here
    return s


@compiled
def turning_points(at_0, at_1, du, c1, c2, a, b):
    """The interior extrema of y, in order, each 1.0 where there is none; at_0, at_1 are the slopes at the ends.

    The slope is a constant and two exponentials: it has at most two zeros, and at most one turning point of its own, at
    the inflection.  Unequal signs at the ends mean one zero, equal signs none, or two if the inflection has the other.
    """
    ratio = -(b * b * c2) / (a * a * c1)
    inflection = log64(ratio) / (b - a) if (ratio > 1e-300) & (ratio < 1e300) else -1.0
    inside = (inflection > 0.0) & (inflection < 1.0)
    if (at_0 > 0.0) != (at_1 > 0.0):
        # Bracketed on the side of the inflection where the sign changes, so that bisection cannot meet two zeros.
        if inside:
            middle = response_slope(inflection, du, c1, c2, a, b)
            if (middle > 0.0) == (at_0 > 0.0):
                return slope_zero(inflection, 1.0, middle, du, c1, c2, a, b), 1.0
            return slope_zero(0.0, inflection, at_0, du, c1, c2, a, b), 1.0
        return slope_zero(0.0, 1.0, at_0, du, c1, c2, a, b), 1.0
    if inside:
        middle = response_slope(inflection, du, c1, c2, a, b)
        if (middle > 0.0) != (at_0 > 0.0):
            first = slope_zero(0.0, inflection, at_0, du, c1, c2, a, b)
            return first, slope_zero(inflection, 1.0, middle, du, c1, c2, a, b)
    return 1.0, 1.0


@compiled
def separate_rates(a, b):
    """a, moved away from b where the two rates are closer than 2e-7 of b: for a first pole that differs from pixel to
    pixel, and so is hardly ever that close."""
    return b * (1.0 + _APART_RATES) if (b > 0.0) & (abs(a - b) < _APART_RATES * b) else a


def steepest(scene: Scene, spec: Any) -> np.ndarray:
    """Bound on the slope of the comparator's input [tiles, nat/s].

    A filtered signal's slope is a mean of its input's (and before the log both are means by one weight).  A pole that
    is faster in the light may follow a change in the dark with the speed of the light.
    """
    if spec.bandwidth != "light" or spec.photoreceptor_tau_us == 0:
        return scene.slope_max
    dark = min(spec.bandwidth_dark, spec.dark_level) if spec.log_curve == "offset" else spec.bandwidth_dark
    return scene.slope_max * (scene.light_max + spec.bandwidth_dark) / (scene.light_min + dark)


def slopes_of(scene: Scene, spec: Any) -> np.ndarray:
    """Bound on the slope of the comparator's input in each quarter of an octave of `Scene.by_slope` [nat/s]."""
    faster = float((steepest(scene, spec) / np.maximum(scene.slope_max, 1e-30)).max())
    return slopes_at(scene) * max(faster, 1.0)


def slopes_at(scene: Scene) -> np.ndarray:
    """The greatest slope in each quarter of an octave of `Scene.by_slope` [nat/s]."""
    slopes = np.minimum(QUARTER_EDGES[1:], float(scene.slope_max.max()))
    slopes[-1] = float(scene.slope_max.max())
    return slopes


def omission_of_follower(scene: Scene, spec: Any) -> Omission:
    """The second pole alone, replaced by its mean delay."""
    square_s2 = (spec.follower_tau_us * 1e-6) ** 2
    variance_s2, reach_s = np.full(len(scene.travel), square_s2), reach_of_follower(scene, spec)
    return _delay_instead(scene, spec, spec.follower_tau_us, variance_s2, reach_s, 0.0, FOLLOWER_OFF, stir_s2=square_s2)


def reach_of_follower(scene: Scene, spec: Any) -> np.ndarray:
    """By how much the second pole rounds off a bend of the slope by 1, at most, behind the first [tiles, s]."""
    fastest_s, tau2_s = 1e-6 * taus_of(scene, spec)[0], spec.follower_tau_us * 1e-6
    ratio = tau2_s / np.maximum(fastest_s, 1e-30)
    smoothed_s = 0.5 * tau2_s * ratio * np.maximum(1.0, 0.27 / np.sqrt(ratio))
    return np.asarray(np.minimum(smoothed_s, tau2_s / math.e))


def omission(scene: Scene, spec: Any) -> Omission:
    """Both poles, replaced by their mean delay at the light where the events are."""
    _, slowest_s = (each * 1e-6 for each in taus_of(scene, spec))
    tau2_s = spec.follower_tau_us * 1e-6
    variance_s2 = slowest_s**2 + tau2_s**2
    reach_s = 0.5 * np.sqrt(variance_s2) if tau2_s else slowest_s / math.e
    usual_us, late_us = delay_at_events(scene, spec)
    late_us += _changing_us(scene, spec)
    stir_s2 = float(variance_s2.max()) + _left_by_light(spec, slowest_s)
    return _delay_instead(
        scene, spec, usual_us + spec.follower_tau_us, variance_s2, reach_s, late_us, BOTH_OFF, stir_s2=stir_s2
    )


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
    rounded = delayed(scene, 0.0 * slowest_s, slowest_s / math.e, echoes=echoes(spec), stir_s2=stir_s2)
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
    reach_s: np.ndarray,
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
    mean = delayed(scene, variance_s2, reach_s, echoes=echoes(spec), stir_s2=stir_s2)
    mean += later(scene, 1e-6 * late_us) + 1e-6 * rounded_us / DISTANCE_TAU_S
    why = f"a delay of {delay_us:g} us instead; what is left are rounded bends"
    if late_us > 0.0:
        why += f", and {late_us:.3g} us by the light"
    if spec.timing != "response":
        mean, why = math.inf, f"timing {spec.timing} takes the signal at the frames"
    said = omitted(scene, spec, mean, spread, why, (*off.items(), ("delay_us", delay_us)), lag_s=lag_s(scene, spec))
    return replace(said, distance=(said.distance or 0.0) + late_noise(scene, spec, poles_us))
