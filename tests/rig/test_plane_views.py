"""Views of planes and turned views: against the analytic picture, OpenCV and kornia."""

from __future__ import annotations

import math
import tracemalloc
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from kornia.geometry.transform import warp_perspective
from view_rigs import Texture, homography, pinhole, psnr

from vid2ev.errors import UsageError
from vid2ev.rig import homography as homography_module
from vid2ev.rig import views as views_module
from vid2ev.rig.camera import Camera, Rig
from vid2ev.rig.homography import places_on_plane
from vid2ev.rig.intrinsics import SHORTEST_PX, Intrinsics
from vid2ev.rig.lens import pixel_grid, pixels_of, rays_of
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.rig.views import Views

SOURCE = pinhole()
BENT = {
    "none": {},
    "radtan": {"model": "radtan", "distortion": (-0.2, 0.05, 0.002, -0.001)},
    "equidistant": {"model": "equidistant", "distortion": (0.03, -0.01, 0.0, 0.0)},
}
POSES = {
    "beside": Pose.of((0, 0, 0), (0.05, 0.02, 0)),
    "turned": Pose.of((4, -6, 11)),
    "both": Pose.of((2, -5, 7), (0.1, -0.05, 0.2)),
}


def noise(size: tuple[int, int] = (160, 120), seed: int = 0, colours: tuple[int, ...] = ()) -> np.ndarray:
    return np.random.default_rng(seed).random((size[1], size[0], *colours), np.float32)


def light_of_plane(camera: Intrinsics, pose: Pose, plane_m: float, texture: Texture) -> np.ndarray:
    """What a camera sees of a texture on a plane, ray by ray; places in units of a source pixel there."""
    rays = rays_of(pixel_grid(camera.size), camera) @ pose.rotation.T
    hits = pose.translation_m[:2] + rays[..., :2] * ((plane_m - pose.translation_m[2]) / rays[..., 2:])
    return texture(*np.moveaxis(hits * SOURCE.focal_px[0] / plane_m, -1, 0))


@pytest.mark.parametrize("colours", [(), (3,)])
def test_the_same_camera_sees_the_very_picture(colours: tuple[int, ...]) -> None:
    for camera in (SOURCE, SOURCE.model_copy(update=BENT["radtan"])):
        views, light = Views(camera, [(camera, IDENTITY)] * 2, 3.0), noise(colours=colours)
        for view in views.see(light) + views.see(light, np.full((120, 160), np.nan, np.float32)):
            assert view.light is light and view.valid.all()


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("source_lens", BENT)
@pytest.mark.parametrize("lens", BENT)
def test_a_textured_plane_is_seen_as_its_analytic_picture(pose: str, source_lens: str, lens: str) -> None:
    source, camera = SOURCE.model_copy(update=BENT[source_lens]), pinhole((150, 110), 160).model_copy(update=BENT[lens])
    texture, plane_m = Texture(0.22 if source_lens != "none" else 0.25), 2.0
    light = light_of_plane(source, IDENTITY, plane_m, texture).astype(np.float32)
    light = np.stack([light, 1 - light, 0.5 * light], axis=-1)
    view = Views(source, [(camera, POSES[pose])], plane_m).see(light)[0]
    truth = light_of_plane(camera, POSES[pose], plane_m, texture)
    assert view.valid.mean() > 0.6
    inside = cv2.erode(view.valid.astype(np.uint8), np.ones((17, 17)), borderValue=0) > 0  # (a spline feels the border)
    assert psnr(view.light[..., 0], truth, inside) >= 45
    assert psnr(view.light[..., 1], 1 - truth, inside) >= 45


