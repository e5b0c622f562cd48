"""Exact times: every event against the closed form or the 60-digit response, none missing, none extra."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf, lambertw

from .clips import play, sensor
from .judge import assert_one_to_one, judge_clip
from .reference import Pixel, Response, response60

ORDERS = ["before", "after"]
POLES = {
    "none": (0.0, 0.0),
    "first only": (300.0, 0.0),
    "second only": (0.0, 100.0),
    "both": (300.0, 100.0),
    "fast first": (40.0, 700.0),
    "equal": (150.0, 150.0),
    "1e-9 apart": (150.0, 150.0 * (1 + 1e-9)),
    "1 % apart": (150.0, 151.5),
    "1e6 apart": (1e5, 0.1),
    "1e6 apart, fast first": (0.1, 1e5),
}
poles = pytest.mark.parametrize("taus", POLES.values(), ids=POLES.keys())
orders = pytest.mark.parametrize("order", ORDERS)


def expect_us(sent, x: int, y: int, want_us, slope_per_us, polarity: int) -> None:
    """Pixel (x, y) sent the events at `want_us`, all of one polarity, within 1 us + 2e-6 nat / |slope|."""
    mine = (sent.x == x) & (sent.y == y)
    assert mine.sum() == len(want_us)
    assert (sent.p[mine] == polarity).all()
    assert (np.abs(sent.t[mine] - want_us) <= 1 + 2e-6 / np.abs(slope_per_us)).all()


# Closed forms


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("start_ns", [0, 10_800_000_000_123])
def test_ramp_of_the_log_without_filter(way, start_ns):
    """y = y0 +- s t: events at k threshold / s, rounded to the nearest microsecond."""
    span_us = np.array([900, 12_345, 250_000, 3_600_000_000])
    pixel = Pixel(0.1, 0.1, filter="after")
    for span in span_us:
        light = (np.exp(np.array([0.0, way * 2.05])) - 1e-3).astype(np.float32)
        y = np.log(light.astype(np.float64) + 1e-3)
        sent = play(sensor(pixel), [start_ns, start_ns + int(span) * 1000], light[:, None, None])
        slope = (y[1] - y[0]) / span
        exact = start_ns / 1e3 + np.arange(1, 21) * 0.1 / abs(slope)
        expect_us(sent, 0, 0, exact, slope, int(way > 0))
        sure = 0.5 + 2e-6 / abs(slope)
        assert (np.abs(sent.t - exact) <= sure).all(), "not the nearest microsecond"


@pytest.mark.parametrize("way", [1, -1])
def test_ramp_of_the_light_without_filter(way):
    """Before the log and without poles the light is linear: t = (e^(+-k threshold) - 1)(I + dark) / rate."""
    pixel = Pixel(0.07, 0.07, filter="before")
    light = np.array([0.02, 1.0], np.float32)[::way]
    a, b = light.astype(np.float64) + 1e-3
    sent = play(sensor(pixel), [0, 50_000_000], light[:, None, None])
    k = np.arange(1, math.floor(abs(math.log(b / a)) / 0.07) + 1)
    level = a * np.exp(way * 0.07 * k)
    rate = (b - a) / 50_000
    expect_us(sent, 0, 0, (level - a) / rate, rate / level, int(way > 0))


@pytest.mark.parametrize("tau_us", [0.5, 30.0, 2_000.0, 100_000.0])
@pytest.mark.parametrize("which", ["photoreceptor_tau_us", "follower_tau_us"])
def test_ramp_through_one_pole(tau_us, which):
    """y - y0 = s (t - tau + tau e^(-t/tau)), solved for t by Lambert's function."""
    span_us, s = 20_000.0, 4.0 / 20_000.0
    pixel = Pixel(0.05, 0.05, filter="after", **{which: tau_us})
    light = (np.exp([-3.0, 1.0]) - 1e-3).astype(np.float32)
    y = np.log(light.astype(np.float64) + 1e-3)
    s = (y[1] - y[0]) / span_us
    sent = play(sensor(pixel), [0, int(span_us * 1e3)], light[:, None, None])
    last = s * (span_us - tau_us * -np.expm1(-span_us / tau_us))
    level = 0.05 * np.arange(1, math.floor(last / 0.05) + 1)
    shift = level / s / tau_us + 1
    t = tau_us * (shift + np.real(lambertw(-np.exp(-shift))))
    expect_us(sent, 0, 0, t, s * -np.expm1(-t / tau_us), 1)


