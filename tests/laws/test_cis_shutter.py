"""Exposures are the exact integral of light that is a straight line between its frames, row by row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.stream.exposures import Exposure
from vid2ev.stream.frames import Frame

SLOPE = 55.0
LSB = SLOPE / 65535  # of light


def spec(**keys) -> CisSpec:
    """A sensor without noise, of luminance, with the paper's range."""
    return CisSpec(**({"colour": False, "line_us": 0.0, "exposure_us": 0.0} | keys)).noiseless()


def expose(sensor: CisSpec, t_ns: Sequence[int], light: np.ndarray, cuts: Sequence[int] = (), **rest) -> list[Exposure]:
    """The exposures of frames [N, H, W]."""
    cis = Cis(sensor, (light.shape[2], light.shape[1]), linear=True, **rest)
    frames = (Frame(frame, int(t), cut=k in cuts) for k, (frame, t) in enumerate(zip(light, t_ns, strict=True)))
    return list(cis.run(frames))


def true_mean(t_ns: Sequence[int], values: Sequence[float], cuts: Sequence[int], a: Fraction, b: Fraction) -> Fraction:
    """The mean over [a, b] of light that is straight between frames and steps at cuts: areas of trapezia, in rationals;
    for a == b its value there."""
    exact, total = [Fraction(float(value)) for value in values], Fraction(0)
    for k in range(len(t_ns) - 1):
        t0, t1, l0, l1 = t_ns[k], t_ns[k + 1], exact[k], exact[k + 1]
        end = l0 if k + 1 in cuts else l1
        since, until = max(a, Fraction(t0)), min(b, Fraction(t1))
        if a == b and t0 <= a <= t1 and not (a == t1 and k + 2 < len(t_ns)):
            return l1 if a == t1 else l0 + (end - l0) * (a - t0) / (t1 - t0)
        if since < until:
            heights = [l0 + (end - l0) * (t - t0) / (t1 - t0) for t in (since, until)]
            total += (until - since) * sum(heights) / 2
    return total / (b - a)


times = st.lists(st.integers(1, 40_000_000), min_size=3, max_size=12).map(lambda steps: [0, *np.cumsum(steps).tolist()])
decimals = st.sampled_from([0.0, 0.001, 1.0, 37.25, 512.0, 2000.5, 8333.0, 33333.3, 70000.0])


@settings(max_examples=150)
@given(
    t_ns=times,
    rate=st.sampled_from([7.0, 24.0, 29.97, 59.94, 100.0, 333.3, 1000.0]),
    exposure_us=decimals,
    line_us=st.sampled_from([0.0, 0.5, 14.8, 333.0, 9000.0]),
    cut=st.integers(0, 12),
    seed=st.integers(0, 2**32 - 1),
)
def test_an_exposure_is_the_integral_of_the_light_whatever_the_times(t_ns, rate, exposure_us, line_us, cut, seed):
    """Within 0.001 LSB of rational arithmetic, and the codes are those of rounding it."""
    light = np.random.default_rng(seed).uniform(0, 0.9, (len(t_ns), 4, 2)).astype(np.float32)
    cuts = [cut] if 0 < cut < len(t_ns) else []
    made = expose(spec(frame_rate_hz=rate, exposure_us=exposure_us, line_us=line_us), t_ns, light, cuts)
    window, step = Fraction(str(exposure_us)) * 1000, Fraction(str(line_us)) * 1000
    period = Fraction(10**9) / Fraction(str(rate))
    complete = 0
    while math.floor(complete * period + Fraction(1, 2)) + 3 * step + window <= t_ns[-1]:
        complete += 1
    assert len(made) == complete
    for each in made[:40]:
        start = math.floor(each.index * period + Fraction(1, 2))
        assert each.start_ns == start and each.end_ns == round(start + 3 * step + window)
        for y in range(4):
            a = start + y * step
            for x in range(2):
                want = true_mean(t_ns, light[:, y, x], cuts, a, a + window)
                assert each.light[y, x] == pytest.approx(float(want), abs=0.001 * LSB)
                level = max((65535 * want - 4096) / Fraction(SLOPE), Fraction(0))
                if abs(level - math.floor(level) - Fraction(1, 2)) > Fraction(1, 10**6):
                    assert each.codes[y, x] == math.floor(level + Fraction(1, 2))


def test_thousands_of_frames_in_an_exposure_lose_nothing():
    """20 000 frames of one value, and of two in turn: sums in float32 would be off by whole codes."""
    t_ns = np.arange(20_001) * 50_000
    for pair in ([0.7, 0.7], [0.9, 0.1]):
        light = np.resize(np.array(pair, np.float32), (len(t_ns), 1, 1))
        (made,) = expose(spec(frame_rate_hz=1, exposure_us=1e6), t_ns, light)
        assert made.light[0, 0] == pytest.approx(np.mean(np.array(pair, np.float32), dtype=float), abs=1e-4 * LSB)


