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

What leaving a pole out changes: `photoreceptor_omission.py`.

Sources: the cascade is the paper's "two-pole low pass filter"; weights by the variation of constants (any text on
linear systems), checked against 60-digit arithmetic in the tests. `bandwidth = "light"` is v2e's intensity-dependent
first pole (Hu, Liu, Delbruck 2021): tau1(light) = tau1 (1 + dark)/(light + dark), dark = 20/255; in an interval between
two frames it is that of their mean light.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.compiling.compiler import compiled
from vid2ev.compiling.intrinsics import fma
from vid2ev.physics.elementary import exp64, expm1_32, expm1_64, log64

F = np.float32
_APART = 1e-4
_APART_RATES = 2e-7


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
def light_weights_64(a1, a2):
    """The same in float64."""
    slow, fast = min(a1, a2), max(a1, a2)
    x_slow = -expm1_64(-slow)
    apart = max(fast - slow, 1e-12)
    difference = exp64(-slow) * (-expm1_64(-apart) / apart)
    w2 = x_slow / slow + (x_slow - slow * difference) / fast
    x1, x2 = -expm1_64(-a1), -expm1_64(-a2)
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
    """Where the slope changes sign in [lo, hi]: bracketed Newton steps, to 1e-8 of the faster time constant, from where
    two of its three parts cancel each other."""
    enough = 1e-8 / max(1.0, max(a, b))
    first = (a < b) | (b == 0.0)  # (the only pole, or the slower one)
    s = balance(a * c1 if first else b * c2, du, a if first else b, lo, hi)
    s = s if s > lo else balance(b * c2, -a * c1, b - a, lo, hi)
    s, step = s if s > lo else 0.5 * (lo + hi), hi - lo
    for _ in range(60):
        k1, k2 = a * c1 * exp64(-a * s), b * c2 * exp64(-b * s)
        slope = du - k1 - k2
        if (slope > 0.0) == (slope_lo > 0.0):
            lo = s
        else:
            hi = s
        here = bracketed(s - slope / (a * k1 + b * k2), s, lo, hi, step)
        step = abs(here - s)
        if step < enough:
            return here
        s = here
    return s


@compiled
def bracketed(there, s, lo, hi, step):
    """Where to look next for a root in [lo, hi]: `there` if it is within and the step from s is half of the last one at
    most, else the middle.  Either the steps or the bracket are halved, so this ends whatever the function."""
    return there if (there >= lo) & (there <= hi) & (abs(there - s) <= 0.5 * step) else 0.5 * (lo + hi)


@compiled
def balance(k, other, rate, lo, hi):
    """Where k exp(-rate s) has fallen to `other`, if that is between lo and hi; otherwise lo."""
    ratio = k / other
    usable = (ratio > 1e-300) & (ratio < 1e300)
    s = log64(ratio if usable else 1.0) / rate
    return s if usable & (s > lo) & (s < hi) else lo


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