@pytest.mark.parametrize("k", [1.3, 4.0, 40.0, 0.7, 0.02])
@pytest.mark.parametrize("tau_us", [20.0, 300.0, 5_000.0])
@orders
def test_step_through_one_pole(k, tau_us, order):
    """After the log y - y0 = ln k (1 - e^(-t/tau)); before it ln(1 + (k - 1)(1 - e^(-t/tau)))."""
    pixel = Pixel(0.1, 0.1, filter=order, photoreceptor_tau_us=tau_us, dark_level=1e-6)
    light = np.array([0.1, 0.1 * k, 0.1 * k], np.float32)
    y0, y1 = np.log(light[:2].astype(np.float64) + 1e-6)
    sent = play(sensor(pixel), [0, 1, int(tau_us * 30_000)], light[:, None, None])
    level = np.sign(y1 - y0) * 0.1 * np.arange(1, math.floor(abs(y1 - y0) / 0.1) + 1)
    share = level / (y1 - y0) if order == "after" else np.expm1(level) / math.expm1(y1 - y0)
    t = -tau_us * np.log1p(-share)
    slope = (1 - share) * ((y1 - y0) if order == "after" else math.expm1(y1 - y0) * np.exp(-level)) / tau_us
    keep = np.abs(level) < abs(y1 - y0) * 0.999
    assert keep.sum() >= 1
    sent = sent.select(np.arange(len(sent)) < keep.sum())
    expect_us(sent, 0, 0, t[keep], slope[keep], int(k > 1))


@poles
@orders
def test_step_through_two_poles_to_60_digits(taus, order):
    pixel = Pixel(0.2, 0.2, *taus, filter=order)
    light = np.array([0.05, 0.8, 0.8], np.float32)
    span_ns = 1e9 if max(taus) > 1e4 else 3e6
    sent = play(sensor(pixel), [0, 1, int(span_ns)], light[:, None, None])
    with mpmath.workdps(60):
        before = order == "before"
        u0, u1 = (float(v) if before else float(np.log(float(v) + 1e-3)) for v in light[:2])
        jump = Response(u0, u1, 1.0, u0, u0, taus[0] * 1e3, taus[1] * 1e3)
        y1 = jump.u1 if taus[0] == 0 else float(jump.first(1.0))
        settle = Response(u1, u1, span_ns, y1, float(response60(jump, 1.0)), taus[0] * 1e3, taus[1] * 1e3)

        def y(t):
            filtered = response60(settle, t)
            return mpmath.log(filtered + mpmath.mpf(1e-3)) if before else filtered

        start = math.log(0.05000000074505806 + 1e-3)
        for k, t_us in enumerate(sent.t.tolist(), 1):
            level = start + 0.2 * k
            if t_us == 1 and taus == (0.0, 0.0):
                continue  # the whole step lies within the first microsecond
            a, b = max(t_us * 1e3 - 1001.0, 0.0), t_us * 1e3 + 999.0
            assert y(a) - level < 2e-6 and y(b) - level > -2e-6
        assert len(sent) == math.floor((float(y(span_ns - 1)) - start) / 0.2)


# Against the reference


def judged(pixel: Pixel, t_ns, light, least: int) -> None:
    """Judge the sensor on the clip, which must make at least `least` events, nearly none of them marginal."""
    light = np.asarray(light, np.float32)
    verdict = judge_clip(pixel, t_ns, light, play(sensor(pixel), t_ns, light))
    assert verdict.events >= least
    assert verdict.marginal <= 1e-3 * verdict.events + 1


