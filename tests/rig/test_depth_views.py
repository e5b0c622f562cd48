"""Views by depth: the nearest surface wins, nothing cracks, holes are known and filled from behind."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from kornia.geometry.depth import warp_frame_depth
from view_rigs import Texture, pinhole, psnr

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid, rays_of
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.rig.triangles import draw_quads
from vid2ev.rig.views import Views, filled_inverse

SOURCE = pinhole()
BESIDE = Pose.of((0, 0, 0), (0.1, 0, 0))  # 15 px at 1 m, 3.75 px at 4 m
BENT = SOURCE.model_copy(update={"model": "radtan", "distortion": (-0.2, 0.05, 0.002, -0.001)})
FISHEYE = SOURCE.model_copy(update={"model": "equidistant", "distortion": (0.03, -0.01, 0.0, 0.0)})
FRONT, BACK = 0.9, 0.2
Triple = tuple[float, float, float]


def card_before_wall(size: tuple[int, int] = (160, 120)) -> tuple[np.ndarray, np.ndarray]:
    """A card at 1 m before a wall at 4 m: light and depth."""
    light, depth_m = np.full(size[::-1], BACK, np.float32), np.full(size[::-1], 4, np.float32)
    light[40:80, 60:100], depth_m[40:80, 60:100] = FRONT, 1
    return light, depth_m


def slanted(camera: Intrinsics, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Where the rays of a camera meet the plane z = 2 + 0.4 x - 0.3 y: points [H, W, 3] and depths in the camera."""
    normal = np.array([-0.4, 0.3, 1.0])
    rays = rays_of(pixel_grid(camera.size), camera)
    depth_m = (2 - normal @ pose.translation_m) / (rays @ pose.rotation.T @ normal)
    return pose.apply(rays * depth_m[..., None]), depth_m


@pytest.mark.parametrize("source", [SOURCE, BENT], ids=["pinhole", "radtan"])
@pytest.mark.parametrize("camera", [SOURCE, BENT, FISHEYE], ids=["pinhole", "radtan", "equidistant"])
@pytest.mark.parametrize("pose", [BESIDE, Pose.of((2, -5, 8), (0.1, -0.05, 0.15))], ids=["beside", "turned"])
def test_a_slanted_plane_is_seen_as_its_analytic_picture(source: Intrinsics, camera: Intrinsics, pose: Pose) -> None:
    texture = Texture(15.0)  # cycles per metre: 0.2 per pixel at 2 m
    points, depth_m = slanted(source, IDENTITY)
    light = texture(points[..., 0], points[..., 1]).astype(np.float32)
    views = Views(source, [(camera, pose)])
    view = views.see(light, depth_m.astype(np.float32))[0]
    points, _ = slanted(camera, pose)
    inside = cv2.erode(view.valid.astype(np.uint8), np.ones((9, 9)), borderValue=0) > 0
    assert inside.mean() > 0.5
    assert psnr(view.light, texture(points[..., 0], points[..., 1]), inside) >= 42
    looks = views.looks(depth_m.astype(np.float32))[0]
    expected = np.moveaxis(_pixels(points, source), -1, 0)
    for found, place in zip(looks.places[:2], expected, strict=True):
        assert np.abs(found - place)[view.valid].max() < 0.02


def _pixels(points: np.ndarray, camera: Intrinsics) -> np.ndarray:
    flat = points.reshape(-1, 3)
    values = np.array(camera.distortion or (0.0,) * 4)
    return cv2.projectPoints(flat, np.zeros(3), np.zeros(3), camera.matrix, values)[0].reshape((*points.shape[:2], 2))


@pytest.mark.parametrize("behind_m", [-0.2, 0.4, 2.0, 5.0])  # (then each pixel is wide enough for 1, 1, 2 and 4)
def test_a_plane_given_as_depth_is_the_plane(behind_m: float) -> None:
    light = cv2.GaussianBlur(np.random.default_rng(0).random((120, 160), np.float32), (0, 0), 1)
    pose = Pose.of((2, -5, 7), (0.1, -0.05, -behind_m))
    by_depth = Views(SOURCE, [(SOURCE, pose)]).see(light, np.full((120, 160), 2, np.float32))[0]
    by_homography = Views(SOURCE, [(SOURCE, pose)], 2.0).see(light)[0]
    assert (by_depth.valid != by_homography.valid).mean() < 1e-3
    both = by_depth.valid & by_homography.valid
    np.testing.assert_allclose(by_depth.light[both], by_homography.light[both], atol=2e-4)


