"""High dynamic range: the published curves, the table that stands for them, and tagged videos from end to end."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.light.luminance import YuvCode, luminance_of_yuv, signal_table
from vid2ev.light.tags import MATRICES, WEIGHTS
from vid2ev.light.transfer import code_table, parse_transfer
from vid2ev.sources import open_source

BT2020, PQ, HLG, LIMITED, FULL = 9, 16, 18, 1, 2
HDR = ["pq", "hlg", "log100", "log316", "st428"]


def eotf_2084(v: float) -> float:
    """SMPTE ST 2084 equation 4.1, in cd/m2, with the constants in decimals, at 40 digits."""
    m1, m2 = mpmath.mpf("0.1593017578125"), mpmath.mpf("78.84375")
    c1, c2, c3 = mpmath.mpf("0.8359375"), mpmath.mpf("18.8515625"), mpmath.mpf("18.6875")
    p = mpmath.mpf(v) ** (1 / m2)
    return float(10000 * (max(p - c1, 0) / (c2 - c3 * p)) ** (1 / m1))


def oetf_hlg(e: float) -> float:
    """Rec. ITU-R BT.2100-2 table 5, with its own way to b and c."""
    a = 0.17883277
    b, c = 1 - 4 * a, 0.5 - a * math.log(4 * a)
    return math.sqrt(3 * e) if e <= 1 / 12 else a * math.log(12 * e - b) + c


def test_pq_is_the_standard_in_units_of_diffuse_white() -> None:
    signal = np.linspace(0, 1, 513)
    expected = [eotf_2084(v) / 203 for v in signal]
    with mpmath.workdps(40):
        np.testing.assert_allclose(parse_transfer("pq").to_light(signal), expected, rtol=1e-11, atol=1e-18)
    # Rep. ITU-R BT.2408: diffuse white is 58 % PQ (58.07 %), and 100 cd/m2 50.8 %
    assert parse_transfer("pq").to_signal(np.array(1.0)) == pytest.approx(0.58069, abs=1e-5)
    assert parse_transfer("pq").to_signal(np.array(100 / 203)) == pytest.approx(0.50808, abs=1e-5)
    assert parse_transfer("pq").to_light(np.array([1.0, 1.2])) == pytest.approx(10000 / 203)


def test_hlg_is_the_inverse_of_the_standard_and_one_at_three_quarters() -> None:
    curve = parse_transfer("hlg")
    assert curve.to_light(np.array([0.0, 0.75])) == pytest.approx([0, 1], abs=1e-15)
    white = float(1 / curve.to_light(np.array(1.0)))  # E of the signal 0.75
    for e in np.linspace(0, 1, 301):
        assert float(curve.to_light(np.array(oetf_hlg(e)))) * white == pytest.approx(e, abs=1e-7)
    assert white == pytest.approx(0.26496, abs=1e-5)


def test_logarithms_have_their_decades() -> None:
    for name, decades in (("log100", 2.0), ("log316", 2.5)):
        light = parse_transfer(name).to_light(np.array([-0.1, 0.0, 0.5, 1.0]))
        np.testing.assert_allclose(np.log10(light), [-decades, -decades, -decades / 2, 0])


@pytest.mark.parametrize("name", HDR)
@given(st.floats(0.011, 3.7))
def test_there_and_back(name: str, light: float) -> None:
    curve = parse_transfer(name)
    assert curve.to_light(curve.to_signal(np.array(light))) == pytest.approx(light, rel=1e-9)


@pytest.mark.parametrize("name", HDR)
@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_a_brighter_code_is_brighter_light(name: str, bits: int) -> None:
    table = parse_transfer(name).to_light(np.arange(2**bits) / (2**bits - 1))
    assert np.all(np.diff(table) > 0) and np.all(np.isfinite(table))
    assert np.isnan(parse_transfer(name).to_light(np.array(np.nan)))


@pytest.mark.parametrize("name", HDR)
def test_the_table_is_as_fine_as_float32_signals(name: str) -> None:
    """Against the closed form, in nats of a pixel with a dark level of 0.001, from black to full."""
    ramp = np.arange(2**16, dtype=np.uint16).reshape(256, 256)
    neutral = np.full_like(ramp, 2**15)
    code = YuvCode(16, True, MATRICES[1], (0, 0))
    light = luminance_of_yuv([ramp, neutral, neutral], (256, 256), code, signal_table(name), WEIGHTS[BT2020])
    exact = parse_transfer(name).to_light(ramp / 65535.0)
    assert np.max(np.abs(light - exact) / (exact + 1e-3)) < 2e-6


def by_the_book(planes: list[np.ndarray], bits: int, full: bool, transfer: str) -> np.ndarray:
    """Luminance of Y'CbCr by H.273 in float64, BT.2020 throughout; chroma at the places of luma."""
    y, u, v = (plane.astype(np.float64) for plane in planes)
    unit, top = 2.0 ** (bits - 8), 2**bits - 1
    luma = y / top if full else (y / unit - 16) / 219
    cb, cr = ((c - 128 * unit) / (top if full else 224 * unit) for c in (u, v))
    kr, kb = MATRICES[BT2020]
    red, blue = luma + 2 * (1 - kr) * cr, luma + 2 * (1 - kb) * cb
    green = (luma - kr * red - kb * blue) / (1 - kr - kb)
    return parse_transfer(transfer).to_light(np.stack([red, green, blue], -1)) @ np.array(WEIGHTS[BT2020])