@poles
@orders
@pytest.mark.parametrize("curve", ["offset", "toe", "v2e"])
def test_random_light_at_random_times(taus, order, curve):
    """Intervals from 1e-4 to 1e4 of a time constant, light over four decades."""
    rng = np.random.default_rng(5)
    tau = max(taus) or 100.0
    dt_us = tau * 10 ** rng.uniform(-4, 4, 24)
    t_ns = 777 + np.concatenate([[0], np.cumsum(np.maximum(dt_us * 1e3, 1).astype(np.int64))])
    light = 10 ** rng.uniform(-3, 1, (25, 1, 6))
    judged(Pixel(0.21, 0.17, *taus, filter=order, log_curve=curve), t_ns, light, least=100)


@poles
@orders
def test_sines(taus, order):
    """Sines of 30 Hz to 2 kHz, sampled at 1 kHz: turning points inside the intervals everywhere."""
    t_ns = np.arange(0, 60_000_000, 1_000_000)
    hz = np.geomspace(30, 2_000, 8)
    light = 0.5 + 0.45 * np.sin(2 * np.pi * hz * t_ns[:, None] * 1e-9 + np.arange(8))
    judged(Pixel(0.12, 0.15, *taus, filter=order), t_ns, light[:, None, :], least=50 if max(taus) < 1e4 else 10)


@poles
@orders
def test_moving_edge(taus, order):
    """A blurred edge crosses a row of pixels at 700 px/s, there and back, while the light rises slowly."""
    t_ns = np.arange(0, 80_000_000, 2_000_000)
    edge = 25 - np.abs(25 - 0.7e-6 * t_ns)
    light = 0.05 + 0.45 * (1 + erf((edge[:, None] - np.arange(3, 17, 2)) / (0.7 * math.sqrt(2))))
    light *= 1 + 0.5e-9 * t_ns[:, None]  # so that no pixel returns to just the light that it started from
    judged(Pixel(0.1, 0.1, *taus, filter=order), t_ns, light[:, None, :], least=150 if max(taus) < 1e4 else 50)