@pytest.mark.parametrize("pose", POSES)
def test_the_homography_is_that_of_opencv_and_kornia(pose: str) -> None:
    smooth = cv2.GaussianBlur(noise(seed=4), (0, 0), 3).astype(np.float32)
    matrix = homography(SOURCE, SOURCE, POSES[pose], 2.0)
    view = Views(SOURCE, [(SOURCE, POSES[pose])], 2.0).see(smooth)[0]
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    by_opencv = cv2.warpPerspective(smooth, matrix, SOURCE.size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    inside = cv2.erode(view.valid.astype(np.uint8), np.ones((9, 9)), borderValue=0) > 0
    assert inside.mean() > 0.4
    np.testing.assert_allclose(view.light[inside], by_opencv[inside], atol=3e-3)  # (OpenCV's places have 1/32 px)
    batch, inverse = torch.from_numpy(smooth)[None, None], torch.from_numpy(np.linalg.inv(matrix)).float()[None]
    by_kornia = warp_perspective(batch, inverse, (120, 160), mode="bicubic", align_corners=True)[0, 0].numpy()
    np.testing.assert_allclose(view.light[inside], by_kornia[inside], atol=3e-3)


def test_lenses_are_taken_away_and_put_on() -> None:
    """A view with another lens is where cv2.undistortPoints and projectPoints lead."""
    bent = SOURCE.model_copy(update=BENT["radtan"])
    values, grid = np.array(bent.distortion), pixel_grid(SOURCE.size)
    away = places_on_plane(bent, SOURCE, IDENTITY)
    rays = rays_of(grid, SOURCE).reshape(-1, 3)
    expected = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), bent.matrix, values)[0].reshape(120, 160, 2)
    np.testing.assert_allclose(np.stack([away.x, away.y], -1), expected, atol=2e-5)
    on = places_on_plane(SOURCE, bent, IDENTITY)
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    straight = cv2.undistortPoints(grid.reshape(-1, 1, 2), bent.matrix, values, None, None, SOURCE.matrix, criteria)
    np.testing.assert_allclose(np.stack([on.x, on.y], -1), straight.reshape(120, 160, 2), atol=1e-4)


def test_a_turn_needs_no_depth_and_a_distant_plane_is_as_good_as_infinity() -> None:
    light = noise()
    turned = Views(SOURCE, [(SOURCE, POSES["turned"])])
    assert not turned.needs_depth()
    reference = turned.see(light)[0]
    for view in turned.see(light, np.full((120, 160), 0.5, np.float32)):
        np.testing.assert_array_equal(view.light, reference.light)
    beside = Views(SOURCE, [(SOURCE, POSES["both"])], math.inf).see(light)[0]
    only_turned = Views(SOURCE, [(SOURCE, Pose(POSES["both"].rotation, np.zeros(3)))]).see(light)[0]
    np.testing.assert_array_equal(beside.light, only_turned.light)
    np.testing.assert_array_equal(beside.valid, only_turned.valid)


def test_a_third_of_the_pixels_each_way_sees_means() -> None:
    light, small = noise((159, 120)), pinhole((53, 40), 50)
    source = pinhole((159, 120), 150)
    view = Views(source, [(small, IDENTITY)]).see(light)[0]
    np.testing.assert_allclose(view.light, light.reshape(40, 3, 53, 3).mean(axis=(1, 3)), atol=2e-6)
    assert view.valid.all()
    moved = Views(source, [(small, Pose.of((0, 0, 0), (3 * 1.0 / 50, 0, 0)))], 1.0).see(light)[0]
    np.testing.assert_allclose(moved.light[:, :-3], view.light[:, 3:], atol=2e-6)
    assert moved.valid[:, :-3].all() and not moved.valid[:, -3:].any()


@pytest.mark.parametrize("factor", [2, 2.5, 4, 7, 9])
def test_fine_stripes_do_not_alias_into_coarse_ones(factor: float) -> None:
    stripes = (0.5 + 0.5 * np.cos(np.pi * np.arange(240) * 0.95)).astype(np.float32)[None].repeat(160, 0)
    source = pinhole((240, 160), 200)
    small = pinhole((int(240 / factor) - 2, int(160 / factor) - 2), 200 / factor)
    seen = Views(source, [(small, IDENTITY)]).see(stripes)[0].light
    assert np.abs(seen - 0.5).max() < 0.13, np.abs(seen - 0.5).max()


