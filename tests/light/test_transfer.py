"""Transfer curves: the published forms, there and back, monotone; ranges."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.light.transfer import code_table, parse_transfer, signal_of_codes

CURVES = ["linear", "srgb", "bt709", "smpte240m", "gamma:2.2", "gamma:0.5"]  # from 0 at 0 to 1 at 1


def published_srgb(v: float) -> float:
    """IEC 61966-2-1."""
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4


def published_bt709(v: float) -> float:
    """BT.709-6 item 1.2 solved for light, with the three-digit constants that the page has."""
    return v / 4.5 if v < 0.081 else ((v + 0.099) / 1.099) ** (1 / 0.45)


def published_240m(v: float) -> float:
    """SMPTE 240M with the four-digit constants that H.273 has."""
    return v / 4 if v < 4 * 0.0228 else ((v + 0.1115) / 1.1115) ** (1 / 0.45)


@pytest.mark.parametrize(("name", "published", "tolerance"), [
    ("srgb", published_srgb, 1e-15),
    ("bt709", published_bt709, 3e-4),  # its own step at the knee, which the exact constants remove
    ("smpte240m", published_240m, 2e-4),  # likewise
])  # fmt: skip
def test_the_curve_is_the_published_one(name: str, published, tolerance: float) -> None:
    signal = np.linspace(0, 1, 10001)
    expected = [published(v) for v in signal]
    np.testing.assert_allclose(parse_transfer(name).to_light(signal), expected, atol=tolerance)


def test_anchors() -> None:
    for name in CURVES:
        curve = parse_transfer(name)
        np.testing.assert_allclose(curve.to_light(np.array([0.0, 1.0])), [0, 1], atol=1e-12)
    assert parse_transfer("gamma:2.2").to_light(np.array(0.5)) == pytest.approx(0.5**2.2)
    assert parse_transfer("srgb").to_light(np.array(0.5)) == pytest.approx(0.21404114)  # the value on everybody's lips


@pytest.mark.parametrize(("name", "knee"), [("bt709", 4.5 * 0.018053968510807), ("smpte240m", 4 * 0.022821585529445)])
def test_a_camera_curve_has_neither_step_nor_kink(name: str, knee: float) -> None:
    curve = parse_transfer(name)
    below, at, above = curve.to_light(np.array([knee - 1e-9, knee, knee + 1e-9]))
    assert (at - below) / 1e-9 == pytest.approx((above - at) / 1e-9, rel=1e-4)


@pytest.mark.parametrize("name", CURVES)
@given(st.floats(0, 4))
def test_there_and_back(name: str, light: float) -> None:
    curve = parse_transfer(name)
    assert curve.to_light(curve.to_signal(np.array(light))) == pytest.approx(light, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("bits", [8, 10, 16])
def test_a_brighter_code_is_brighter_light(name: str, bits: int) -> None:
    table = code_table(name, bits)
    assert table.dtype == np.float32 and table.shape == (2**bits,)
    assert np.all(np.diff(table.astype(np.float64)) > 0)
    assert table[0] == 0 and table[-1] == 1


@pytest.mark.parametrize("name", CURVES)
def test_outside_the_range(name: str) -> None:
    curve = parse_transfer(name)
    light = curve.to_light(np.array([-0.5, np.nan, 1.5]))
    assert light[0] == 0 and np.isnan(light[1]) and light[2] > 1
    assert np.isnan(curve.to_signal(np.array(np.nan)))


def test_limited_range_is_the_standards() -> None:
    for bits, black, white in ((8, 16, 235), (10, 64, 940), (12, 256, 3760)):
        np.testing.assert_array_equal(signal_of_codes(np.array([black, white]), bits, full_range=False), [0, 1])
    table = code_table("bt709", 8, full_range=False)
    assert np.all(table[:17] == 0) and table[235] == 1 and table[255] > 1


@pytest.mark.parametrize("name", ["rec709", "", "gamma", "gamma:", "gamma:x", "gamma:0", "gamma:nan", "gamma:99"])
def test_unknown_curves_are_refused(name: str) -> None:
    with pytest.raises(UsageError, match="expected"):
        parse_transfer(name)
