"""The low-pass as the sensor computes it, in float32, against 60-digit arithmetic, over twelve decades of dt / tau."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from against.clips import clean, sensor, start
from against.judge import judge_clip
from against.reference import Pixel
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.stream import Events

pytestmark = pytest.mark.long

NAT = 1e-6


def exact_lags(u: list, dt: list, tau1: float, tau2: float) -> tuple:
    """Outputs (y1, y2) after steps dt of an input that goes straight from each u to the next, in 60 digits."""
    with mpmath.workdps(60):
        one, two = mpmath.mpf(tau1), mpmath.mpf(tau2)
        two *= 1 + mpmath.mpf(10) ** -25 * (one == two)  # (partial fractions need them apart; 25 digits are left)
        y1 = y2 = mpmath.mpf(float(u[0]))
        for before, after, step in zip(u[:-1], u[1:], dt, strict=True):
            a, t = mpmath.mpf(float(before)), mpmath.mpf(step)
            rise = (mpmath.mpf(float(after)) - a) / t
            k1 = y1 - a + rise * one
            y1 = a + rise * (t - one) + k1 * mpmath.exp(-t / one)
            steady, from_first = a - rise * (one + two), k1 * one / (one - two)
            y2_new = (steady + rise * t + from_first * mpmath.exp(-t / one)
                      + (y2 - steady - from_first) * mpmath.exp(-t / two))  # fmt: skip
            y2 = y2_new
        return y1, y2


def filtered(spec, t_ns: list, u: np.ndarray) -> np.ndarray:
    """What the sensor has made of the light [F, W] after the last frame [nat]."""
    dvs = start(spec, np.empty((1, u.shape[1])))
    for t, row in zip(t_ns, u.astype(np.float32), strict=True):
        dvs.step(row[None], int(t))
    return dvs.inside(np.arange(u.shape[1])).filtered


DECADES = np.logspace(-6, 6, 13)  # dt / tau
NEARLY = [1.0, 1 + 1e-12, 1 - 1e-9, 1 + 1e-7, 1 - 1e-5, 1 + 1e-4, 1.001, 0.98]
APART = [1e-6, 1e-3, 0.3, 3.0, 1e3, 1e6]


@pytest.mark.parametrize("order", ["before", "after"])
@pytest.mark.parametrize("decade", DECADES)
@pytest.mark.parametrize("kind", ["nearly equal", "apart"])
def test_steps_are_exact_over_twelve_decades(order, decade, kind):
    """Three steps of dt, dt / 7 and 3 dt: to 1e-6 nat, for poles that are equal, nearly equal and far apart."""
    tau1 = min(max(1e6 / decade, 1e-3), 1e9)  # us
    dt_ns = max(round(tau1 * 1e3 * decade), 7)
    rng = np.random.default_rng(7)
    u = np.exp2(rng.integers(-4, 3, (4, 8)).astype(float))
    t_ns = np.cumsum([0, dt_ns, max(dt_ns // 7, 1), 3 * dt_ns])
    for ratio in NEARLY if kind == "nearly equal" else APART:
        tau2 = min(tau1 * ratio, 1e12)
        spec = clean(photoreceptor_tau_us=tau1, follower_tau_us=tau2, filter=order, threshold_on=90, threshold_off=90)
        got = filtered(spec, t_ns.tolist(), u)
        for x in range(u.shape[1]):
            seen = np.log(u[:, x] + 1e-3) if order == "after" else u[:, x]
            y = exact_lags(seen, (np.diff(t_ns) / 1e3).tolist(), tau1, tau2)[1]
            with mpmath.workdps(60):
                want = float(y if order == "after" else mpmath.log(y + mpmath.mpf(1e-3)))
            assert abs(got[x] - want) < NAT, (ratio, got[x], want)


@pytest.mark.parametrize("order", ["before", "after"])
@pytest.mark.parametrize("decade", DECADES)
def test_a_pole_that_depends_on_light_is_as_exact(order, decade):
    """In light that stays, and in one pole: its own tau, whatever the light; float32 weights from pixel to pixel."""
    dark = 20 / 255
    light = np.array([0.01, 0.1, 0.5, 1.0, 8.0, 300.0])
    tau2 = min(max(1e6 / decade, 1e-3), 1e9)
    spec = clean(
        photoreceptor_tau_us=tau2, follower_tau_us=tau2, bandwidth="light", filter=order, threshold_on=90,
        threshold_off=90,
    )  # fmt: skip
    dt_ns = max(round(tau2 * 1e3 * decade), 1)
    u = np.stack([light / 4, light, light, light])
    t_ns = np.cumsum([0, 1, dt_ns, 2 * dt_ns])
    got = filtered(spec, t_ns.tolist(), u.astype(np.float32))
    for x, value in enumerate(light.astype(np.float32).astype(float)):
        tau1 = tau2 * (1 + dark) / (value + dark)
        first, last = (np.log(v + 1e-3) if order == "after" else v for v in (value / 4, value))
        steps = [1e-3, *(np.diff(t_ns)[1:] / 1e3)]
        y = exact_lags([first, last, last, last], steps, tau1, tau2)[1]
        with mpmath.workdps(60):
            want = float(y if order == "after" else mpmath.log(y + mpmath.mpf(1e-3)))
        assert abs(got[x] - want) < NAT, (value, got[x], want)


@settings(max_examples=60, derandomize=True)
@given(
    st.floats(-6, 6),
    st.one_of(st.just(0.0), st.floats(-9, -1).map(lambda e: 10**e), st.floats(-6, 6)),
    st.integers(0, 2**32 - 1),
    st.sampled_from(["before", "after"]),
)
def test_any_two_poles_over_many_steps(decade, ratio, seed, order):
    """Twenty steps of any lengths, dt / tau from 1e-6 to 1e6 in each: what is rounded does not add up."""
    rng = np.random.default_rng(seed)
    tau1 = 10 ** min(max(3 - decade, -2), 6)
    tau2 = tau1 * (1 + ratio) if 0 <= ratio < 0.2 else tau1 * 10**ratio
    steps_ns = np.maximum(rng.uniform(0.2, 1, 20) * tau1 * 1e3 * 10**decade, 1).astype(np.int64)
    u = np.exp2(rng.integers(-3, 3, (21, 4)).astype(float))
    t_ns = np.concatenate([[0], np.cumsum(steps_ns)])
    spec = clean(photoreceptor_tau_us=tau1, follower_tau_us=min(tau2, 1e12), filter=order, threshold_on=90,
                 threshold_off=90)  # fmt: skip
    got = filtered(spec, t_ns.tolist(), u)
    for x in range(u.shape[1]):
        seen = np.log(u[:, x] + 1e-3) if order == "after" else u[:, x]
        y = exact_lags(seen, (steps_ns / 1e3).tolist(), tau1, min(tau2, 1e12))[1]
        with mpmath.workdps(60):
            want = float(y if order == "after" else mpmath.log(y + mpmath.mpf(1e-3)))
        assert abs(got[x] - want) < NAT * math.sqrt(20)


@pytest.mark.parametrize("dark_level", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize(("tau_us", "step_ns"), [(1e6, 300_000), (2e4, 5_000)])
def test_a_jump_through_slow_poles_is_not_late(tau_us, step_ns, dark_level):
    """Light from 0 to 1, and the signal still ten decades below: each event at its time, and not at a later frame's."""
    pixel = Pixel(0.2, 0.2, tau_us, tau_us / 3, dark_level=dark_level)
    t_ns = np.concatenate([[0], 10_000 + np.arange(40) * step_ns])
    light = np.ones((41, 1, 1), np.float32)
    light[0] = 0
    dvs, parts = start(sensor(pixel), light), []
    for t, frame in zip(t_ns.tolist(), light, strict=True):
        parts.append(dvs.step(frame, t))
        _, signal, on, off = dvs.inside(np.arange(1))
        assert off[0] - NAT < signal[0] < on[0] + NAT
    judge_clip(pixel, t_ns, light, Events.concatenate(parts))
