"""Cycles and the embedded renderer, which have no line in common, agree: geometry to 0.1 px, depth, flow, light."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.blender.program import Blender, find_blender
from vid2ev.scenes.blender.renderer import Cycles
from vid2ev.scenes.flow import flow
from vid2ev.scenes.render import Picture, render
from vid2ev.scenes.snapshot import Kind, Lamp, Mesh, Shape, Snapshot, Surface, Texture, Thing
from vid2ev.scenes.world import World

ODD = Intrinsics(size=(160, 120), focal_px=(150.0, 127.0), centre_px=(71.3, 66.8))  # nothing in it is even
CAMERA = Pose.of((10, -25, 15), (0.3, -0.2, 0.1))
HELD_PX = 0.1
ROUND: tuple[Kind, ...] = ("sphere", "cylinder", "box")


@pytest.fixture(scope="module")
def cycles() -> Iterator[Cycles]:
    try:
        Blender(find_blender()).close()
    except UsageError as error:
        pytest.skip(str(error))
    with Cycles(256, threads=1) as running:
        yield running


def before_camera(kind: Kind, mesh: Mesh | None = None, surface: Surface | None = None) -> Thing:
    """A thing in the middle of the picture, turned."""
    shape = Shape(kind, (1.1, 0.8, 0.6), mesh)
    return Thing(kind, shape, surface or Surface(), CAMERA @ Pose.of((40, 25, -10), (0.1, 0, 1.8)))


def tetrahedron() -> Mesh:
    corners = np.array([[0.5, 0, -0.3], [-0.4, 0.4, -0.3], [-0.4, -0.4, -0.3], [0, 0, 0.5]])
    return Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))


def edges(light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where something white and convex begins and ends in each row [px], from its area and its centroid."""
    area = light.sum(axis=1)
    area[area < 3] = np.nan
    middle = (light * np.arange(light.shape[1])).sum(axis=1) / area
    return middle - area / 2, middle + area / 2


@pytest.mark.parametrize("kind", ["plane", "box", "sphere", "cylinder", "mesh"])
def test_silhouettes(cycles: Cycles, kind: Kind) -> None:
    thing = before_camera(kind, tetrahedron() if kind == "mesh" else None, Surface(emission=1.0))
    snapshot = Snapshot([thing])
    ours = render(snapshot, ODD, CAMERA, samples=4, threads=1)
    theirs = cycles(snapshot, ODD, CAMERA)
    for turn in (False, True):  # borders across, and borders up and down
        pair = [(p.light[..., 0].T if turn else p.light[..., 0]).astype(np.float64) for p in (ours, theirs)]
        for mine, other in zip(edges(pair[0]), edges(pair[1]), strict=True):
            apart = np.abs(mine - other)
            assert np.isfinite(apart).sum() > 30
            assert np.nanmax(apart) < HELD_PX
            assert abs(np.nanmean(mine - other)) < HELD_PX / 10  # (what is left is the noise of 256 places in a pixel)
    changes = np.diff(ours.thing, axis=1).astype(bool).sum() + np.diff(ours.thing, axis=0).astype(bool).sum()
    assert (ours.thing != theirs.thing).sum() <= 0.02 * changes


def shifts_of(ours: np.ndarray, theirs: np.ndarray, side: int = 24) -> np.ndarray:
    """How far apart two pictures are [n, 2 px], block by block where there is something to see in all directions."""
    found = []
    smooth = [cv2.GaussianBlur(p.astype(np.float64), (0, 0), 1.5) for p in (ours, theirs)]
    down, across = np.gradient(smooth[0])
    for y in range(0, ours.shape[0] - side + 1, side):
        for x in range(0, ours.shape[1] - side + 1, side):
            block = np.s_[y : y + side, x : x + side]
            a, b = (p[block].ravel() for p in smooth)
            # theirs(x) = gain ours(x - shift) + level
            columns = np.stack([across[block].ravel(), down[block].ravel(), a, np.ones_like(a)], axis=1)
            if np.linalg.svd(columns[:, :2], compute_uv=False)[-1] > 0.2:
                answer = np.linalg.lstsq(columns, b, rcond=None)[0]
                found.append(-answer[:2] / answer[2])
    return np.array(found)


