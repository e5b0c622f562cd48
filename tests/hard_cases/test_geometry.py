"""Geometry that breaks warping: planes at the eye, grazing looks, spikes of depth, pictures of 8K, half pixels."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.rig.homography import places_on_plane
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid
from vid2ev.rig.pose import Pose
from vid2ev.rig.views import Views


def pinhole(size: tuple[int, int] = (48, 36), focal: float = 45.0) -> Intrinsics:
    return Intrinsics(size=size, focal_px=(focal, focal), centre_px=((size[0] - 1) / 2, (size[1] - 1) / 2))


SOURCE = pinhole()
FLOAT32_PX = 2e-3  # of places of which float32 has the nearest, in a picture that is no larger than 8K


def exact_place(source: Intrinsics, camera: Intrinsics, pose: Pose, plane_m: float, px: tuple[int, int]):
    """Where the ray of a pixel meets the plane, in pixels of the source, in 50 digits; None if it does not."""
    with mpmath.workdps(50):
        ray = [(mpmath.mpf(px[k]) - camera.centre_px[k]) / camera.focal_px[k] for k in (0, 1)] + [mpmath.mpf(1)]
        turned = [sum(mpmath.mpf(float(pose.rotation[i, j])) * ray[j] for j in range(3)) for i in range(3)]
        ahead = mpmath.mpf(plane_m) - float(pose.translation_m[2])
        if turned[2] <= 0 or ahead <= 0:
            return None
        hit = [float(pose.translation_m[k]) + turned[k] * ahead / turned[2] for k in (0, 1)]
        return tuple(float(hit[k] / plane_m * source.focal_px[k] + source.centre_px[k]) for k in (0, 1))


def hold_to_the_rays(source: Intrinsics, camera: Intrinsics, pose: Pose, plane_m: float) -> int:
    """Every place is where its ray meets the plane, and seen if that is in the picture; returns how many are."""
    found = places_on_plane(source, camera, pose, plane_m)
    assert np.isfinite(found.x).all() and np.isfinite(found.y).all()
    last = np.array(source.size) - 0.5
    for y, x in np.ndindex(*found.x.shape):
        place = exact_place(source, camera, pose, plane_m, (x, y))
        if place is None:
            assert not found.seen[y, x]
            continue
        inside = min(min(place) + 0.5, *(last - place))
        if abs(inside) > FLOAT32_PX:
            assert found.seen[y, x] == (inside > 0)
        if inside > 0:
            assert (found.x[y, x], found.y[y, x]) == pytest.approx(place, abs=FLOAT32_PX)
    return int(found.seen.sum())


@pytest.mark.parametrize("away", [1e-1, 1e-3, 1e-6, 1e-8])
def test_a_homography_that_is_nearly_singular(away):
    """A camera so near the plane that all of its picture is one place of the source's, or a part of a pixel."""
    camera, pose = pinhole((16, 12), 15), Pose.of((1.0, -2.0, 3.0), (0.05, -0.02, 2.0 * (1 - away)))
    shear = np.eye(3) + np.outer(pose.translation_m, (0, 0, 1)) / (2.0 - pose.translation_m[2])
    matrix = SOURCE.matrix @ shear @ pose.rotation @ np.linalg.inv(camera.matrix)
    assert np.isfinite(matrix).all() and np.linalg.cond(matrix) > 0.2 / away
    assert hold_to_the_rays(SOURCE, camera, pose, 2.0) == 16 * 12
    light = np.random.default_rng(0).random((36, 48), np.float32)
    view = Views(SOURCE, [(camera, pose)], 2.0).see(light)[0]
    assert view.valid.all() and view.light.min() > 0 and view.light.max() < 1.2
    if away < 1e-3:  # a part of a pixel: hardly any light differs
        assert np.ptp(view.light) < 200 * away + 1e-5