def test_the_clock_may_start_anywhere():
    """40 years after time 0 the bits are the same."""
    rng = np.random.default_rng(0)
    t_ns, light = np.cumsum(rng.integers(1, 9_000_000, 60)), rng.random((60, 5, 3)).astype(np.float32)
    sensor = spec(frame_rate_hz=29.97, exposure_us=4321.5, line_us=77.7)
    here, there = expose(sensor, t_ns, light), expose(sensor, t_ns + 40 * 365 * 86400 * 10**9, light)
    assert len(here) == len(there) > 5
    for one, other in zip(here, there, strict=True):
        assert np.array_equal(one.light, other.light) and np.array_equal(one.codes, other.codes)


def edge(x: np.ndarray, sigma: float = 0.7) -> np.ndarray:
    """An edge from 0.1 to 0.9, blurred by a Gaussian of 0.7 px, as a lens does."""
    return 0.1 + 0.4 * (1 + np.vectorize(math.erf)(x / (sigma * math.sqrt(2))))


def edge_integral(x: np.ndarray, sigma: float = 0.7) -> np.ndarray:
    """Its antiderivative."""
    root = sigma * math.sqrt(2)
    u = x / root
    return 0.5 * x + 0.4 * root * (u * np.vectorize(math.erf)(u) + np.exp(-(u**2)) / math.sqrt(math.pi))


def error_of_edge(pixels_per_frame: float, exposure_px: float, line_px: float) -> float:
    """The largest error [LSB] at a blurred edge that moves at 1 px / ms, against the integral in closed form."""
    step_ns = round(pixels_per_frame * 1e6)
    t_ns = np.arange(0, 24_000_001, step_ns)
    x, rows = np.arange(32.0), 4
    light = np.stack([np.broadcast_to(edge(x - 4 - t * 1e-6), (rows, 32)) for t in t_ns])
    keys = {"frame_rate_hz": 210.0, "exposure_us": 1000 * exposure_px, "line_us": 1000 * line_px}
    worst = 0.0
    for each in expose(spec(**keys), t_ns, light):
        for y in range(rows):
            a = each.start_ns * 1e-6 + y * line_px
            at = x - 4 - a
            true = (edge_integral(at) - edge_integral(at - exposure_px)) / exposure_px if exposure_px else edge(at)
            worst = max(worst, np.abs(each.light[y] - true).max())
    return worst / LSB


@pytest.mark.parametrize(("exposure_px", "line_px"), [(1.0, 0.0), (0.33, 0.07), (3.0, 0.015)])
def test_a_moving_edge_is_as_its_closed_form_and_the_error_falls_as_the_square(exposure_px, line_px):
    errors = {step: error_of_edge(step, exposure_px, line_px) for step in (0.4, 0.2, 0.1, 0.05, 0.025)}
    assert errors[0.05] < 0.1
    for coarse in (0.4, 0.2, 0.1, 0.05):
        assert 3.2 < errors[coarse] / errors[coarse / 2] < 5.2, errors


def test_a_moving_edge_seen_for_an_instant():
    """Straight lines between frames miss a curve by up to step^2 / 8 times its curvature, wherever the instant lies."""
    curvature = 0.8 * math.exp(-0.5) / math.sqrt(2 * math.pi) / 0.7**2
    for step in (0.2, 0.05):
        assert error_of_edge(step, 0.0, 0.013) <= 1.01 * step**2 / 8 * curvature / LSB + 1e-3


@pytest.mark.parametrize("exposure_us", [0.0, 700.0, 5000.0])
@pytest.mark.parametrize("px_per_s", [200.0, -450.0])
def test_the_skew_of_a_moving_line_is_that_of_its_rows(exposure_us, px_per_s):
    """The centre of a vertical line in each row is where the line is in the middle of the row's window, to 0.01 px."""
    rows, columns, line_us = 48, 64, 21.7
    x, t_ns = np.arange(columns), np.arange(0, 40_000_001, 1_700_000)
    at = 32 + px_per_s * (t_ns * 1e-9 - 0.02)
    light = 0.8 * np.exp(-0.5 * ((x - at[:, None]) / 1.5) ** 2)
    frames = np.repeat(light[:, None, :], rows, axis=1).astype(np.float32)
    made = expose(spec(frame_rate_hz=100, exposure_us=exposure_us, line_us=line_us), t_ns, frames)
    assert len(made) >= 3
    for each in made:
        centres = (each.light * x).sum(axis=1) / each.light.sum(axis=1)
        middle_s = each.start_ns * 1e-9 + 1e-6 * (np.arange(rows) * line_us + exposure_us / 2)
        assert centres == pytest.approx(32 + px_per_s * (middle_s - 0.02), abs=0.01)


