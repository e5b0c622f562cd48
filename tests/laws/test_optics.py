"""Lens shading scales the light; the bandwidth of the first pole follows it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from against.clips import clean, play, sensor
from against.judge import judge_clip
from against.reference import Pixel

orders = pytest.mark.parametrize("order", ["before", pytest.param("after", marks=pytest.mark.slow)])


@pytest.mark.parametrize("shape", [(6, 8), (7, 5), (1, 1)])
@orders
def test_shading_is_light_times_a_polynomial_of_the_radius(shape, order):
    """gain = 1 - 0.2 r - 0.9 r^2, r from the image centre in image widths; what would be negative is dark."""
    rng = np.random.default_rng(1)
    t_ns = np.arange(12) * 5_000_000
    light = rng.uniform(0.05, 1, (12, *shape)).astype(np.float32)
    y, x = np.indices(shape)
    r = np.hypot(x - (shape[1] - 1) / 2, y - (shape[0] - 1) / 2) / shape[1]
    gain = np.maximum(1 - 0.2 * r - 0.9 * r**2, 0)
    pixel = Pixel(0.15, 0.15, 300, 100, filter=order)
    sent = play(sensor(pixel, shading=(-0.2, -0.9)), t_ns, light)
    assert judge_clip(pixel, t_ns, light.astype(np.float64) * gain, sent).events > 10 * light[0].size


def test_shading_changes_no_contrast_without_dark_level():
    """Far above the dark level a pixel's gain is an offset of its log light: the same events."""
    rng = np.random.default_rng(2)
    t_ns = np.arange(12) * 5_000_000
    light = rng.uniform(0.05, 1, (12, 9, 9)).astype(np.float32)
    keys = {"dark_level": 1e-12, "photoreceptor_tau_us": 300, "follower_tau_us": 100}
    plain, shaded = (play(clean(shading=c, **keys), t_ns, light) for c in ((), (-0.3,)))
    assert len(plain) == len(shaded) > 1_000
    assert np.abs(plain.t - shaded.t).max() <= 1  # the order of events of one microsecond may differ


@pytest.mark.long
@pytest.mark.parametrize("level", [0.02, 0.3, 1.0, 4.0])
@orders
def test_bandwidth_follows_the_light_after_a_step(level, order):
    """tau1(I) = tau1 (1 + dark)/(I + dark): after a step to I the response is that of a first pole with tau1(I)."""
    dark = 20 / 255
    tau = 500 * (1 + dark) / (level + dark)
    light = np.array([level / 3, level, level], np.float32)[:, None, None]
    t_ns = [0, 1, 100_000_000]
    keys = {"photoreceptor_tau_us": 500, "follower_tau_us": 100, "filter": order, "bandwidth": "light"}
    sent = play(clean(threshold_on=0.1, threshold_off=0.1, bandwidth_dark=dark, **keys), t_ns, light)
    pixel = Pixel(0.1, 0.1, tau, 100, filter=order)
    assert judge_clip(pixel, t_ns, light, sent).events == len(sent) >= 9


@pytest.mark.long
@orders
def test_bandwidth_follows_light_that_moves(order):
    """A sine of the light in frames of 50 us against Heun steps of 1 us of both poles' equations."""
    dark, tau1, tau2, h = 20 / 255, 2_000.0, 300.0, 1.0
    t_us = np.arange(0, 60_001, h)
    frames_us = t_us[:: int(50 / h)]
    hz = np.array([20.0, 45.0, 110.0])
    samples = (0.4 + 0.38 * np.sin(2e-6 * math.pi * hz * frames_us[:, None] + np.arange(3))).astype(np.float32)

    def between(at_frames):
        return np.stack([np.interp(t_us, frames_us, column) for column in at_frames.T.astype(np.float64)], axis=1)

    light = between(samples)
    u = light if order == "before" else between(np.log(samples + 1e-3))
    rate1 = (light + dark) / (tau1 * (1 + dark))
    y1 = y2 = u[0]
    path = [y2]
    for k in range(len(t_us) - 1):
        r1, r2 = rate1[k] * (u[k] - y1), (y1 - y2) / tau2
        s1 = rate1[k + 1] * (u[k + 1] - y1 - h * r1)
        s2 = (y1 + h * r1 - y2 - h * r2) / tau2
        y1, y2 = y1 + h * (r1 + s1) / 2, y2 + h * (r2 + s2) / 2
        path.append(y2)
    y = np.log(np.array(path) + 1e-3) if order == "before" else np.array(path)

    keys = {"photoreceptor_tau_us": tau1, "follower_tau_us": tau2, "filter": order, "bandwidth": "light"}
    spec = clean(threshold_on=0.1, threshold_off=0.1, bandwidth_dark=dark, **keys)
    sent = play(spec, np.rint(frames_us * 1000).astype(np.int64), samples[:, None, :])
    for x in range(3):
        want, ref = [], y[0, x]
        for k in range(len(t_us) - 1):
            while abs(y[k + 1, x] - ref) >= 0.1:
                ref += 0.1 if y[k + 1, x] > ref else -0.1
                slope = (y[k + 1, x] - y[k, x]) / h
                want.append((t_us[k] + (ref - y[k, x]) / slope, slope))
        t, slope = np.array(want).T
        mine = sent.x == x
        assert mine.sum() == len(t) > 20
        assert (sent.p[mine] == (slope > 0)).all()
        assert (np.abs(sent.t[mine] - t) <= 2 + 1e-4 / np.abs(slope)).all()
