"""Photoreceptor noise: white noise through the two poles, added to the comparator's input.

    tau1 n1' = -n1 + white      tau2 n2' = n1 - n2      rms of n2 = photoreceptor_noise [nat]

Its rate of up-crossings of a level theta away is Rice's (*Mathematical analysis of random noise*, 1944):

    nu(theta) = exp(-theta^2 / (2 sigma^2)) / (2 pi sqrt(tau1 tau2))

Not all of these are the first: its slope is rough, so that it comes back over the level at once, and the pixel, which
waits for a threshold in between, sends nothing.  The share of those that are,

    fresh(theta) = 1 - exp(-1.9 z^0.85),    z = max(theta / sigma, 2) sqrt(tau1 tau2) / (tau1 + tau2)

is that of an absorbing level; at 3 sigma 0.93 for poles that are alike, 0.8 where one is ten times as fast as the
other, 0.5 where it is a hundred times.

Where the interval **resolves** it (dt <= tau2 / RESOLVED) the pair (n1, n2) takes one exact step of its Gaussian
process per interval, and the line between its ends is added to the signal.  Where it does not, sampling would miss
most crossings; events are then a Poisson process of the rate nu fresh at the distance the level has at each instant,
whatever the frame rate, though the path within an interval is another; the tick is the interval's number.  From 3 sigma
on it sends within a tenth as much as the process itself; at 2 sigma, hundreds of events a second, a tenth more.  The
process is that of light 1.0 also where the first pole is slower in the dark (`bandwidth = "light"`).

What is not resolved leaves a level and is back at once, so that of a pixel with a refractory period, however short,
the way back is never sent: half as many events.  The noise itself stays away for a while.  Events per second of poles
of 300 and 100 us at 3 sigma:

    refractory_us        none   100   1000   100, `track`   1000, `track`
    resolved               36    36     25             73              34
    not resolved           37    18     18             18              18

Source: Rice 1944 for the rate; the covariance of white noise through two poles is ours, checked in the tests.  `fresh`
is ours, too, fitted to noise that was followed step by step, to 0.03 for theta = 2.5 to 4 sigma, tau2 = 0.1 to 1 tau1;
where the poles are far apart it tends to sqrt(2 pi) z, the rate of diffusion over a level.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.chances import surely
from vid2ev.bounds.distance import added
from vid2ev.bounds.scene import Omission, Scene
from vid2ev.compiling.compiler import compiled, inlined
from vid2ev.physics.elementary import exp64, log64
from vid2ev.physics.omission import apart_at_most, light_events, trembling
from vid2ev.physics.photoreceptor import step_weights
from vid2ev.physics.random import PHOTORECEPTOR, RICE, normal_pair, philox, unit

RESOLVED = 8.0
NEAR, FAR = 2.0, 40.0  # standard deviations: nearer, all is one; farther, nothing is crossed


class PhotoreceptorNoise(BaseModel, frozen=True, extra="forbid"):
    """Parameter of the photoreceptor noise."""

    photoreceptor_noise: float = Field(
        0.0,
        ge=0,
        le=10,
        description="rms of the noise at the comparator's input [nat]; needs two time constants",
    )


class NoiseStep(NamedTuple):
    """n1 <- keep1 n1 + s11 z1;  n2 <- keep2 n2 + mix n1 + s21 z1 + s22 z2."""

    keep1: float
    mix: float
    keep2: float
    s11: float
    s21: float
    s22: float


def noise_step(dt: float, tau1: float, tau2: float, rms: float, fresh: bool) -> NoiseStep:
    """The exact step of the pair; `fresh` draws it from its stationary distribution instead."""
    p11, p12 = rms**2 * (tau1 + tau2) / tau1, rms**2
    keep1 = mix = keep2 = 0.0
    if not fresh:
        weights = step_weights(dt, tau1, tau2)
        keep1, mix, keep2 = 1.0 - weights.x1, weights.g, 1.0 - weights.x2
    q11 = p11 * (1.0 - keep1 * keep1)
    q12 = p12 - keep1 * (mix * p11 + keep2 * p12)
    q22 = p12 - (mix * mix * p11 + 2.0 * mix * keep2 * p12 + keep2 * keep2 * p12)
    s11 = math.sqrt(max(q11, 0.0))
    s21 = q12 / s11 if s11 > 0 else 0.0
    return NoiseStep(keep1, mix, keep2, s11, s21, math.sqrt(max(q22 - s21 * s21, 0.0)))


@inlined
def noise_draw(n1, n2, pixel, num, iv):
    """The pair after one interval (float32)."""
    words = philox(num.seed, PHOTORECEPTOR + 256 * num.camera, pixel, iv.step)
    z1, z2 = normal_pair(words[0], words[1])
    z1, z2 = np.float32(z1), np.float32(z2)
    first = iv.noise_keep1 * n1 + iv.noise_s11 * z1
    second = (iv.noise_keep2 * n2 + iv.noise_mix * n1) + (iv.noise_s21 * z1 + iv.noise_s22 * z2)
    return first, second


@compiled
def rice_expected(to_on, to_off, num, iv):
    """Up-crossings of the ON level and down-crossings of the OFF level in one interval, at these distances [nat]."""
    on, off = max(to_on, 0.0) / num.noise_rms, max(to_off, 0.0) / num.noise_rms
    per_interval = iv.dt_ns / (2.0 * math.pi * math.sqrt(num.tau1_ns * num.tau2_ns))
    return per_interval * (exp64(-0.5 * on * on) + exp64(-0.5 * off * off))


@compiled
def fresh_share(distance, num):
    """The share of crossings of a level at this distance [nat] that are the first since the noise was around 0."""
    poles = math.sqrt(num.tau1_ns * num.tau2_ns) / (num.tau1_ns + num.tau2_ns)
    z = poles * min(max(distance / num.noise_rms, NEAR), FAR)
    return 1.0 - exp64(-1.9 * exp64(0.85 * log64(z)))


@compiled
def rice_words(pixel, k, num, iv):
    """What is drawn for candidate k of a pixel in this interval: words for its wait, and for its chance."""
    return philox(num.seed, RICE + 256 * num.camera, pixel, (iv.step << 24) + k)


@compiled
def rice_gap(pixel, k, num, iv):
    """The exponential number that stands for the wait of candidate k."""
    return -log64(unit(rice_words(pixel, k, num, iv)[0]))


def omission(scene: Scene, spec: Any) -> Omission:
    """The noise: events come where it spans a threshold (`omission.trembling`); all others move."""
    extra, bunched = trembling(scene, spec)
    rate_hz = extra / max(scene.pixels * scene.seconds, 1e-9)
    distance = surely(scene, apart_at_most(scene, spec)) + added(light_events(scene, spec), extra, 0.0) * bunched
    why = f"{extra:.0f} events at most, and all others move by noise over slope"
    return Omission(distance, "99.9 % bound", f"{rate_hz:.3g} events/pixel/s", why)
