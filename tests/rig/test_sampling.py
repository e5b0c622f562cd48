"""Light between the pixels: through the pixels, flat where flat, never far from what is there."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.ndimage
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.rig.bands import Bands
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid
from vid2ev.rig.sampling import pixel_means, sampled
from vid2ev.rig.spline import Spline
from vid2ev.rig.surface import corners_of, surface_of
from vid2ev.upsample.mended import mended

ONE = Bands(1)


def at(light: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    places = (np.asarray(place, np.float32) for place in (x, y))
    return sampled(Spline(light, ONE), *places, ONE)


def test_it_is_the_spline_of_scipy() -> None:
    random = np.random.default_rng(0)
    light = 1 + 0.1 * random.random((40, 50), np.float32)
    x, y = random.uniform(0, 49, (30, 30)), random.uniform(0, 39, (30, 30))
    expected = scipy.ndimage.map_coordinates(light.astype(float), [y, x], order=3, mode="mirror")
    held = np.abs(at(light, x, y)[..., 0] - expected)
    assert np.quantile(held, 0.9) < 1e-6 and held.max() < 0.03  # (the few that ring are held back)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (2, 2), (3, 2), (33, 29), (20, 30, 3)])
def test_at_a_pixel_it_is_the_pixel(shape: tuple[int, ...]) -> None:
    light = np.random.default_rng(1).random(shape, np.float32)
    x, y = np.moveaxis(pixel_grid((shape[1], shape[0])), -1, 0)
    np.testing.assert_allclose(at(light, x, y).reshape(shape), light, atol=2e-6)
    beyond = at(light, x - 2 * shape[1], y)  # the border goes on
    np.testing.assert_allclose(beyond.reshape(shape)[:, 0], light[:, 0], atol=2e-6)


@given(st.floats(0, 1e4, width=32), st.integers(0, 2**32 - 1))
def test_flat_light_stays_exactly_flat(value: float, seed: int) -> None:
    light, random = np.full((17, 19), value, np.float32), np.random.default_rng(seed)
    x, y = random.uniform(-3, 22, (2, 12, 12))
    fine = at(light, x, y)[..., 0]
    assert (fine == np.float32(value)).all()
    assert (pixel_means(fine[..., None], 3) == np.float32(value)).all()


@given(st.integers(0, 2**32 - 1))
def test_a_lamp_neither_rings_far_away_nor_darkens_below_zero(seed: int) -> None:
    light, random = np.full((21, 21), 0.01, np.float32), np.random.default_rng(seed)
    light[10, 10] = 1000
    x, y = random.uniform(0, 20, (2, 30, 30))
    found, away = at(light, x, y)[..., 0], np.maximum(np.abs(x - 10), np.abs(y - 10))
    assert (found >= 0.0025).all() and (found <= 1500).all()
    assert (found[away > 1.6] == np.float32(0.01)).all()


def test_light_that_is_no_number_stays_where_it_is() -> None:
    light = np.full((30, 30), 0.5, np.float32)
    light[5, 5], light[15, 15], light[25, 25] = np.nan, np.inf, -np.inf
    x, y = np.moveaxis(pixel_grid((30, 30)) + 0.3, -1, 0)
    found = at(light, x, y)[..., 0]
    assert np.isfinite(found).all() and (found[8:12] == 0.5).all() and found[15, 15] > 1000


@pytest.mark.parametrize("huge", [1e15, 1e30, 1e38, 3.4e38])
def test_light_that_no_scene_has_is_infinite_light(huge: float) -> None:
    light = np.random.default_rng(7).random((20, 30, 3), np.float32)
    light[5, 5], light[9, 20, 1], light[15, 8] = np.inf, np.inf, -np.inf
    x, y = np.moveaxis(pixel_grid((30, 20)) + 0.3, -1, 0)
    expected = at(light, x, y)
    assert (at(np.where(np.isinf(light), np.sign(light) * np.float32(huge), light), x, y) == expected).all()
    assert (at(mended(light), x, y) == expected).all()  # (as it is in frames between others)


def test_light_moves_smoothly() -> None:
    """The slope along a path has no steps, as that of a piecewise line or parabola would."""
    light = 0.5 + 0.4 * np.sin(np.arange(40, dtype=np.float32) * 1.3)[None].repeat(5, 0)
    x = np.linspace(5, 30, 25 * 64 + 1)[None]
    found = at(light, x, np.full_like(x, 2))[0, :, 0].astype(float)
    bends = np.abs(np.diff(found, 2)) * 64**2
    assert bends.max() < 1.25 * 0.4 * 1.3**2


def test_means_over_pixels_are_means() -> None:
    fine = np.random.default_rng(3).random((12, 8, 3), np.float32)
    np.testing.assert_allclose(pixel_means(fine, 4), fine.reshape(3, 4, 2, 4, 3).mean(axis=(1, 3)), atol=1e-6)


def test_light_that_is_nowhere_negative_stays_so() -> None:
    light = np.random.default_rng(4).integers(0, 2, (40, 50)).astype(np.float32)  # black pixels beside white ones
    x, y = np.random.default_rng(5).uniform(-1, 51, (2, 60, 70)).astype(np.float32)
    spline = Spline(light, Bands(1))
    assert sampled(spline, x, y, Bands(1)).min() >= 0


def test_light_behind_a_cut_two_pixels_away_changes_nothing() -> None:
    source = Intrinsics(size=(32, 12), focal_px=(30.0, 30.0), centre_px=(15.5, 5.5))
    columns = np.arange(32, dtype=np.float32)
    inverse = np.tile(np.where(columns < 16, 1, 0.1), (12, 1)).astype(np.float32)
    light = np.tile(0.2 + 0.01 * columns + np.where(columns < 16, 0, 5), (12, 1)).astype(np.float32)
    surface = surface_of(inverse, corners_of(source), source)
    x, y = np.meshgrid(columns + np.float32(0.3), np.arange(12, dtype=np.float32))
    cuts = surface.near_cut, surface.inverse[1:-1, 1:-1], surface.steep
    found = sampled(Spline(light, Bands(1)), x, y, Bands(1), *cuts)
    np.testing.assert_allclose(found[5, 14, 0], 0.2 + 0.01 * 14.3, atol=2e-3)  # (the cut is between 15 and 16)


def test_pixels_of_a_slanted_surface_count_beside_a_cut_as_far_as_they_are_of_it() -> None:
    source = Intrinsics(size=(32, 12), focal_px=(30.0, 30.0), centre_px=(15.5, 5.5))
    columns = np.arange(32, dtype=np.float32)
    steep = surface_of(np.ones((12, 32), np.float32), corners_of(source), source).steep
    slanted = (1 - 0.7 * steep) ** columns  # (a step is no cut, and two together are more than one may be)
    inverse = np.tile(np.where(columns < 16, slanted, 1e-3 * slanted), (12, 1)).astype(np.float32)
    light = np.tile(0.2 + 0.1 * columns + np.where(columns < 16, 0, 5), (12, 1)).astype(np.float32)
    surface = surface_of(inverse, corners_of(source), source)
    x, y = np.full((1, 1), 14.75, np.float32), np.full((1, 1), 5, np.float32)
    cuts = surface.near_cut, surface.inverse[1:-1, 1:-1], surface.steep
    first, second = -0.5 * 0.75 * 0.25**2, 1 - 2.5 * 0.75**2 + 1.5 * 0.75**3  # (Keys: of pixels 13 and 14; own is 15)
    expected = light[5, 15] - 0.2 * first - 0.1 * second
    assert sampled(Spline(light, Bands(1)), x, y, Bands(1), *cuts)[0, 0, 0] == pytest.approx(expected, abs=1e-5)


def test_beside_a_cut_light_stays_within_that_of_the_pixels_of_its_surface() -> None:
    """Cubic convolution by itself goes beyond a bright line: below zero beside it, above it within."""
    source = Intrinsics(size=(32, 12), focal_px=(30.0, 30.0), centre_px=(15.5, 5.5))
    columns = np.arange(32)
    inverse = np.tile(np.where(columns < 16, 1, 0.1), (12, 1)).astype(np.float32)
    light = np.tile(np.isin(columns, (13, 14)), (12, 1)).astype(np.float32)
    surface = surface_of(inverse, corners_of(source), source)
    x, y = np.meshgrid(np.linspace(12.0, 15.4, 35, dtype=np.float32), np.full(1, 5, np.float32))
    cuts = surface.near_cut, surface.inverse[1:-1, 1:-1], surface.steep
    assert surface.near_cut[5, 14:16].all()
    found = sampled(Spline(light, Bands(1)), x, y, Bands(1), *cuts)[0, :, 0]
    near = surface.near_cut[5, np.rint(x[0]).astype(int)]
    assert near.sum() > 10 and found[near].min() >= 0 and found[near].max() <= 1
