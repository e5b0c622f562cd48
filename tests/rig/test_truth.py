"""Pixel maps, flow and depth against closed forms and OpenCV's projection."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from view_rigs import pinhole

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid
from vid2ev.rig.pose import IDENTITY, Pose, rotation_vector_deg
from vid2ev.rig.truth import depth_of_plane, depth_seen, pixel_map

A = pinhole()
B = pinhole((200, 100), 140).model_copy(update={"model": "radtan", "distortion": (-0.1, 0.02, 1e-3, 0.0)})
FISHEYE = pinhole((200, 100), 80).model_copy(update={"model": "equidistant", "distortion": (0.02, 0.0, 0.0, 0.0)})
DEPTH = np.random.default_rng(0).uniform(1, 5, (120, 160)).astype(np.float32)


@pytest.mark.parametrize("camera", [A, B, FISHEYE])
def test_pixel_maps_are_those_of_opencv(camera: Intrinsics) -> None:
    pose_a, pose_b = Pose.of((3, -5, 10), (0.2, 0.1, -0.3)), Pose.of((-4, 8, -20), (-0.1, 0.2, 0.1))
    grid = pixel_grid(A.size)
    points = pose_a.apply(np.dstack([(grid - A.centre_px) / A.focal_px, np.ones(grid.shape[:2])]) * DEPTH[..., None])
    back = pose_b.inverse()
    turn, values = np.radians(rotation_vector_deg(back.rotation)), np.array(camera.distortion or (0.0,) * 4)
    if camera.model == "equidistant":
        expected = cv2.fisheye.projectPoints(points.reshape(-1, 1, 3), turn, back.translation_m, camera.matrix, values)[
            0
        ]
    else:
        expected = cv2.projectPoints(points.reshape(-1, 3), turn, back.translation_m, camera.matrix, values)[0]
    np.testing.assert_allclose(pixel_map(A, pose_a, DEPTH, camera, pose_b), expected.reshape(grid.shape), atol=1e-3)


def test_the_disparity_of_a_rectified_pair() -> None:
    moved = pixel_map(A, IDENTITY, DEPTH, A, Pose.of((0, 0, 0), (0.12, 0, 0)))
    expected = pixel_grid(A.size) - np.stack([150 * 0.12 / DEPTH, 0 * DEPTH], axis=-1)
    np.testing.assert_allclose(moved, expected, atol=1e-4)


def flow_of(camera: Intrinsics, pose_0: Pose, depth_0_m: np.ndarray, pose_1: Pose) -> np.ndarray:
    return (pixel_map(camera, pose_0, depth_0_m, camera, pose_1) - pixel_grid(camera.size)).astype(np.float32)


def test_flow_of_a_camera_that_moves_and_turns() -> None:
    np.testing.assert_allclose(flow_of(B, IDENTITY, np.full((100, 200), 2.0), IDENTITY), 0, atol=1e-4)
    forwards = flow_of(A, IDENTITY, np.full((120, 160), 2.0), Pose.of((0, 0, 0), (0, 0, 1)))
    np.testing.assert_allclose(forwards, pixel_grid(A.size) - A.centre_px, atol=1e-4)  # twice as large
    there, back = Pose.of((1, 2, 3), (0.1, 0, 0)), Pose.of((0, 0, 0), (0.3, 0.1, 0.2))
    plane = depth_of_plane(A, there, 3.0)
    flow = flow_of(A, there, plane, back)
    landing = np.moveaxis((pixel_grid(A.size) + flow).astype(np.float32), -1, 0)
    returned = cv2.remap(
        flow_of(A, back, depth_of_plane(A, back, 3.0), there), *landing, cv2.INTER_LINEAR, borderValue=np.nan
    )
    inside = ~np.isnan(returned).any(-1)
    assert inside.mean() > 0.6
    np.testing.assert_allclose(returned[inside], -flow[inside], atol=0.01)


def test_the_infinitely_far_turns_and_does_not_shift() -> None:
    far = np.full((120, 160), np.inf, np.float32)
    way, turn = (5.0, -3.0, 2.0), (2, 3, 4)
    both, only_turned = (pixel_map(A, IDENTITY, far, A, Pose.of(turn, t)) for t in (way, (0, 0, 0)))
    np.testing.assert_array_equal(both, only_turned)


@pytest.mark.parametrize("depth_m", [0.0, -1.0, np.nan, -np.inf])
def test_what_is_not_known_or_not_in_front_is_nan(depth_m: float) -> None:
    assert np.isnan(pixel_map(A, IDENTITY, np.full((120, 160), depth_m), B, Pose.of((0, 0, 0), (0.1, 0, 0)))).all()
    for pose in (Pose.of((0, 180, 0)), Pose.of((0, 0, 0), (0, 0, 6))):
        assert np.isnan(pixel_map(A, IDENTITY, DEPTH, B, pose)).all()


def test_depth_that_another_camera_has() -> None:
    camera, pose = pinhole((90, 70), 80), Pose.of((2, -5, 7), (0.1, -0.05, 0.2))
    found = depth_seen(A, np.full((120, 160), 2, np.float32), camera, pose)
    known = ~np.isnan(found)
    assert 0.5 < known.mean() < 1
    np.testing.assert_allclose(found[known], depth_of_plane(camera, pose, 2.0)[known], rtol=1e-4)
    assert (depth_of_plane(A, Pose.of((0, 180, 0)), 2.0) != depth_of_plane(A, Pose.of((0, 180, 0)), 2.0)).all()  # NaN


def test_views_and_truth_agree() -> None:
    """Depth of the other camera, mapped back, leads to the place in the source from which the view has its light."""
    from vid2ev.rig.views import Views

    depth_m = (2 + 0.5 * np.sin(np.arange(160) / 20)[None] + np.zeros((120, 1))).astype(np.float32)
    camera, pose = B, Pose.of((1, -2, 3), (0.05, 0.02, 0.05))
    place = Views(A, [(camera, pose)]).looks(depth_m)[0].places
    back = pixel_map(camera, pose, depth_seen(A, depth_m, camera, pose), A, IDENTITY)
    assert place.seen.mean() > 0.5
    np.testing.assert_allclose(back[place.seen], np.stack([place.x, place.y], -1)[place.seen], atol=0.02)


def test_depth_is_unknown_where_the_nearest_pixel_of_the_source_has_none() -> None:
    camera = Intrinsics(size=(16, 12), focal_px=(15.0, 15.0), centre_px=(7.5, 5.5))
    depth_m = np.full((12, 16), 2, np.float32)
    depth_m[4, 6] = np.nan
    seen = depth_seen(camera, depth_m, camera, IDENTITY)
    assert np.argwhere(np.isnan(seen)).tolist() == [[4, 6]]
    beside = Pose.of((0, 0, 0), (0.7 * 2 / 15, 0, 0))  # by 0.7 px: its pixel 5 looks at 5.7
    seen = depth_seen(camera, depth_m, camera, beside)
    assert np.argwhere(np.isnan(seen[:, :15])).tolist() == [[4, 5]]


def test_what_is_behind_a_camera_has_no_depth() -> None:
    camera = Intrinsics(size=(16, 12), focal_px=(15.0, 15.0), centre_px=(7.5, 5.5))
    assert np.isnan(depth_of_plane(camera, IDENTITY, -2.0)).all()
    assert np.isnan(depth_of_plane(camera, Pose.of((0, 0, 0), (0, 0, 3)), 2.0)).all()
