"""Photoreceptor noise: white noise through the two poles, added to the comparator's input.

    tau1 n1' = -n1 + white      tau2 n2' = n1 - n2      rms of n2 = photoreceptor_noise [nat]

Its rate of up-crossings of a level theta away is Rice's (*Mathematical analysis of random noise*, 1944):

    nu(theta) = exp(-theta^2 / (2 sigma^2)) / (2 pi sqrt(tau1 tau2))

Where the interval **resolves** it (dt <= tau2 / RESOLVED) the pair (n1, n2) takes one exact step of its Gaussian
process per interval, and the line between its ends is added to the signal.  Where it does not, sampling would miss
most crossings; events are then a Poisson process of Rice's rate at the distance the level has at each instant.  So the
event rate does not depend on the frame rate, though the path within an interval does; the tick is the interval's
number.

Source: Rice 1944 for the rate; the covariance of white noise through two poles is ours, checked in the tests.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.kernel_compiler import compiled, inlined
from vid2ev.physics.elementary import exp64, log64
from vid2ev.physics.omission import light_events, trembling
from vid2ev.physics.photoreceptor import step_weights
from vid2ev.physics.random import PHOTORECEPTOR, RICE, normal_pair, philox, unit
from vid2ev.stream.bounds import added, unlike
from vid2ev.stream.chances import surely
from vid2ev.stream.scene import Omission, Scene

RESOLVED = 8.0


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
    distance = surely(scene, unlike(scene)) + added(light_events(scene, spec), extra, 0.0) * bunched
    why = f"{extra:.0f} events at most, and all others move by noise over slope"
    return Omission(distance, "99.9 % bound", f"{rate_hz:.3g} events/pixel/s", why)