@pytest.mark.parametrize("kind", ["plane", "box", "sphere", "cylinder"])
def test_pictures_lie_at_the_same_place(cycles: Cycles, kind: Kind) -> None:
    clouds = cv2.GaussianBlur(np.random.default_rng(1).random((64, 64, 3)).astype(np.float32), (0, 0), 2)
    clouds = (clouds - clouds.min()) / np.ptp(clouds)
    surface = Surface(Texture(clouds), colour=(0.9, 1.0, 1.4), repeat=(2.0, 1.0))
    thing = Thing(kind, Shape(kind, (2.6, 2.3, 2.0)), surface, CAMERA @ Pose.of((40, 25, -10), (0.1, 0, 2.2)))
    snapshot = Snapshot([thing], [Lamp("ambient")])
    ours, theirs = render(snapshot, ODD, CAMERA, threads=1), cycles(snapshot, ODD, CAMERA)
    inside = cv2.erode((ours.thing == 0).astype(np.uint8), np.ones((5, 5))).astype(bool)
    pair = [np.where(inside, p.light[..., 1], 0.5) for p in (ours, theirs)]
    shifts = shifts_of(*pair)
    assert len(shifts) >= 5
    assert np.abs(shifts).max() < HELD_PX
    levels = [p.light[inside].mean(axis=0) for p in (ours, theirs)]
    assert np.allclose(levels[0], levels[1], rtol=0.01)


@pytest.mark.parametrize(
    ("lamps", "seen"),
    [
        ([Lamp("ambient", (1.0, 0.5, 0.2))], 1.0),
        ([Lamp("sun", (1.0, 0.5, 0.2), direction=(0, 2, 2))], 0.5**0.5),
        ([Lamp("point", (1.0, 0.5, 0.2), position_m=(0, 0, 0), reach_m=4.0)], 4.0),
        ([Lamp("point", (0.5, 0.25, 0.1), position_m=(0, 0, 0), reach_m=2.0)] * 3, 1.5),
    ],
)
def test_units_of_light(cycles: Cycles, lamps: list[Lamp], seen: float) -> None:
    wall = Thing("wall", Shape("plane", (9, 9, 0)), pose=Pose.of((0, 0, 0), (0, 0, 2)))
    light = cycles(Snapshot([wall], lamps), Intrinsics.of_field((63, 63), 20), IDENTITY).light
    assert np.allclose(light[31, 31], seen * np.array([1.0, 0.5, 0.2]), rtol=2e-3)


def test_the_background_is_where_it_should_be(cycles: Cycles) -> None:
    around = np.random.default_rng(2).random((16, 32, 3)).astype(np.float32)
    around = cv2.GaussianBlur(cv2.resize(around, (256, 128), interpolation=cv2.INTER_CUBIC), (0, 0), 2)
    snapshot = Snapshot(environment=Texture(around), environment_gain=2.0, environment_pose=Pose.of((20, 40, 10)))
    camera = CAMERA @ Pose.of((0, 70, 0))
    ours, theirs = render(snapshot, ODD, camera, threads=1), cycles(snapshot, ODD, camera)
    assert np.isinf(theirs.depth).all() and (theirs.thing == -1).all()
    shifts = shifts_of(ours.light[..., 1], theirs.light[..., 1])
    assert len(shifts) >= 8
    assert np.abs(shifts).max() < HELD_PX
    assert np.allclose(ours.light.mean(axis=(0, 1)), theirs.light.mean(axis=(0, 1)), rtol=5e-3)