@pytest.mark.parametrize(("codec", "name", "options"), [
    # (with more threads a packet has had no time of decoding, once)
    ("libx265", "a.mkv", {"x265-params": "lossless=1:bframes=0:frame-threads=1:pools=none:log-level=none"}),
    ("ffv1", "a.mkv", {}),
])  # fmt: skip
@pytest.mark.parametrize(("trc", "transfer"), [(PQ, "pq"), (HLG, "hlg")])
@pytest.mark.parametrize(("bits", "color_range"), [(10, LIMITED), (12, LIMITED), (10, FULL)])
def test_a_tagged_video_is_read_by_its_tags(
    encode, make_picture, codec, name, options, trc, transfer, bits, color_range
):
    rng = np.random.default_rng(0)
    unit = 2.0 ** (bits - 8)
    ramp = np.linspace(16 * unit, 235 * unit, 128 * 96).reshape(96, 128)
    planes = [ramp, *(128 * unit + rng.uniform(-4, 4, (2, 96, 128)) * unit)]
    planes = [np.rint(plane).astype(np.uint16) for plane in planes]
    tags = dict(color_trc=trc, color_primaries=BT2020, colorspace=BT2020, color_range=color_range)
    clip = [make_picture(planes, f"yuv444p{bits}le", **tags)]
    source = open_source(encode(name, clip, codec=codec, options=options, **tags))
    about = source.describe()
    assert (about["transfer"], about["bits"], about["range"] == "full") == (transfer, bits, color_range == FULL)
    (frame,) = source.frames()
    exact = by_the_book(planes, bits, color_range == FULL, transfer)
    assert exact.max() > 2
    np.testing.assert_allclose(frame.light, exact, rtol=5e-6, atol=1e-9)


def test_by_hand(encode, make_picture) -> None:
    grey = np.arange(256, dtype=np.uint8).reshape(8, 32)
    path = encode("a.mkv", [make_picture([grey], "gray")])
    for name in HDR:
        (frame,) = open_source(path, transfer=name).frames()
        np.testing.assert_allclose(frame.light, code_table(name, 8)[grey], rtol=1e-6)


@pytest.mark.parametrize("color_range", [FULL, LIMITED])
def test_ycgco_against_its_definition(encode, make_picture, color_range: int) -> None:
    """Which is one of codes, whatever their range (Rec. ITU-T H.273, 8.3)."""
    rng = np.random.default_rng(1)
    planes = [rng.integers(60, 190, (6, 8)).astype(np.uint8), *rng.integers(110, 146, (2, 6, 8)).astype(np.uint8)]
    clip = [make_picture(planes, "yuv444p", colorspace=8, color_range=color_range)]
    (frame,) = open_source(encode("a.mkv", clip, colorspace=8, color_range=color_range)).frames()
    y, cg, co = planes[0].astype(float), planes[1] - 128.0, planes[2] - 128.0
    codes = np.stack([y - cg + co, y + cg, y - cg - co], -1)
    rgb = codes / 255 if color_range == FULL else (codes - 16) / 219
    exact = parse_transfer("bt709").to_light(rgb) @ np.array(WEIGHTS[1])
    np.testing.assert_allclose(frame.light, exact, atol=6e-7)


def test_yuv_that_claims_to_be_rgb_is_taken_for_untagged(encode, make_picture) -> None:
    y, u, v = (np.full((4, 6), code, np.uint8) for code in (120, 100, 150))
    light = [
        next(open_source(encode(f"{tag}.mkv", [make_picture([y, u, v], "yuv444p", colorspace=tag)],
                                colorspace=tag)).frames()).light
        for tag in (0, 2)
    ]  # fmt: skip
    np.testing.assert_array_equal(*light)