@orders
def test_flicker_between_two_codes_turns_inside_the_interval(order):
    """Square light of period 2 T: with the poles nearly every turning point lies inside an interval."""
    t_ns = np.cumsum(np.where(np.arange(81) % 2, 1, 400_000))
    levels = np.array([[0.1, 0.3, 0.5, 0.02], [0.7, 0.9, 0.62, 1.5]])
    light = levels[(np.arange(81) // 2) % 2]
    judged(Pixel(0.09, 0.11, 300, 100, filter=order), t_ns, light[:, None, :], least=200)


TIMINGS = [("linear", "before", (300.0, 100.0)), ("linear", "before", (0.0, 0.0))]
SLOW_TIMINGS = [
    ("linear", "after", (300.0, 100.0)),
    ("frame", "before", (300.0, 100.0)),
    ("frame", "before", (0.0, 0.0)),
    ("frame", "after", (0.0, 0.0)),
]


@pytest.mark.parametrize(
    ("timing", "order", "taus"), [*TIMINGS, *(pytest.param(*more, marks=pytest.mark.slow) for more in SLOW_TIMINGS)]
)
def test_the_simpler_timings(order, timing, taus):
    rng = np.random.default_rng(6)
    t_ns = 500 + np.cumsum(rng.integers(100_000, 3_000_000, 25))
    light = rng.uniform(0.02, 1, (25, 1, 6)).astype(np.float32)
    pixel = Pixel(0.15, 0.2, *taus, filter=order, timing=timing)
    assert assert_one_to_one(pixel, t_ns, light, play(sensor(pixel), t_ns, light)) > 150


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "order"),
    [
        ("quantised", "before"),
        ("track", "after"),
        pytest.param("quantised", "after", marks=pytest.mark.slow),
        pytest.param("track", "before", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("dead_us", [30.0, 400.0, 5_000.0])
def test_dead_time(order, kind, dead_us):
    t_ns = np.arange(0, 40_000_000, 1_000_000)
    hz = np.array([25, 60, 140, 300])
    light = 0.5 + 0.45 * np.sin(2 * np.pi * hz * t_ns[:, None] * 1e-9 + np.arange(4))
    light = light.astype(np.float32)[:, None, :]
    pixel = Pixel(0.12, 0.15, 300, 100, filter=order, refractory_us=dead_us, refractory=kind)
    sent = play(sensor(pixel), t_ns, light)
    assert assert_one_to_one(pixel, t_ns, light, sent) >= 4
    for x in range(4):
        assert (np.diff(sent.t[sent.x == x]) >= dead_us - 1).all()


@st.composite
def clips(draw):
    tau = st.one_of(st.just(0.0), st.floats(-1, 5).map(lambda e: 10**e))
    first = draw(tau)
    near = st.sampled_from([1.0, 1 + 1e-9, 1 - 1e-6, 1.001, 0.97]).map(lambda ratio: first * ratio)
    second = draw(st.one_of(tau, near))
    pixel = Pixel(
        draw(st.floats(0.03, 0.5)),
        draw(st.floats(0.03, 0.5)),
        first,
        second,
        filter=draw(st.sampled_from(ORDERS)),
        dark_level=draw(st.sampled_from([1e-5, 1e-3, 0.1])),
    )
    frames = draw(st.integers(2, 7))
    steps = draw(st.lists(st.floats(0, 9).map(lambda e: int(10**e)), min_size=frames - 1, max_size=frames - 1))
    value = st.one_of(st.just(0.0), st.floats(-4, 2).map(lambda e: 10**e))
    light = draw(st.lists(value, min_size=2 * frames, max_size=2 * frames))
    t_ns = draw(st.integers(0, 10**13)) + np.concatenate([[0], np.cumsum(steps)])
    return pixel, t_ns, np.array(light, np.float32).reshape(frames, 1, 2)


@settings(max_examples=150, derandomize=True)
@given(clips())
def test_any_piecewise_linear_light(clip):
    pixel, t_ns, light = clip
    judge_clip(pixel, t_ns, light, play(sensor(pixel), t_ns, light))


@pytest.mark.parametrize("filter_at", ["after", "before"])
@pytest.mark.parametrize("dark_ns", [3 * 10**5, 10**6, 10**7, 10**9])
@pytest.mark.parametrize("follower_us", [31.6, 5.0, 300.0])
def test_a_pulse_that_dies_away_within_one_long_interval(filter_at: str, dark_ns: int, follower_us: float) -> None:
    """The signal goes on rising after the light is gone, turns, and has settled long before the next frame."""
    pixel = Pixel(0.1, 0.2, 31.6, follower_us, filter=filter_at, dark_level=1e-5)
    t_ns = np.array([0, 3, 4, 10_004, 10_004 + dark_ns])
    light = np.array([0, 0, 1, 0, 0], np.float32).reshape(5, 1, 1)
    sent = play(sensor(pixel), t_ns, light)
    judge_clip(pixel, t_ns, light, sent)
    assert len(sent) > 0  # (where the second pole is slow and after the log, only one, of the last interval)


@pytest.mark.parametrize("filter_at", ["after", "before"])
@pytest.mark.parametrize("light_ns", [3 * 10**5, 10**6, 10**9])
@pytest.mark.parametrize("follower_us", [31.6, 5.0, 300.0])
def test_a_gap_of_light_that_is_made_up_for_within_one_long_interval(filter_at, light_ns, follower_us) -> None:
    """The signal goes on falling after the light is back, turns, and has settled long before the next frame."""
    pixel = Pixel(0.02, 0.006, 31.6, follower_us, filter=filter_at, dark_level=1e-5)
    t_ns = np.array([0, 3, 4, 10_004, 10_004 + light_ns])
    light = np.array([1, 1, 0.1, 1, 1], np.float32).reshape(5, 1, 1)
    sent = play(sensor(pixel), t_ns, light)
    judge_clip(pixel, t_ns, light, sent)
    assert len(sent) > 0
