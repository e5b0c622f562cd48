"""Lenses bend as OpenCV says they do, and what they bend is made straight again."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vid2ev.rig.intrinsics import Framing, Intrinsics
from vid2ev.rig.lens import pixel_grid, pixels_of, radial_table, rays_of

SIZE = (640, 480)
LENSES = {
    "none": ("none", ()),
    "barrel": ("radtan", (-0.3, 0.1, 0.001, -0.0005)),
    "five": ("radtan", (-0.28, 0.08, -0.002, 0.0015, 0.01)),
    "rational": ("radtan", (0.3, -0.1, 0.001, -0.0005, 0.02, 0.1, 0.05, 0.01)),
    "pincushion": ("radtan", (0.15, 0.02, 0.0, 0.0)),
    "fisheye": ("equidistant", (0.05, -0.01, 0.003, -0.001)),
}


def lens(name: str, focal: float = 400) -> Intrinsics:
    model, distortion = LENSES[name]
    return Intrinsics(
        size=SIZE, focal_px=(focal, 1.02 * focal), centre_px=(322.4, 237.1), model=model, distortion=distortion
    )


def opencv_pixels(points: np.ndarray, camera: Intrinsics) -> np.ndarray:
    still, values = np.zeros(3), np.array(camera.distortion)
    if camera.model == "equidistant":
        return cv2.fisheye.projectPoints(points[:, None].copy(), still, still, camera.matrix, values)[0][:, 0]
    return cv2.projectPoints(points, still, still, camera.matrix, values)[0][:, 0]


@pytest.mark.parametrize("name", LENSES)
def test_lenses_bend_as_those_of_opencv(name: str) -> None:
    camera = lens(name)
    rays = rays_of(pixel_grid(SIZE)[::7, ::7], camera).reshape(-1, 3)
    assert not np.isnan(rays).any()
    points = rays * np.random.default_rng(0).uniform(0.1, 50, (len(rays), 1))
    np.testing.assert_allclose(pixels_of(points, camera), opencv_pixels(points, camera), atol=1e-6)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("fov_deg", [10, 60, 120])
def test_a_field_is_what_is_seen_through_the_lens(name: str, fov_deg: float) -> None:
    """Without tangential distortion, by which it is not the same on both sides."""
    model, distortion = LENSES[name]
    if model == "radtan":
        distortion = (*distortion[:2], 0.0, 0.0, *distortion[4:])
    farthest = np.inf if model == "none" else radial_table(lens(name))[0][-1]
    if np.tan(np.radians(fov_deg / 2)) > farthest:
        with pytest.raises(ValueError, match="is more than this lens sees"):
            Intrinsics.of_field(SIZE, fov_deg, model, distortion)
        return
    camera = Intrinsics.of_field(SIZE, fov_deg, model, distortion)
    assert camera.fov_deg == pytest.approx(fov_deg, abs=1e-6)


@pytest.mark.parametrize("name", LENSES)
def test_every_pixel_finds_its_ray_again(name: str) -> None:
    camera, grid = lens(name), pixel_grid(SIZE)[::3, ::3]
    rays = rays_of(grid, camera)
    np.testing.assert_allclose(pixels_of(rays, camera), grid, atol=1e-6)
    np.testing.assert_allclose(opencv_pixels(rays.reshape(-1, 3), camera), grid.reshape(-1, 2), atol=1e-4)


def test_what_is_along_the_plane_of_the_picture_is_infinitely_far_out() -> None:
    camera = Intrinsics(size=(150, 70), focal_px=(89.4, 89.4), centre_px=(74.5, 34.5))
    with np.errstate(all="raise"):
        assert pixels_of(np.array([0.0, 0.5, np.finfo(np.float64).tiny]), camera).tolist() == [74.5, np.inf]


def test_a_fisheye_sees_nearly_all_that_is_before_it() -> None:
    camera, angles = lens("fisheye", 150), np.radians([60, 75, 89])
    points = np.stack([np.sin(angles), np.zeros(3), np.cos(angles)], axis=1)
    seen = pixels_of(points, camera)
    np.testing.assert_allclose(seen, opencv_pixels(points, camera), atol=1e-6)
    rays = rays_of(seen, camera)
    np.testing.assert_allclose(rays[:, 0], np.tan(angles), rtol=1e-6)


def test_what_no_lens_sees_has_no_pixel() -> None:
    for name in LENSES:
        behind = pixels_of(np.array([[0, 0, -1.0], [1, 1, 0], [0.1, 0, -1e-12], [np.nan, 0, 1]]), lens(name))
        assert np.isnan(behind).all()
    folding = Intrinsics(
        size=SIZE, focal_px=(300, 300), centre_px=(320, 240), model="radtan", distortion=(-0.3, 0, 0, 0)
    )
    turn = np.sqrt(1 / 0.9)  # r - 0.3 r**3 falls from here on
    assert radial_table(folding)[0][-1] == pytest.approx(turn, rel=1e-2)
    seen = pixels_of(np.array([[turn * 0.98, 0, 1], [turn * 1.02, 0, 1], [1.8, 0, 1]]), folding)
    assert not np.isnan(seen[0]).any() and np.isnan(seen[1:]).all()
    outside = 320 + 300 * turn * (1 - 0.3 * turn**2) + 1
    assert np.isnan(rays_of(np.array([[outside, 240.0]]), folding)[0, :2]).all()


@settings(max_examples=60)
@example(
    [0.7993011981156823, 0.921875, 0.921875, -0.63404049338429, -0.84375, 0.7993011981156823, 0.0, -0.3949154126346851],
    ("radtan", 8),
    10.0,
)  # infinite where Newton's method comes past
@given(
    st.lists(st.floats(-1, 1), min_size=8, max_size=8),
    st.sampled_from([("radtan", 4), ("radtan", 5), ("radtan", 8), ("equidistant", 4)]),
    st.floats(10, 3000),
)
def test_any_coefficients_give_pixels_or_nothing(values: list[float], kind: tuple[str, int], focal: float) -> None:
    model, count = kind
    camera = Intrinsics(
        size=(32, 24), focal_px=(focal, focal), centre_px=(15.5, 11.5), model=model, distortion=tuple(values[:count])
    )  # fmt: skip
    grid = pixel_grid((32, 24))
    rays = rays_of(grid, camera)
    found = ~np.isnan(rays).any(-1)
    np.testing.assert_allclose(pixels_of(rays[found], camera), grid[found], atol=1e-5)


@pytest.mark.parametrize("name", LENSES)
def test_a_part_of_a_picture_is_the_picture_at_its_places(name: str) -> None:
    """Parts of 2 x 3 pixels: their middles see what those places of the whole picture see."""
    whole, framing = lens(name), Framing(SIZE, (100, 60), (200, 150), (100, 50))
    part = framing.lens_of_part(whole)
    places = (pixel_grid(part.size) + 0.5) * np.array([2, 3]) + np.array([100, 60]) - 0.5
    np.testing.assert_allclose(rays_of(pixel_grid(part.size), part), rays_of(places, whole), atol=1e-9)
    back = framing.lens_of_whole(part)
    assert back.size == SIZE and back.distortion == whole.distortion
    np.testing.assert_allclose(back.matrix, whole.matrix, rtol=1e-14, atol=1e-11)


@pytest.mark.parametrize("size", [(20, 20), (80, 10), (40, 30), (13, 47)])
def test_of_another_shape_the_width_stays_and_rows_are_cut_or_added_on_both_sides(size: tuple[int, int]) -> None:
    lens = Intrinsics(size=(40, 30), focal_px=(33.0, 31.0), centre_px=(18.0, 16.0))
    other, across = lens.scaled_to(size), size[0] / 40
    ends = [np.array([[-0.5, row], [width - 0.5, row]]) for width, row in ((40, 14.5), (size[0], (size[1] - 1) / 2))]
    np.testing.assert_allclose(rays_of(ends[1], other), rays_of(ends[0], lens), atol=1e-12)
    assert other.focal_px == pytest.approx((33 * across, 31 * across))