@pytest.mark.parametrize("lens", BENT)
def test_a_wide_view_of_a_tele_video_is_made_a_part_at_a_time(lens: str, monkeypatch: pytest.MonkeyPatch) -> None:
    source, wide = Intrinsics.of_field((320, 240), 5), Intrinsics.of_field((64, 48), 40, **BENT[lens])
    light, places = noise((320, 240)), 16 * 64 * 16 * 48
    made, most = [], []
    for at_once in (places, 5000, 1):
        for module in (homography_module, views_module):
            monkeypatch.setattr(module, "AT_ONCE", at_once)
        tracemalloc.start()
        views = Views(source, [(wide, Pose.of((1, 2, 3)))])
        made.append((views.see(light)[0], views.looks()[0].places))
        most.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    for view, there in made[1:]:
        np.testing.assert_array_equal(view.light, made[0][0].light)
        np.testing.assert_array_equal(view.valid, made[0][0].valid)
        assert there.x.size == places and np.abs(there.x - made[0][1].x).max() < 1e-4
    assert 0 < made[0][0].valid.mean() < 0.1
    assert max(most[1:]) < 16 * places < most[0] / 4  # (of which 9 bytes a place are kept)


def test_more_pixels_than_the_source_has() -> None:
    texture, source, large = Texture(0.25), pinhole((100, 80), 100), pinhole((300, 240), 300)
    x, y = np.moveaxis(pixel_grid(source.size), -1, 0)
    view = Views(source, [(large, IDENTITY)]).see(texture(x, y).astype(np.float32))[0]
    x, y = np.moveaxis((pixel_grid(large.size) + 0.5) / 3 - 0.5, -1, 0)
    inside = np.zeros((240, 300), np.bool_)
    inside[30:-30, 30:-30] = True
    assert psnr(view.light, texture(x, y), inside) >= 45 and view.valid.all()


def test_disparity_is_focal_times_baseline_over_distance() -> None:
    places = places_on_plane(SOURCE, SOURCE, Pose.of((0, 0, 0), (0.08, 0, 0)), 1.7)
    expected = pixel_grid(SOURCE.size) + np.array([150 * 0.08 / 1.7, 0])
    np.testing.assert_allclose(np.stack([places.x, places.y], -1), expected, atol=1e-4)


def test_constant_light_stays_exactly_constant() -> None:
    light = np.full((120, 160, 3), 0.3, np.float32)
    cameras = [(SOURCE, pose) for pose in POSES.values()] + [(pinhole((53, 40), 50), POSES["both"])]
    for view in Views(SOURCE, cameras, 2.0).see(light):
        assert (view.light == np.float32(0.3)).all()


@pytest.mark.parametrize(
    "pose, plane_m",
    [
        (Pose.of((0, 180, 0)), math.inf),  # looks away
        (Pose.of((0, 90, 0)), math.inf),
        (Pose.of((0, 0, 0), (0, 0, 2)), 2.0),  # on the plane: the homography is singular
        (Pose.of((0, 0, 0), (0, 0, 3)), 2.0),  # behind it
        (Pose.of((0, 180, 0), (0, 0, 3)), 2.0),  # behind it, and looks back
        (Pose.of((90, 0, 0), (0.1, 0, 0)), 2.0),
    ],
)
def test_what_cannot_be_seen_is_not_in_the_mask(pose: Pose, plane_m: float) -> None:
    cameras = [(SOURCE, pose), (pinhole((20, 20), 18), pose), (SOURCE.model_copy(update=BENT["equidistant"]), pose)]
    for view in Views(SOURCE, cameras, plane_m).see(noise(colours=(3,))):
        assert np.isfinite(view.light).all() and not view.valid.any()


def test_beyond_the_border_is_the_nearest_that_is_seen() -> None:
    light = noise()
    view = Views(SOURCE, [(SOURCE, Pose.of((0, 0, 0), (0.4, 0, 0)))], 1.0).see(light)[0]  # 60 px
    np.testing.assert_allclose(view.light[:, 100:], light[:, -1:].repeat(60, 1), atol=1e-6)
    assert view.valid[:, :100].all() and not view.valid[:, 101:].any()