def test_holes_are_filled_from_beyond_their_rim_also_by_wide_pixels() -> None:
    """A rim of 3 px of the source, on which the light of the card is mixed in, is less than two px of half as many."""
    light, depth_m = card_before_wall()
    light[40:80, 100:103] = FRONT
    view = Views(SOURCE, [(SOURCE.scaled_to((80, 60)), BESIDE)]).see(light, depth_m)[0]
    hole = np.flatnonzero(~view.valid[30, :70])
    assert len(hole) >= 5  # (the first of them is half the card)
    np.testing.assert_allclose(view.light[22:38, hole[1:]], BACK, atol=1e-5)


def test_it_agrees_with_the_inverse_warp_of_kornia() -> None:
    """Warped back by the depth of the other camera, which kornia needs and a slanted plane has in closed form."""
    pose, camera = Pose.of((1, -2, 3), (0.1, -0.05, 0.1)), SOURCE
    points, depth_m = slanted(SOURCE, IDENTITY)
    light = Texture(6.0)(points[..., 0], points[..., 1]).astype(np.float32)
    view = Views(SOURCE, [(camera, pose)]).see(light, depth_m.astype(np.float32))[0]
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.translation_m
    tensors = [
        torch.from_numpy(np.asarray(array, np.float32))
        for array in (light, slanted(camera, pose)[1], matrix, camera.matrix)
    ]
    theirs = warp_frame_depth(tensors[0][None, None], tensors[1][None, None], tensors[2][None], tensors[3][None])
    inside = cv2.erode(view.valid.astype(np.uint8), np.ones((5, 5)), borderValue=0) > 0
    assert psnr(view.light, theirs[0, 0].numpy(), inside) > 40  # (theirs is bilinear)


def test_the_nearest_surface_wins_and_holes_show_what_is_behind() -> None:
    light, depth_m = card_before_wall()
    view = Views(SOURCE, [(SOURCE, BESIDE)]).see(light, depth_m)[0]
    expected = np.full_like(light, BACK)
    expected[40:80, 45:85] = FRONT  # 15 px to the left
    np.testing.assert_array_equal(view.light, expected)  # (not a trace of one in the other)
    hole = np.zeros((120, 160), np.bool_)
    hole[40:80, 85:96] = True  # the wall moved by 3.75 px only: 11 px of it are seen by neither
    assert not view.valid[hole & (np.arange(160) > 85) & (np.arange(160) < 95)].any()
    wrong = view.valid == hole
    wrong[:, -4:] = False  # beyond the source's border
    assert wrong.sum() <= 40 and not view.valid[:, -3:].any()


@pytest.mark.parametrize("way", [(0.1, 0, 0), (-0.1, 0, 0), (0, 0.1, 0), (0, -0.1, 0), (0.07, 0.07, 0), (0, 0, 0.3)])
def test_holes_never_show_the_foreground(way: Triple) -> None:
    light, depth_m = card_before_wall()
    pose = Pose.of((0, 0, 0), way)
    for camera in (SOURCE, pinhole((80, 60), 75)):
        view = Views(SOURCE, [(camera, pose)]).see(light, depth_m)[0]
        assert (
            not np.isin(view.light, np.float32([FRONT, BACK]), invert=True)[~view.valid].any() or camera is not SOURCE
        )
        if camera is SOURCE:
            assert set(np.unique(view.light)) <= {np.float32(FRONT), np.float32(BACK)}
            assert (view.light[~view.valid] == np.float32(BACK)).all()


def test_a_blurred_edge_does_not_bleed_into_the_hole() -> None:
    light, depth_m = card_before_wall()
    light = cv2.GaussianBlur(light, (0, 0), 0.7)
    view = Views(SOURCE, [(SOURCE, BESIDE)]).see(light, depth_m)[0]
    assert np.abs(view.light[45:75, 86:95] - BACK).max() < 0.02


def test_holes_are_not_streaked() -> None:
    light, depth_m = card_before_wall()
    wall = depth_m == 4
    light[wall] = np.random.default_rng(0).random(wall.sum(), np.float32)
    hole = Views(SOURCE, [(SOURCE, BESIDE)]).see(light, depth_m)[0].light[45:75, 87:94]
    assert np.abs(np.diff(hole, axis=0)).mean() < 0.5 * np.abs(np.diff(light[:, :40], axis=0)).mean()
    assert abs(hole.mean() - 0.5) < 0.1