def test_shadows_fall_where_they_should(cycles: Cycles) -> None:
    wall = Thing("wall", Shape("plane", (9, 9, 0)), pose=Pose.of((0, 0, 0), (0, 0, 3)))
    ball = Thing("ball", Shape("sphere", (0.5, 0.5, 0.5)), pose=Pose.of((0, 0, 0), (0.6, 0, 2)))
    lamp = Lamp("point", position_m=(1.5, 0, 0.5), reach_m=2.0, shadows=True)
    intrinsics = Intrinsics.of_field((96, 72), 60)
    for seen, shadows in ((0.0, True), (None, False)):
        snapshot = Snapshot([wall, ball], [Lamp("point", (1, 1, 1), lamp.position_m, reach_m=2.0, shadows=shadows)])
        ours, theirs = (
            render(snapshot, intrinsics, IDENTITY, samples=4, threads=1),
            cycles(snapshot, intrinsics, IDENTITY),
        )
        on_wall = cv2.erode((ours.thing == 0).astype(np.uint8), np.ones((3, 3))).astype(bool)
        assert np.abs(ours.light - theirs.light)[on_wall].mean() < 0.002
        assert (theirs.light[on_wall].min() < 1e-3) == (seen is not None)


@pytest.mark.parametrize("name", ["room", "spinning-shapes"])
def test_scenes_have_the_same_depth_things_and_flow(cycles: Cycles, name: str) -> None:
    world = World.of(name, 3, ["camera.size=[160, 120]"])
    t0, t1 = 700_000_000, 703_000_000
    before, after = (world.snapshot(t) for t in (t0, t1))
    poses = [world.camera_pose(t) for t in (t0, t1)]
    ours, theirs = world.render(t0), cycles(before, world.intrinsics, poses[0])
    same = ours.thing == theirs.thing
    assert same.mean() > 0.9995
    assert np.quantile(np.abs(theirs.depth / ours.depth - 1)[same & (ours.thing >= 0)], 0.99) < 1e-4
    shifts = [flow(before, poses[0], after, poses[1], world.intrinsics, p).shift for p in (ours, theirs)]
    assert np.nanmax(np.linalg.norm(shifts[0] - shifts[1], axis=-1)[same]) < HELD_PX


def test_things_that_share_a_surface_are_seen_in_the_same_order(cycles: Cycles) -> None:
    things = [
        Thing(f"sheet {k}", Shape("plane", (1.0 + k, 2.0, 0)), pose=CAMERA @ Pose.of((0, 20, 0), (0.2 * k, 0, 2)))
        for k in range(3)
    ]
    ours, theirs = render(Snapshot(things), ODD, CAMERA, threads=1), cycles(Snapshot(things), ODD, CAMERA)
    assert set(np.unique(theirs.thing)) == set(np.unique(ours.thing))
    assert (ours.thing != theirs.thing).mean() < 1e-3


def test_what_has_no_extent_is_seen_by_neither(cycles: Cycles) -> None:
    line = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]]), np.array([[0, 1, 1], [2, 2, 2]]))
    things = [before_camera("mesh", line), before_camera("plane")]
    things += [Thing(kind, Shape(kind, (0, 0, 0)), pose=CAMERA @ Pose.of((0, 0, 0), (0, 0, 1))) for kind in ROUND]
    ours, theirs = render(Snapshot(things), ODD, CAMERA, threads=1), cycles(Snapshot(things), ODD, CAMERA)
    assert set(np.unique(theirs.thing)) == {-1, 1}
    assert (ours.thing != theirs.thing).mean() < 1e-3
    assert np.isinf(cycles(Snapshot(), ODD, CAMERA).depth).all()


def test_the_same_request_gives_the_same_picture(cycles: Cycles) -> None:
    thing = before_camera("sphere", surface=Surface(specular=0.5))
    snapshot = Snapshot([thing], [Lamp("sun", direction=(0, 1, 1))])
    first: Picture = cycles(snapshot, ODD, CAMERA)
    other = cycles(Snapshot([before_camera("box")]), ODD, CAMERA)
    again = cycles(snapshot, ODD, CAMERA)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first.depth, other.depth)
