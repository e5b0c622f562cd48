"""Flow from depth and poses is where points go, and pictures moved along it are the next ones."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.flow import flow
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Lamp, Shape, Snapshot, Surface, Texture, Thing

CAMERA = Intrinsics.of_field((320, 240), 60)
LENS = Intrinsics(
    size=(320, 240), focal_px=(250, 250), centre_px=(159, 121), model="radtan", distortion=(-0.2, 0.05, 0.001, -0.002)
)


def photograph(seed: int) -> Texture:
    """Light that pixels of the pictures below can hold: what is finer would be lost in moving a picture."""
    rough = np.random.default_rng(seed).random((20, 20, 3)).astype(np.float32)
    return Texture(cv2.resize(rough, (320, 320), interpolation=cv2.INTER_CUBIC))


PHOTOGRAPHS = [photograph(seed) for seed in range(4)]


def world(t: float) -> Snapshot:
    """A wall, a spinning box, a flying ball and a turning cylinder."""
    wall = Thing("wall", Shape("plane", (12, 9, 0)), Surface(PHOTOGRAPHS[0]), Pose.of((0, 10, 0), (0, 0, 7)))
    box = Thing("box", Shape("box"), Surface(PHOTOGRAPHS[1]), Pose.of((20 + 9 * t, 30 * t, 10), (-1, 0.1 * t, 4)))
    ball = Thing("ball", Shape("sphere"), Surface(PHOTOGRAPHS[2]), Pose.of((0, 20 * t, 0), (0.5 + 0.2 * t, 0.5, 4)))
    can = Thing("can", Shape("cylinder"), Surface(PHOTOGRAPHS[3]), Pose.of((70, 0, 30 * t), (1.1, -0.8, 5 - 0.1 * t)))
    return Snapshot([wall, box, ball, can], [Lamp("ambient")])


def camera_pose(t: float) -> Pose:
    return Pose.of((t, -2 * t, t), (0.1 * t, 0, 0.05 * t))


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_moving_the_next_picture_back_gives_this_one(camera):
    first, second = (render(world(t), camera, camera_pose(t), threads=1) for t in (0, 0.5))
    shift, covisible = flow(world(0), camera_pose(0), world(0.5), camera_pose(0.5), camera, first)
    y, x = np.mgrid[:240, :320].astype(np.float32)
    moved = cv2.remap(
        second.light, x + shift[..., 0], y + shift[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    psnr_db = -10 * np.log10(np.mean((moved - first.light)[covisible] ** 2))
    assert covisible.mean() > 0.9 and np.abs(shift).max() > 5
    assert psnr_db > 35


@pytest.mark.parametrize("camera", [CAMERA, LENS], ids=["pinhole", "lens"])
def test_flow_is_the_way_of_the_points(camera):
    first = render(world(0), camera, camera_pose(0), samples=1, threads=1)
    shift, covisible = flow(world(0), camera_pose(0), world(1), camera_pose(1), camera, first)
    distortion = np.array(camera.distortion or (0.0,) * 4)
    for x, y in np.random.default_rng(5).integers((0, 0), (320, 240), (60, 2)):
        number = first.thing[y, x]
        if number < 0:
            continue
        ray = cv2.undistortPoints(
            np.array([[[float(x), float(y)]]]), camera.matrix, distortion, criteria=(3, 100, 1e-12)
        )
        point = camera_pose(0).apply(np.array([*ray.ravel(), 1.0]) * float(first.depth[y, x]))
        own = world(0).things[number].pose.inverse().apply(point)
        there = camera_pose(1).inverse().apply(world(1).things[number].pose.apply(own))
        pixel = cv2.projectPoints(there[None], np.zeros(3), np.zeros(3), camera.matrix, distortion)[0].ravel()
        np.testing.assert_allclose(shift[y, x], pixel - (x, y), atol=0.01)
    assert covisible.any()


def test_the_background_moves_with_the_turn_of_the_camera_alone():
    empty, turn = Snapshot(), Pose.of((0, 5, 0), (3, 2, 1))
    picture = render(empty, CAMERA, IDENTITY)
    shift, covisible = flow(empty, IDENTITY, empty, turn, CAMERA, picture)
    middle = shift[120, 160]  # (half a pixel right of the principal point)
    assert middle[0] == pytest.approx(-np.tan(np.radians(5)) * CAMERA.focal_px[0], abs=0.02) and abs(middle[1]) < 0.05
    assert not covisible[:, 0].any() and covisible[120, 160]


def test_what_another_thing_covers_then_is_not_covisible():
    wall = Thing("wall", Shape("plane", (9, 9, 0)), pose=Pose.of((0, 0, 0), (0, 0, 6)))

    def scene(x: float) -> Snapshot:
        return Snapshot([wall, Thing("box", Shape("box"), pose=Pose.of((0, 0, 0), (x, 0, 3)))], [Lamp("ambient")])

    first, second = (render(scene(x), CAMERA, IDENTITY, samples=1) for x in (-0.5, 0.5))
    shift, covisible = flow(scene(-0.5), IDENTITY, scene(0.5), IDENTITY, CAMERA, first)
    still = first.thing == 0
    assert (shift[still] == 0).all() or np.abs(shift[still]).max() < 1e-4
    np.testing.assert_array_equal(covisible[still], second.thing[still] == 0)


@pytest.mark.parametrize("turn_deg", [5, 60, 150])
def test_what_a_thing_turns_away_from_the_camera_is_not_covisible(turn_deg):
    def scene(turn_deg: float) -> Snapshot:
        return Snapshot([Thing("ball", Shape("sphere", (0.4,) * 3), pose=Pose.of((0, turn_deg, 0), (0, 0, 3)))])

    picture = render(scene(0), CAMERA, IDENTITY, samples=1)
    _, covisible = flow(scene(0), IDENTITY, scene(turn_deg), IDENTITY, CAMERA, picture)
    x, y = np.meshgrid(np.arange(320) - CAMERA.centre_px[0], np.arange(240) - CAMERA.centre_px[1])
    points = np.stack([x / CAMERA.focal_px[0], y / CAMERA.focal_px[1], np.ones_like(x)], -1) * picture.depth[..., None]
    ball = picture.thing == 0
    there = (points[ball] - (0, 0, 3)) @ Pose.of((0, turn_deg, 0)).rotation.T
    seen = np.array([0, 0, 3]) + there
    facing = -np.einsum("ni,ni->n", there, seen) / (0.2 * np.linalg.norm(seen, axis=1))
    sure = np.abs(facing) > 0.02  # (at the outline rounding says on which side a point is)
    assert sure.sum() > 1000
    np.testing.assert_array_equal(covisible[ball][sure], facing[sure] > 0)


def test_points_behind_the_second_camera_have_no_flow():
    wall = Snapshot([Thing("wall", Shape("plane", (9, 9, 0)), pose=Pose.of((0, 0, 0), (0, 0, 2)))])
    picture = render(wall, CAMERA, IDENTITY)
    shift, covisible = flow(wall, IDENTITY, wall, Pose.of((0, 0, 0), (0, 0, 3)), CAMERA, picture)
    assert np.isnan(shift).all() and not covisible.any()


def test_flow_between_other_things_is_refused():
    picture = render(Snapshot(), CAMERA, IDENTITY)
    with pytest.raises(UsageError, match="same things"):
        flow(Snapshot(), IDENTITY, world(0), IDENTITY, CAMERA, picture)