def test_places_within_a_quad_are_those_of_its_perspective() -> None:
    u, v = (edge.astype(np.float32) for edge in np.meshgrid([0, 8], [0, 8]))
    inverse = np.array([[1, 2], [1, 2]], np.float32)  # (its right side is at half the distance)
    ends = np.array([0, 1], np.float32)
    x, y, seen = np.zeros((9, 9), np.float32), np.zeros((9, 9), np.float32), np.full((9, 9), -1, np.float32)
    draw_quads(0, 9, u, v, inverse, inverse.copy(), ends, ends, np.zeros((1, 1), bool), np.float32(2), x, y, seen)
    share = np.arange(9) / 8
    np.testing.assert_allclose(x, np.broadcast_to(2 * share / (1 + share), (9, 9)), atol=1e-6)


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("turn", [0, 20])
def test_nothing_cracks(scale: float, turn: float) -> None:
    """A smooth surface, from near and far, by a camera with fewer and more pixels: not a pixel is missing."""
    x, y = np.moveaxis(pixel_grid(SOURCE.size), -1, 0)
    depth_m = (1.5 + 0.3 * np.sin(x / 15) * np.cos(y / 11)).astype(np.float32)
    camera = Intrinsics.of_field((int(100 * scale), int(75 * scale)), 30)
    views = Views(SOURCE, [(camera, Pose.of((0, 0, turn), (0.02, 0.01, 0.05)))])
    assert views.see(np.ones((120, 160), np.float32), depth_m)[0].valid.all()


def test_steps_of_few_digits_are_bridged() -> None:
    disparity = np.rint(np.linspace(10, 30, 160))[None].repeat(120, 0)  # whole pixels
    depth_m = (150 * 0.1 / disparity).astype(np.float32)
    view = Views(SOURCE, [(SOURCE, BESIDE)]).see(np.ones((120, 160), np.float32), depth_m)[0]
    assert view.valid[:, 2:128].all()


def test_disparity_is_focal_times_baseline_over_distance() -> None:
    for distance_m in (0.6, 1.7, 40.0):
        depth_m = np.full((120, 160), distance_m, np.float32)
        places = Views(SOURCE, [(SOURCE, BESIDE)]).looks(depth_m)[0].places
        expected = pixel_grid(SOURCE.size)[..., 0] + 15 / distance_m
        seen = expected <= 159.4
        assert np.abs(places.x - expected)[seen].max() < 0.02 and (places.seen[seen]).all()


def test_infinite_depth_is_infinitely_far_and_unknown_depth_is_marked() -> None:
    light = np.random.default_rng(0).random((120, 160), np.float32)
    view = Views(SOURCE, [(SOURCE, BESIDE)]).see(light, np.full((120, 160), np.inf, np.float32))[0]
    np.testing.assert_allclose(view.light, light, atol=2e-5)
    assert view.valid.all()
    light, depth_m = card_before_wall()
    for unknown in (0, -1, np.nan, -np.inf):
        depth_m[60:64, 20:30] = unknown
        depth_m[50, 55:60] = unknown  # beside the card: the wall counts
        view = Views(SOURCE, [(SOURCE, BESIDE)]).see(light, depth_m)[0]
        assert not view.valid[61:63, 17:25].any() and view.valid[40:60, 10:25].all()
        assert filled_inverse(depth_m)[0][50, 55:60] == pytest.approx(0.25)


@pytest.mark.parametrize("unknown", [0.0, -3.0, np.nan, -np.inf])
def test_a_depth_of_nothing_gives_a_picture_and_an_empty_mask(unknown: float) -> None:
    light, cameras = card_before_wall()[0], [(SOURCE, BESIDE), (pinhole((53, 40), 50), BESIDE)]
    for view in Views(SOURCE, cameras).see(light, np.full((120, 160), unknown, np.float32)):
        assert np.isfinite(view.light).all() and not view.valid.any()


@pytest.mark.parametrize("turn, way", [((0, 180, 0), (0.1, 0, 0)), ((0, 0, 0), (0, 0, 50)), ((0, 0, 0), (90, 0, 0))])
def test_a_camera_that_sees_nothing_has_a_picture_and_an_empty_mask(turn: Triple, way: Triple) -> None:
    (light, depth_m), pose = card_before_wall(), Pose.of(turn, way)
    for view in Views(SOURCE, [(SOURCE, pose), (FISHEYE, pose)]).see(light, depth_m):
        assert np.isfinite(view.light).all() and not view.valid.any()


numbers = st.floats(allow_nan=True, allow_infinity=True, width=32)
lenses = st.sampled_from([SOURCE, BENT, FISHEYE])