@pytest.mark.parametrize("turn_deg", [60.0, 89.0, 89.999, 89.9999999, 90.0, 90.0000001, 91.0, 120.0, 179.9999])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_look_that_grazes_the_plane(turn_deg, axis):
    """Rays that meet the plane far away or never: no place that is not, and none in the mask that is not seen."""
    turn = [0.0, 0.0, 0.0]
    turn[axis] = turn_deg
    camera, pose = pinhole((20, 20), 3), Pose.of(tuple(turn), (0.1, 0.0, 0.3))
    seen = hold_to_the_rays(SOURCE, camera, pose, 2.0)
    assert (seen > 0) == (turn_deg < 100)
    light = np.random.default_rng(0).random((36, 48, 3), np.float32)
    view = Views(SOURCE, [(camera, pose)], 2.0).see(light)[0]
    assert np.isfinite(view.light).all() and view.light.min() >= 0


@settings(max_examples=25, derandomize=True)
@given(st.tuples(*[st.floats(-180, 180)] * 3), st.tuples(*[st.floats(-3, 3)] * 3), st.floats(-7, 7))
def test_any_camera_before_any_plane(turn, way, decades):
    plane_m = 10.0**decades
    hold_to_the_rays(SOURCE, pinhole((9, 7), 6), Pose.of(turn, way), plane_m)


def slanted(angle_deg: float) -> np.ndarray:
    """Depth of a plane that is turned by an angle about the vertical, 2 m away in the middle [m]."""
    x = (pixel_grid(SOURCE.size)[..., 0] - SOURCE.centre_px[0]) / SOURCE.focal_px[0]
    with np.errstate(divide="ignore"):
        return (2.0 / np.maximum(1.0 - x * math.tan(math.radians(angle_deg)), 1e-12)).astype(np.float32)


@pytest.mark.parametrize("angle_deg", [-85.0, -60.0, 30.0, 60.0, 75.0, 85.0, 89.9])
def test_a_surface_that_is_seen_at_a_grazing_angle(angle_deg):
    """Of a slanted plane inverse depth is linear in the picture: what is seen is where its disparity says."""
    depth_m = slanted(angle_deg)
    baseline_m = 0.05
    light = np.random.default_rng(0).random(depth_m.shape, np.float32)
    views = Views(SOURCE, [(SOURCE, Pose.of((0, 0, 0), (baseline_m, 0, 0)))])
    view, places = views.see(light, depth_m)[0], views.looks(depth_m)[0].places
    assert np.isfinite(view.light).all() and view.light.min() >= 0 and view.light.max() < 1.5
    # x_source = x_camera + f b / Z(x_source), and f / Z = (f - (x - cx) tan) / 2 there
    across, slope = pixel_grid(SOURCE.size)[..., 0], math.tan(math.radians(angle_deg)) * baseline_m / 2
    want = (across + (SOURCE.focal_px[0] * baseline_m / 2 + SOURCE.centre_px[0] * slope)) / (1 + slope)
    inside = places.seen & (want > 1) & (want < 46) & (depth_m[18, np.clip(np.rint(want).astype(int), 0, 47)] < 1e3)
    if abs(angle_deg) < 80:
        assert inside.mean() > 0.3
        assert np.abs(places.x - want)[inside].max() < 0.03


SPIKES = [0.0, -1.0, np.nan, 1e-7, 1e-5, 0.02, 1e4, 1e9, np.inf, -np.inf, 3e38]


@pytest.mark.parametrize("spike_m", SPIKES)
def test_a_spike_of_depth_stays_where_it_is(spike_m):
    """Single pixels of wrong depth in a wall: light is finite, and far from them and from where they are seen now it is
    that of the wall alone."""
    light = np.random.default_rng(0).random((36, 48), np.float32)
    wall, spiked = np.full((36, 48), 2.0, np.float32), np.full((36, 48), 2.0, np.float32)
    at = [(9, 12), (20, 30), (30, 8)]
    for y, x in at:
        spiked[y, x] = spike_m
    views = Views(SOURCE, [(SOURCE, Pose.of((0, 0, 0), (0.05, 0, 0)))])
    plain = views.see(light, wall)[0].light.copy()
    seen = views.see(light, spiked)[0]
    assert np.isfinite(seen.light).all() and seen.light.min() >= 0 and seen.light.max() < 1.5
    near = np.zeros((36, 48), np.bool_)
    for y, _ in at:
        near[max(y - 4, 0) : y + 5] = True  # (a spike may be seen, or hide what is behind it, anywhere in its row)
    np.testing.assert_allclose(seen.light[~near], plain[~near], atol=1e-5)
    known = spike_m >= 1e-6
    assert known or not seen.valid[[y for y, _ in at], [round(x - 45 * 0.05 / 2) for _, x in at]].any()


