"""RGB: the same light as luminance, before it is added up."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.light.primaries import BRADFORD, CHROMATICITIES, D65, primaries_at, primaries_of
from vid2ev.light.tags import BT709_WEIGHTS, MATRICES
from vid2ev.light.transfer import code_table, parse_transfer
from vid2ev.sources import open_source

LIMITED = 1


def both(path: Path | str, **options) -> tuple[np.ndarray, np.ndarray]:
    """Luminance and RGB of the first frame."""
    grey, colour = (next(open_source(path, colour=kind, **options).frames()) for kind in ("luminance", "rgb"))
    assert colour.light.shape == (*grey.light.shape, 3) and colour.light.dtype == np.float32
    assert colour.t_ns == grey.t_ns and colour.light.flags.c_contiguous
    return grey.light, colour.light


def random_planes(sizes: list[tuple[int, int]], bits: int) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    return [rng.integers(0, 2**bits, size).astype(np.uint8 if bits == 8 else np.uint16) for size in sizes]


@pytest.mark.parametrize("tag", CHROMATICITIES)
@pytest.mark.parametrize(("name", "bits", "small"), [
    ("yuv420p", 8, (17, 17)), ("yuv422p10le", 10, (33, 17)), ("yuv444p12le", 12, (33, 33)),
])  # fmt: skip
def test_luminance_of_rgb_is_luminance(encode, make_picture, tag: int, name: str, bits: int, small) -> None:
    planes = random_planes([(33, 33), small, small], bits)
    tags = dict(color_primaries=tag, colorspace=1, color_range=LIMITED)
    grey, colour = both(encode("a.mkv", [make_picture(planes, name, **tags)], **tags))
    np.testing.assert_allclose(colour @ np.array(BT709_WEIGHTS), grey, atol=3e-4, rtol=1e-4)


def test_channels_are_the_standards_equations(encode, make_picture) -> None:
    planes = random_planes([(9, 11)] * 3, 10)
    planes[0] = np.clip(planes[0], 64, 940)
    tags = dict(colorspace=9, color_primaries=1, color_range=LIMITED)
    _, colour = both(encode("a.mkv", [make_picture(planes, "yuv444p10le", **tags)], **tags))
    kr, kb = MATRICES[9]
    luma, cb, cr = (planes[0] / 4 - 16) / 219, (planes[1] - 512.0) / 896, (planes[2] - 512.0) / 896
    red, blue = luma + 2 * (1 - kr) * cr, luma + 2 * (1 - kb) * cb
    green = (luma - kr * red - kb * blue) / (1 - kr - kb)
    signal = np.clip(np.stack([red, green, blue], -1), 0, 1.25)
    np.testing.assert_allclose(colour, parse_transfer("bt709").to_light(signal), atol=6e-7)


def test_wide_gamut_keeps_what_bt709_cannot_mix(encode, make_picture) -> None:
    """Pure BT.2020 green, against the matrix of Rec. ITU-R BT.2087 inverted (its table, M2 of the annex)."""
    zero, full = np.zeros((4, 4), np.uint16), np.full((4, 4), 1023, np.uint16)
    tags = dict(color_primaries=9, colorspace=0, color_range=2, color_trc=8)
    _, colour = both(encode("a.mkv", [make_picture([full, zero, zero], "gbrp10le", **tags)], **tags))
    bt709_to_2020 = np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]])
    np.testing.assert_allclose(colour[0, 0], np.linalg.inv(bt709_to_2020)[:, 1], atol=3e-4)
    assert colour[0, 0].min() < -0.05


@given(
    st.lists(st.floats(-0.02, 0.02), min_size=8, max_size=8),
    st.sampled_from([*CHROMATICITIES.values(), ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), (0.32168, 0.33767))]),
)
def test_luminance_of_rgb_is_luminance_whatever_white_is(moved: list[float], places) -> None:
    """Of the primaries of H.273 and ACEScg, and others near them."""
    weights, to_bt709 = primaries_at([(x + moved[2 * k], y + moved[2 * k + 1]) for k, (x, y) in enumerate(places)])
    np.testing.assert_allclose(weights, np.array(BT709_WEIGHTS) @ to_bt709, atol=3e-4)


@pytest.mark.parametrize("tag", CHROMATICITIES)
def test_white_stays_white(tag: int) -> None:
    weights, to_bt709 = primaries_of(tag)
    np.testing.assert_allclose(to_bt709 @ np.ones(3), 1, atol=1e-9)
    assert sum(weights) == pytest.approx(1, abs=1e-9)


def test_adaptation_is_bradford() -> None:
    """Illuminant C to D65, a published matrix (Lindbloom, "Chromatic adaptation")."""
    c, d65 = (np.array([x / y, 1, (1 - x - y) / y]) for x, y in ((0.31006, 0.31616), D65))
    matrix = np.linalg.inv(BRADFORD) @ np.diag(BRADFORD @ d65 / (BRADFORD @ c)) @ BRADFORD
    published = [[0.9904476, -0.0071683, -0.0116156], [-0.0123712, 1.0155950, -0.0029282],
                 [-0.0035635, 0.0067697, 0.9181569]]  # fmt: skip
    np.testing.assert_allclose(matrix, published, atol=3e-4)


@pytest.mark.parametrize("tag", CHROMATICITIES)
def test_colours_are_the_same_written_as_amounts_of_xyz(tag: int) -> None:
    """The primaries of XYZ itself, two of which have no luminance, as OpenEXR's example `XYZ.exr` has them."""
    x, y = np.transpose([*CHROMATICITIES[tag][:3], (1 / 3, 1 / 3)])
    corners = np.array([x, y, 1 - x - y])[:, :3]
    to_xyz = corners * np.linalg.solve(corners, np.ones(3))
    _, from_xyz = primaries_at([(1, 0), (0, 1), (0, 0), (1 / 3, 1 / 3)])
    _, from_rgb = primaries_at(list(zip(x, y, strict=True)))
    np.testing.assert_allclose(from_xyz @ to_xyz, from_rgb, atol=1e-9)