@settings(max_examples=80)
@example(  # (a pixel just beyond an edge, one corner of which is near the camera's plane)
    seed=225, values=[0.0] * 6, turn=(0.0, 1.5, 1.0), way=(0.96875, 0.0, 1.662109375), source=SOURCE, camera=SOURCE,
    size=(5, 9),
)  # fmt: skip
@example(  # (a border that is looked for along itself, all but 1e-310 of the way)
    seed=0, values=[0.0] * 6, turn=(0.0, 67.0, 1.1125369292536007e-308), way=(0.0, 0.0, 0.0), source=SOURCE,
    camera=SOURCE, size=(5, 9),
)  # fmt: skip
@given(
    seed=st.integers(0, 2**32 - 1),
    values=st.lists(numbers, min_size=6, max_size=6),
    turn=st.tuples(*[st.floats(-180, 180)] * 3),
    way=st.tuples(*[st.floats(-3, 3)] * 3),
    source=lenses,
    camera=lenses,
    size=st.sampled_from([(16, 12), (5, 9), (40, 30)]),
)
def test_random_rigs_make_light_and_an_honest_mask(seed, values, turn, way, source, camera, size) -> None:  # type: ignore[no-untyped-def]
    random = np.random.default_rng(seed)
    source, camera = source.scaled_to((24, 18)), camera.scaled_to(size)
    depth_m = np.array(values, np.float32)[random.integers(0, 6, (18, 24))]
    usual = random.random((18, 24)) < 0.7
    depth_m[usual] = random.uniform(0.1, 4, usual.sum())
    views = Views(source, [(camera, Pose.of(turn, way))])
    view = views.see(random.random((18, 24), np.float32) + 1, depth_m)[0]
    assert np.isfinite(view.light).all() and view.light.shape == view.valid.shape == size[::-1]
    assert (view.light == 0).all() or (view.light >= 0.25).all()
    x, y, seen = views.looks(depth_m)[0].places
    assert (np.abs(x[seen] - 11.5) <= 12.01).all() and (np.abs(y[seen] - 8.5) <= 9.01).all()
    if any(way):  # (otherwise depth does not matter)
        known = depth_m >= 1e-6
        rows, columns = np.clip(np.rint(y[seen]), 0, 17).astype(int), np.clip(np.rint(x[seen]), 0, 23).astype(int)
        assert known[rows, columns].all()


def test_constant_light_stays_exactly_constant_and_threads_change_nothing() -> None:
    light, depth_m = card_before_wall()
    depth_m += np.random.default_rng(0).normal(0, 0.02, depth_m.shape).astype(np.float32)
    depth_m[30:50, 20:90] = np.nan
    cameras = [(SOURCE, BESIDE), (BENT, Pose.of((1, 2, 3), (0.1, 0.1, 0.1))), (pinhole((53, 40), 50), BESIDE)]
    flat = np.full((120, 160, 3), 0.3, np.float32)
    for view in Views(SOURCE, cameras).see(flat, depth_m):
        assert (view.light == np.float32(0.3)).all()
    one, many = (Views(SOURCE, cameras, threads=threads).see(light, depth_m) for threads in (1, 3))
    for a, b in zip(one, many, strict=True):
        np.testing.assert_array_equal(a.light, b.light)
        np.testing.assert_array_equal(a.valid, b.valid)


def test_what_is_remembered_of_a_depth_is_only_that_depth() -> None:
    light, depth_m = card_before_wall()
    views, random = Views(SOURCE, [(SOURCE, BESIDE)]), np.random.default_rng(0)
    for _ in range(3):
        for picture in (light, random.random(light.shape, np.float32)):
            fresh = Views(SOURCE, [(SOURCE, BESIDE)]).see(picture, depth_m)[0]
            np.testing.assert_array_equal(views.see(picture, depth_m)[0].light, fresh.light)
        depth_m[random.integers(0, 120), random.integers(0, 160)] = random.uniform(1, 4)  # (in place, on purpose)


def test_small_cameras_see_means_over_the_area_of_their_pixels() -> None:
    light = np.random.default_rng(0).random((120, 159), np.float32)
    source, small = pinhole((159, 120), 150), pinhole((53, 40), 50)
    depth_m = np.full((120, 159), 1, np.float32)
    view = Views(source, [(small, Pose.of((0, 0, 0), (0.06, 0, 0)))]).see(light, depth_m)[0]  # 9 px, 3 small ones
    means = light.reshape(40, 3, 53, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(view.light[:, :50], means[:, 3:], atol=1e-3)
    assert view.valid[:, :50].all() and not view.valid[:, 50:].any()


def test_a_depth_of_another_size_is_refused() -> None:
    with pytest.raises(UsageError, match="depth of shape"):
        Views(SOURCE, [(SOURCE, BESIDE)]).see(card_before_wall()[0], np.ones((12, 16), np.float32))