@pytest.mark.parametrize("size", [(7680, 12), (12, 4320)])
def test_places_of_8k_are_as_good_as_float32_has_them(size):
    """At the far end of a row of 7680 pixels a place is right to 1/2000 px, and so is the light there."""
    source = Intrinsics(size=size, focal_px=(6000, 6000), centre_px=((size[0] - 1) / 2, (size[1] - 1) / 2))
    pose, plane_m = Pose.of((0, 0, 0), (0.0011, 0.0002, 0)), 3.0
    found = places_on_plane(source, source, pose, plane_m)
    grid = pixel_grid(size)
    want = grid + 6000 * pose.translation_m[:2] / plane_m
    seen = found.seen & (want < np.array(size) - 1).all(-1)
    off = np.abs(np.stack([found.x, found.y], -1) - want)[seen]
    assert seen.mean() > 0.5 and off.max() <= 5e-4
    wave = lambda place: 0.5 + 0.4 * np.sin(place[..., 0] * 0.7 + place[..., 1] * 0.9)  # noqa: E731
    view = Views(source, [(source, pose)], plane_m).see(wave(grid).astype(np.float32))[0]
    away = np.abs(view.light - wave(want))
    inside = seen & (grid > 2).all(-1) & (want < np.array(size) - 3).all(-1)
    along = np.argwhere(inside)[:, 0 if size[1] > size[0] else 1]
    late, early = (away[inside][(along > max(size) // 2) == half].max() for half in (True, False))
    assert late < 2 * early + 1e-3 and late < 0.03


@pytest.mark.parametrize("size", [(16, 12), (24, 18), (12, 9), (96, 72), (144, 108), (480, 360)])
def test_pixels_of_other_sizes_look_from_their_middles(size):
    """Place i of n is at (i + 1/2) W / n - 1/2: a slope of light is the same slope in pixels of any size."""
    x, y = np.moveaxis(pixel_grid(SOURCE.size), -1, 0)
    light = (1 + 0.01 * x + 0.02 * y).astype(np.float32)
    view = Views(SOURCE, [(SOURCE.scaled_to(size), Pose.of((0, 0, 0)))]).see(light)[0]
    across, down = np.moveaxis((pixel_grid(size) + 0.5) * (48 / size[0]) - 0.5, -1, 0)
    inside = (across >= 3) & (across <= 44) & (down >= 3) & (down <= 32)  # (a spline feels the border)
    assert view.valid.all()
    np.testing.assert_allclose(view.light[inside], (1 + 0.01 * across + 0.02 * down)[inside], atol=3e-4)
    np.testing.assert_allclose(view.light.mean(), light.mean(), rtol=1e-3)


@pytest.mark.parametrize("size", [(9, 7), (8, 6)])
def test_turned_upside_down_each_pixel_is_another_pixel(size):
    """A turn by 180 degrees about the line of sight: pixel x is pixel W - 1 - x, neither half a pixel more nor less."""
    camera = pinhole(size, 9)
    light = np.random.default_rng(1).random(size[::-1], np.float32)
    view = Views(camera, [(camera, Pose.of((0, 0, 180)))]).see(light)[0]
    assert view.valid.all()
    np.testing.assert_allclose(view.light, light[::-1, ::-1], atol=2e-6)


def test_there_and_back_again_is_where_it_was():
    """Through a camera with four times the pixels and back: no shift, no loss of what is smooth."""
    x, y = np.moveaxis(pixel_grid(SOURCE.size), -1, 0)
    light = (0.5 + 0.4 * np.sin(0.35 * x + 0.1) * np.cos(0.3 * y)).astype(np.float32)
    fine = SOURCE.scaled_to((192, 144))
    large = Views(SOURCE, [(fine, Pose.of((0, 0, 0)))]).see(light)[0].light
    back = Views(fine, [(SOURCE, Pose.of((0, 0, 0)))]).see(np.ascontiguousarray(large))[0].light
    np.testing.assert_allclose(back[3:-3, 3:-3], light[3:-3, 3:-3], atol=6e-3)