def test_no_exposure_is_a_sample():
    """At the frames themselves their own light to the bit, between them the straight line."""
    rng = np.random.default_rng(3)
    light, t_ns = rng.random((31, 3, 4)).astype(np.float32), np.arange(31) * 10_000_000
    made = expose(spec(frame_rate_hz=100), t_ns, light)
    assert len(made) == 31
    assert all(np.array_equal(each.light, frame) for each, frame in zip(made, light, strict=True))
    between = expose(spec(frame_rate_hz=200), t_ns, light)[1::2]
    assert np.array([each.light for each in between]) == pytest.approx((light[1:] + light[:-1]) / 2, abs=1e-7)


@pytest.mark.parametrize("line_us", [4.03, 8.14, 16.1, 0.29, 37.23])  # (1e3 times some of these is no whole number)
@pytest.mark.parametrize(("exposure_us", "blur"), [(0.0, True), (700.3, False), (700.3, True)])
def test_rows_that_are_read_at_a_frame_see_it_once(line_us, exposure_us, blur):
    """Frames at the very instants at which rows open, are half open and close: none is missed, none is added twice, and
    the last exposure closes with the last frame."""
    whole_ns = [Fraction(str(number)) * 1000 for number in (line_us, exposure_us)]
    of_rows = [
        y * whole_ns[0] + part * whole_ns[1] for y in range(4) for part in (Fraction(0), Fraction(1, 2), Fraction(1))
    ]
    t_ns = sorted({int(k * 10_000_000 + each) for k in range(5) for each in of_rows} | {20_000_000})
    made = expose(
        spec(frame_rate_hz=100, exposure_us=exposure_us, line_us=line_us, blur=blur),
        t_ns,
        np.full((len(t_ns), 4, 2), 0.5, np.float32),
    )
    assert [each.index for each in made] == [0, 1, 2, 3, 4]
    assert all(each.light == pytest.approx(0.5, rel=1e-6) for each in made)


def test_a_single_frame_is_a_sample_too():
    (made,) = expose(spec(), [7], np.full((1, 2, 2), 0.5, np.float32))
    assert (made.start_ns, made.end_ns) == (7, 7) and (made.light == 0.5).all()


def test_at_a_cut_light_steps():
    """A window across the cut sees the shares of the two shots; one that ends at it sees nothing of the second."""
    light = np.array([0.2, 0.2, 0.8, 0.8], np.float32)[:, None, None]
    t_ns = [0, 10_000_000, 20_000_000, 30_000_000]
    across = expose(spec(frame_rate_hz=66.66666666666667, exposure_us=8000), t_ns, light, cuts=[2])
    assert [float(each.light[0, 0]) for each in across] == pytest.approx([0.2, 0.2 * 5 / 8 + 0.8 * 3 / 8])
    before = expose(spec(frame_rate_hz=100, exposure_us=10_000), t_ns, light, cuts=[2])
    assert [float(each.light[0, 0]) for each in before] == pytest.approx([0.2, 0.2, 0.8])
    at_it = expose(spec(frame_rate_hz=100), t_ns, light, cuts=[2])
    assert [float(each.light[0, 0]) for each in at_it] == pytest.approx([0.2, 0.2, 0.8, 0.8])


def test_a_longer_exposure_is_no_brighter_but_a_gain_is():
    light, t_ns = np.full((40, 2, 2), 0.3, np.float32), np.arange(40) * 5_000_000
    codes = {
        (exposure, gain): expose(spec(exposure_us=exposure, exposure_gain=gain), t_ns, light)[0].codes[0, 0]
        for exposure in (0.0, 100.0, 20_000.0)
        for gain in (1.0, 2.0)
    }
    for (_, gain), code in codes.items():
        assert code == math.floor((65535 * np.float64(np.float32(0.3)) * gain - 4096) / 55 + 0.5)


@given(st.integers(0, 10**7), st.sampled_from(["29.97", "30", "23.976", "59.94", "0.1", "999.9", "1e6"]))
def test_exposures_open_on_a_clock_that_does_not_drift(k, rate):
    from vid2ev.physics.shutter import opening_ns

    exact = k * 10**9 / Fraction(rate)
    assert abs(opening_ns(k, float(rate)) - exact) <= Fraction(1, 2)