def test_primaries_that_mix_no_white() -> None:
    for places in ([(0.3, 0.3)] * 4, [(0.6, 0.3), (0.3, 0.6), (0.1, 0.1), (0.3, 0.0)], [(np.nan, 0.1)] * 4):
        with pytest.raises(ValueError, match="no white"):
            primaries_at(places)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_images_and_arrays(tmp_path: Path, dtype) -> None:
    picture = np.random.default_rng(0).integers(0, np.iinfo(dtype).max + 1, (1, 6, 8, 3)).astype(dtype)
    cv2.imwrite(str(tmp_path / "0.png"), picture[0, ..., ::-1])
    np.save(tmp_path / "a.npy", picture)
    expected = code_table("srgb", 8 * picture.itemsize)[picture[0]]
    for path in (tmp_path, tmp_path / "a.npy"):
        grey, colour = both(path, fps=1, transfer="srgb")
        np.testing.assert_array_equal(colour, expected)
        np.testing.assert_allclose(colour @ np.array(BT709_WEIGHTS), grey, atol=1e-6)


def test_grey_is_three_times_the_same(tmp_path: Path, encode) -> None:
    stack = np.random.default_rng(0).uniform(0, 3, (2, 5, 6)).astype(np.float32)
    np.save(tmp_path / "a.npy", stack)
    film = encode("a.mkv", [np.arange(48, dtype=np.uint8).reshape(6, 8)])
    for path, options in ((tmp_path / "a.npy", {"fps": 1}), (film, {}), ("synthetic:sine,size=4x3", {})):
        grey, colour = both(path, **options)
        for channel in range(3):
            np.testing.assert_allclose(colour[..., channel], grey, rtol=2e-7)


def test_a_turned_picture_is_turned_in_colour_too() -> None:
    from vid2ev.sources.planes import upright

    picture = np.random.default_rng(0).uniform(size=(3, 5, 3)).astype(np.float32)
    for orientation in ((True, False, True), (False, True, False), (True, True, True)):
        turned = upright(picture, orientation)
        for channel in range(3):
            np.testing.assert_array_equal(turned[..., channel], upright(picture[..., channel].copy(), orientation))


def test_another_colour_is_refused() -> None:
    with pytest.raises(UsageError, match="colour 'bgr'"):
        open_source("synthetic:sine", colour="bgr")  # type: ignore[arg-type]


def test_real_clips_in_colour(shared_videos: Path) -> None:
    for name in ("intel_asl_book.mkv", "nasa_13013.mp4"):
        grey, colour = both(shared_videos / name)
        np.testing.assert_allclose(colour @ np.array(BT709_WEIGHTS, np.float32), grey, atol=2e-4)