@pytest.mark.parametrize(
    ("turn_deg", "row", "column"),
    [((0, 120, 0), 15, 40), ((0, -120, 0), 15, 0), ((120, 0, 0), 0, 20), ((-120, 0, 0), 30, 20)],
)
def test_a_camera_that_looks_back_sees_the_border_on_its_side(turn_deg, row: int, column: int) -> None:  # type: ignore[no-untyped-def]
    """To the right of the source it is the light of the right border, and so on; in the middle that of the middle."""
    camera, light = pinhole((41, 31)), noise((41, 31))
    view = Views(camera, [(camera, Pose.of(turn_deg))]).see(light)[0]
    assert view.light[15, 20] == pytest.approx(light[row, column], abs=1e-5) and not view.valid.any()


def test_the_mask_is_where_the_rays_meet_the_picture() -> None:
    camera, pose = pinhole((90, 70), 60), POSES["both"]
    view = Views(SOURCE, [(camera, pose)], 2.0).see(noise())[0]
    rays = rays_of(pixel_grid(camera.size), camera) @ pose.rotation.T
    px = pixels_of(pose.translation_m + rays * ((2.0 - pose.translation_m[2]) / rays[..., 2:]), SOURCE)
    clearly_in = ((px > 2) & (px < np.array(SOURCE.size) - 3)).all(-1)
    clearly_out = ((px < -3) | (px > np.array(SOURCE.size) + 2)).any(-1)
    assert view.valid[clearly_in].all() and not view.valid[clearly_out].any()


def test_many_cameras_see_what_each_would_alone() -> None:
    cameras = [(SOURCE, POSES["both"]), (SOURCE, IDENTITY), (pinhole((53, 40), 50), POSES["turned"])]
    for light in (noise(), noise(colours=(3,)), noise(seed=1)):
        for together, camera in zip(Views(SOURCE, cameras, 2.0).see(light), cameras, strict=True):
            alone = Views(SOURCE, [camera], 2.0).see(light)[0]
            np.testing.assert_array_equal(together.light, alone.light)
            np.testing.assert_array_equal(together.valid, alone.valid)


def test_threads_change_nothing() -> None:
    light, cameras = noise(colours=(3,)), [(SOURCE, POSES["both"]), (pinhole((53, 40), 50), POSES["turned"])]
    one, many = (Views(SOURCE, cameras, 2.0, threads=threads).see(light) for threads in (1, 3))
    for a, b in zip(one, many, strict=True):
        np.testing.assert_array_equal(a.light, b.light)


def test_what_cannot_be_meant_is_refused() -> None:
    with pytest.raises(UsageError, match="no depth"):
        Views(SOURCE, [(SOURCE, POSES["beside"])]).see(noise())
    with pytest.raises(UsageError, match="light of shape"):
        Views(SOURCE, [(SOURCE, POSES["turned"])]).see(noise((50, 40)))
    for plane_m in (0.0, -1.0, math.nan):
        with pytest.raises(UsageError, match="greater than 0"):
            Views(SOURCE, [(SOURCE, POSES["beside"])], plane_m)
    with pytest.raises(UsageError, match="threads 0"):
        Views(SOURCE, [], threads=0)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bent", [{}, {"distortion_model": "radtan", "distortion": (0, 0, 1e12, -1e12)}], ids=str)
@pytest.mark.parametrize("centre_px", [(3.5, 2.5), (1e12, -1e12)])
@pytest.mark.parametrize("far_mm", [0, 1e12])
@pytest.mark.parametrize("focal_px", [(SHORTEST_PX, 1e12), (1e12, SHORTEST_PX), (SHORTEST_PX, SHORTEST_PX)])
def test_cameras_at_the_ends_of_what_rig_files_may_say_see_light(
    focal_px: tuple[float, float], far_mm: float, centre_px: tuple[float, float], bent: dict[str, Any]
) -> None:
    lens = {"size": (8, 6), "focal_px": focal_px, "centre_px": centre_px, "translation_mm": (far_mm,) * 3, **bent}
    rig = Rig(cameras=(Camera(name="a", kind="dvs", **lens),)).resolved((8, 6))
    for plane_m in (1e-6, 1e12, math.inf):
        views = Views(rig.source, [(view.intrinsics, view.pose) for view in rig.viewpoints], plane_m)
        np.testing.assert_array_equal(views.see(np.ones((6, 8), np.float32))[0].light, 1)
