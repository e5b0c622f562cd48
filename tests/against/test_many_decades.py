"""Light that changes by many decades from frame to frame: the same times as ever, to 1 us + 2e-6 nat."""

from __future__ import annotations

import numpy as np
import pytest

from .clips import play, sensor
from .judge import judge_clip
from .reference import Pixel

poles = pytest.mark.parametrize("taus_s", [(9.0, 0.0), (9.0, 2.0)], ids=["one", "two"])


def judged(pixel: Pixel, spans_s: float | list[float], light: np.ndarray, **keys) -> None:
    """Judge the sensor on frames of light [F, 1, W], so long after each other."""
    light = np.asarray(light, np.float32)
    t_ns = np.cumsum([0, *np.broadcast_to(np.array(spans_s) * 1e9, len(light) - 1).astype(np.int64)])
    verdict = judge_clip(pixel, t_ns, light, play(sensor(pixel, **keys), t_ns, light))
    assert verdict.events > 100
    assert verdict.marginal <= 1e-3 * verdict.events + 1


@poles
def test_a_flash_after_rest(taus_s):
    """The signal leaves its rest as a power of time: near it, it bends far faster than its poles and the light do."""
    pixel = Pixel(0.15, 0.15, *(tau * 1e6 for tau in taus_s))
    dark = np.geomspace(1e-3, 1, 16)
    judged(pixel, 8.7, np.stack([dark, dark, np.geomspace(1e5, 1e3, 16)])[:, None])


def test_a_flash_of_which_a_second_pole_lets_little_through():
    """The first pole has hardly any lag; that of the second is a thousand times as large as the signal."""
    pixel = Pixel(0.05, 0.05, 100.0, 900e6)
    dark, flash = np.geomspace(1e-3, 1, 16), np.geomspace(1e5, 1e3, 16)
    judged(pixel, 0.87, np.stack([dark, dark, flash, flash, 1.1 * flash])[:, None])


def test_a_flash_that_lasts():
    """The lag is a thousand times as large as the signal when a long interval begins in which it catches up."""
    dark, flash = np.geomspace(0.1, 1, 16), np.geomspace(3e3, 1e2, 16)
    judged(Pixel(0.03, 0.03, 900e6), [1.0, 900.0], np.stack([dark, flash, flash])[:, None])


@poles
def test_what_little_is_left_of_a_flash(taus_s):
    """After many time constants, beside dim light: it is what is left of a lag a million times as large."""
    pixel = Pixel(0.15, 0.15, *(tau * 1e6 for tau in taus_s))
    flash = np.geomspace(1e4, 1e6, 16)
    dim = np.geomspace(20, 2, 16)
    judged(pixel, 100.0, np.stack([flash, dim, dim / 2, dim / 1000])[:, None])


@poles
def test_the_pole_that_depends_on_light_is_as_exact(taus_s):
    """Light that goes to and fro has one mean: that pole is then one that does not depend on it."""
    low, high, dark = 1e-2, 2e5, 0.1
    light = np.array([low, high, low, high], np.float32).reshape(4, 1, 1)
    tau1, tau2 = (tau * 1e6 for tau in taus_s)
    slower = tau1 * (float(light[0, 0, 0] + light[1, 0, 0]) / 2 + dark) / (1 + dark)
    pixel = Pixel(0.02, 0.02, tau1, 1e3 * tau2)
    judged(pixel, 2.0, light, bandwidth="light", bandwidth_dark=dark, **{"photoreceptor_tau_us": slower})
