"""Luminance: the standards' equations in float64, every depth, range, matrix and kind of chroma."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.light.luminance import YuvCode, luminance_of_rgb, luminance_of_yuv, signal_table
from vid2ev.light.pictures import PictureReader
from vid2ev.light.primaries import primaries_of
from vid2ev.light.tags import BT709_WEIGHTS, MATRICES, WEIGHTS
from vid2ev.light.transfer import code_table, parse_transfer


def by_the_book(y, u, v, code: YuvCode, transfer: str, weights) -> np.ndarray:
    """H.273 section 8.3 in float64, for chroma at the places of luma."""
    unit, full = 2.0 ** (code.bits - 8), 2**code.bits - 1
    luma = y / full if code.full_range else (y / unit - 16) / 219
    cb, cr = ((c - 2.0 ** (code.bits - 1)) / (full if code.full_range else 224 * unit) for c in (u, v))
    kr, kb = code.kr_kb
    red, blue = luma + 2 * (1 - kr) * cr, luma + 2 * (1 - kb) * cb
    green = (luma - kr * red - kb * blue) / (1 - kr - kb)
    light = parse_transfer(transfer).to_light(np.clip(np.stack([red, green, blue], -1), 0, 1.25))
    return light @ np.array(weights)


def codes(rng: np.random.Generator, bits: int, shape: tuple[int, int]) -> np.ndarray:
    return rng.integers(0, 2**bits, shape).astype(np.uint8 if bits == 8 else np.uint16)


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize("full_range", [True, False])
@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize("transfer", ["bt709", "srgb"])
def test_full_chroma_against_the_standard(bits: int, full_range: bool, matrix: int, transfer: str) -> None:
    planes = [codes(np.random.default_rng(seed), bits, (40, 50)) for seed in range(3)]
    code = YuvCode(bits, full_range, MATRICES[matrix], (0, 0))
    light = luminance_of_yuv(planes, (50, 40), code, signal_table(transfer), WEIGHTS[9])
    assert light.dtype == np.float32 and light.shape == (40, 50)
    np.testing.assert_allclose(light, by_the_book(*planes, code, transfer, WEIGHTS[9]), atol=6e-7)


def test_the_table_is_as_good_as_the_closed_form() -> None:
    ramp = np.arange(2**16, dtype=np.uint16).reshape(256, 256)
    neutral = np.full_like(ramp, 2**15)
    code = YuvCode(16, True, MATRICES[1], (0, 0))
    for transfer in ("bt709", "srgb", "gamma:2.2"):
        light = luminance_of_yuv([ramp, neutral, neutral], (256, 256), code, signal_table(transfer), BT709_WEIGHTS)
        np.testing.assert_allclose(light, code_table(transfer, 16).reshape(256, 256), atol=2e-7)


@pytest.mark.parametrize("halvings", [(1, 1), (1, 0), (0, 1), (2, 0), (2, 2)])
@pytest.mark.parametrize("size", [(32, 24), (33, 25), (1, 1), (2, 3), (5, 1)])
def test_even_chroma_is_even_whatever_its_grid(halvings: tuple[int, int], size: tuple[int, int]) -> None:
    width, height = size
    small = tuple(-(-n >> k) for n, k in ((height, halvings[1]), (width, halvings[0])))
    y = codes(np.random.default_rng(0), 8, (height, width))
    coarse = luminance_of_yuv(
        [y, np.full(small, 90, np.uint8), np.full(small, 160, np.uint8)],
        size, YuvCode(8, False, MATRICES[1], halvings), signal_table("bt709"), BT709_WEIGHTS,
    )  # fmt: skip
    fine = by_the_book(
        y, np.full_like(y, 90), np.full_like(y, 160), YuvCode(8, False, MATRICES[1], (0, 0)), "bt709", BT709_WEIGHTS
    )
    np.testing.assert_allclose(coarse, fine, atol=6e-7)


def test_chroma_is_sited_left_and_centred_between_rows() -> None:
    """A ramp of chroma over the picture is the same ramp on the fine grid, shifted by where its samples lie; seen in
    red, as linear light of all three channels has the luminance of luma, whatever the chroma."""
    rows, columns = np.indices((12, 16))
    y, red = np.full((24, 32), 128, np.uint8), (1.0, 0.0, 0.0)
    for ramp, fine in (
        (100 + 2 * columns, 100 + np.indices((24, 32))[1]),
        (100 + 2 * rows, 100 + np.indices((24, 32))[0] - 0.5),
    ):
        code = YuvCode(8, False, MATRICES[1], (1, 1))
        u = np.full_like(ramp, 128).astype(np.uint8)
        light = luminance_of_yuv([y, u, ramp.astype(np.uint8)], (32, 24), code, signal_table("linear"), red)
        expected = by_the_book(y, np.full_like(y, 128), fine, code, "linear", red)
        np.testing.assert_allclose(light[1:-1, :-1], expected[1:-1, :-1], atol=1e-6)
        assert np.ptp(expected) > 0.1


def on_the_fine_grid(chroma: np.ndarray, size: tuple[int, int], halvings: tuple[int, int]) -> np.ndarray:
    """Chroma at the places of luma: straight between samples, left in a row and centred between rows, and held beyond
    the outermost."""
    across, down = np.arange(size[0]) / 2 ** halvings[0], (np.arange(size[1]) + 0.5) / 2 ** halvings[1] - 0.5
    full = np.stack([np.interp(across, np.arange(chroma.shape[1]), row) for row in chroma])
    return np.stack([np.interp(down, np.arange(chroma.shape[0]), column) for column in full.T], axis=1)


@pytest.mark.parametrize("halvings", [(1, 1), (1, 0), (0, 1), (2, 0), (2, 2)])
@pytest.mark.parametrize("size", [(32, 24), (33, 25), (131, 7), (1, 1), (2, 3), (5, 1)])
def test_chroma_is_straight_between_its_samples(halvings: tuple[int, int], size: tuple[int, int]) -> None:
    rng, small = np.random.default_rng(0), tuple(-(-n >> k) for n, k in zip(size[::-1], halvings[::-1], strict=True))
    y, u, v = (codes(rng, 8, shape) for shape in (size[::-1], small, small))
    code, weights = YuvCode(8, False, MATRICES[1], halvings), (0.6, 0.0, 0.4)
    light = luminance_of_yuv([y, u, v], size, code, signal_table("bt709"), weights)
    fine = (on_the_fine_grid(chroma, size, halvings) for chroma in (u, v))
    np.testing.assert_allclose(light, by_the_book(y, *fine, code, "bt709", weights), atol=1e-6)


def test_rows_may_be_longer_than_the_picture() -> None:
    y, u, v = (codes(np.random.default_rng(k), 8, (8, 16)) for k in range(3))
    code = YuvCode(8, True, MATRICES[1], (0, 0))
    whole = luminance_of_yuv([y, u, v], (16, 8), code, signal_table("srgb"), BT709_WEIGHTS)
    part = luminance_of_yuv([y, u, v], (10, 8), code, signal_table("srgb"), BT709_WEIGHTS)
    np.testing.assert_array_equal(part, whole[:, :10])


def test_light_brighter_than_white_goes_on() -> None:
    y, neutral = np.full((1, 1), 254, np.uint8), np.full((1, 1), 128, np.uint8)
    code = YuvCode(8, False, MATRICES[1], (0, 0))
    (light,) = luminance_of_yuv([y, neutral, neutral], (1, 1), code, signal_table("bt709"), BT709_WEIGHTS)[0]
    assert light == pytest.approx(float(parse_transfer("bt709").to_light(np.array((254 - 16) / 219))), abs=1e-6)
    assert light > 1.18


CHROMATICITIES = {  # H.273 table 2: red, green, blue; white is D65
    1: ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06)),
    5: ((0.64, 0.33), (0.29, 0.60), (0.15, 0.06)),
    6: ((0.63, 0.34), (0.31, 0.595), (0.155, 0.07)),
    7: ((0.63, 0.34), (0.31, 0.595), (0.155, 0.07)),
    9: ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046)),
    12: ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06)),
}


@pytest.mark.parametrize("tag", WEIGHTS)
def test_weights_follow_from_the_primaries(tag: int) -> None:
    def xyz(x: float, y: float) -> np.ndarray:
        return np.array([x / y, 1.0, (1 - x - y) / y])

    primaries = np.stack([xyz(*xy) for xy in CHROMATICITIES[tag]], axis=1)
    weights = np.linalg.solve(primaries, xyz(0.3127, 0.3290))  # luminance of each that together makes white
    np.testing.assert_allclose(WEIGHTS[tag], weights, atol=1e-4)
    assert sum(WEIGHTS[tag]) == pytest.approx(1, abs=1e-9)


@given(st.integers(0, 255), st.integers(0, 255), st.integers(0, 255))
@settings(max_examples=30)
def test_rgb_is_a_sum_of_light(red: int, green: int, blue: int) -> None:
    table = code_table("srgb", 8)
    channels = [np.full((1, 1), c, np.uint8) for c in (red, green, blue)]
    light = luminance_of_rgb(channels, (1, 1), table, BT709_WEIGHTS)[0, 0]
    expected = sum(
        Fraction(float(table[c])) * Fraction(w) for c, w in zip((red, green, blue), BT709_WEIGHTS, strict=True)
    )
    assert light == pytest.approx(float(expected), abs=2e-7)


def test_codes_beyond_their_depth_are_white_and_no_crash() -> None:
    wild = np.full((2, 2), 65535, np.uint16)
    assert np.all(luminance_of_rgb([wild] * 3, (2, 2), code_table("linear", 10), BT709_WEIGHTS) == 1)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_grey_picture_is_its_table_in_grey_and_in_colour(dtype) -> None:
    rng = np.random.default_rng(0)
    grey = rng.integers(0, np.iinfo(dtype).max + 1, (9, 7)).astype(dtype)
    reader = PictureReader("srgb")
    expected = code_table("srgb", 8 * grey.itemsize)[grey]
    np.testing.assert_array_equal(reader.light(grey), expected)
    np.testing.assert_allclose(reader.light(np.dstack([grey] * 3)), expected, atol=1e-7)
    np.testing.assert_array_equal(reader.light(grey[:, ::-1]), expected[:, ::-1])


def test_float_pictures_are_light_as_they_stand() -> None:
    picture = np.array([[0.5, np.nan], [-1.0, 7.0]])
    light = PictureReader("linear").light(picture)
    np.testing.assert_array_equal(light, picture.astype(np.float32))
    assert light.dtype == np.float32 and light.flags.c_contiguous
    colour = PictureReader("linear").light(np.array([[[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]], np.float32))
    np.testing.assert_allclose(colour[0], BT709_WEIGHTS, rtol=1e-6)
    assert PictureReader("gamma:2").light(np.full((1, 1), 0.5))[0, 0] == pytest.approx(0.25)


def test_infinite_light_stays_so_in_its_own_channels() -> None:
    for channels in ([np.inf, 1.0, 0.5], [np.inf] * 3, [0.5, -1.0, np.inf]):
        picture = np.full((2, 3, 3), channels, np.float32)
        np.testing.assert_array_equal(PictureReader("linear", "rgb").light(picture), picture)


def test_infinite_light_of_other_primaries_is_a_number_in_every_channel() -> None:
    """What is infinite has no colour that could be mixed anew; the pixels beside it do."""
    wide = primaries_of(9)
    picture = np.float32([[[np.inf, np.inf, np.inf], [0.5, np.inf, 0.2], [0.2, 0.5, 0.1]]])
    light = PictureReader("linear", "rgb").light(picture, wide)
    np.testing.assert_array_equal(light[0, :2], picture[0, :2])
    np.testing.assert_allclose(light[0, 2], wide.to_bt709 @ picture[0, 2], rtol=1e-5)
    assert (PictureReader("linear").light(picture, wide)[0, :2] == np.inf).all()
