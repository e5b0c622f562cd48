"""Whatever a world is made of, a picture has finite light and depth, and the same whoever computes it."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.scenes.flow import flow
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Lamp, Mesh, Shape, Snapshot, Surface, Texture, Thing

CAMERA = Intrinsics.of_field((20, 15), 80)
TEXTURES = [Texture(np.random.default_rng(k).random((2 + 3 * k, 1 + 5 * k, 3))) for k in range(3)]
SPOTS = np.random.default_rng(0).normal(size=(12, 3))
SPOTS[5], SPOTS[6] = SPOTS[4], SPOTS[4]
MESHES = [
    Mesh(SPOTS, np.array([[0, 1, 2], [3, 3, 3], [4, 5, 6], [7, 8, 7], [9, 10, 11]])),  # some have no area
    Mesh(SPOTS, np.arange(12).reshape(4, 3), uv=SPOTS[:, :2], normals=SPOTS * (1, 0, 0)),
    Mesh(SPOTS * 0, np.array([[0, 1, 2]])),
]

number = st.floats(-6, 6) | st.sampled_from([0.0, 1.0, -1.0])
point = st.tuples(number, number, number)
length = st.floats(0, 4) | st.sampled_from([0.0, 1e-12, 1.0, 1000.0])
turn = st.tuples(*[st.floats(-180, 180) | st.sampled_from([0.0, 90.0])] * 3)
surfaces = st.builds(
    Surface,
    texture=st.sampled_from([None, *TEXTURES]),
    repeat=st.tuples(st.floats(-20, 20), st.floats(0, 3)),
    specular=st.floats(0, 2),
    shininess=st.floats(0, 500),
    emission=st.floats(0, 9),
)
shapes = st.builds(
    Shape, st.sampled_from(["plane", "box", "sphere", "cylinder"]), st.tuples(length, length, length)
) | st.builds(lambda mesh: Shape("mesh", mesh=mesh), st.sampled_from(MESHES))
things = st.builds(Thing, st.just("it"), shapes, surfaces, st.builds(Pose.of, turn, point))
lamps = st.builds(
    Lamp,
    st.sampled_from(["ambient", "point", "sun"]),
    position_m=point,
    direction=point.filter(lambda way: np.linalg.norm(way) > 0),
    reach_m=st.floats(1e-3, 9),
    shadows=st.booleans(),
)
worlds = st.builds(
    Snapshot, st.lists(things, max_size=4), st.lists(lamps, max_size=10), st.sampled_from([None, TEXTURES[2]])
)


@settings(max_examples=150)
@given(worlds, st.builds(Pose.of, turn, point), st.sampled_from([1, 2, 3]))
def test_there_is_light_everywhere_and_no_nan(world, pose, samples):
    light, depth, thing = render(world, CAMERA, pose, samples=samples, threads=1)
    assert np.isfinite(light).all() and (light >= 0).all()
    assert (np.isfinite(depth) == (thing >= 0)).all() and (depth >= 0).all()
    assert thing.min() >= -1 and thing.max() < len(world.things)


@settings(max_examples=50)
@given(worlds, st.builds(Pose.of, turn, point), st.builds(Pose.of, turn, point))
def test_what_stays_is_seen_again(world, pose, other):
    picture = render(world, CAMERA, pose, samples=1, threads=1)
    shift, covisible = flow(world, pose, world, pose, CAMERA, picture)
    here = picture.depth > 1e-3  # (of what touches the lens, rounding moves the place)
    np.testing.assert_allclose(shift[here], 0, atol=1e-3)
    shift, covisible = flow(world, pose, world, other, CAMERA, picture)
    assert np.isfinite(shift[covisible]).all()


def test_the_picture_is_the_same_from_anywhere_else_in_space():
    # A whole world and its camera moved together show the same picture, to rounding.
    rng = np.random.default_rng(8)
    kinds = ("plane", "box", "sphere", "cylinder")
    things = [
        Thing(
            "it",
            Shape(kinds[k % 4], tuple(rng.uniform(0.5, 2, 3))),
            Surface(TEXTURES[k % 3], specular=0.3),
            Pose.of(rng.uniform(-90, 90, 3), rng.uniform((-3, -2, 4), (3, 2, 9))),
        )
        for k in range(24)
    ]
    away = Pose.of((10, 20, 90), (3, -2, 1))
    moved = [Thing(thing.name, thing.shape, thing.surface, away @ thing.pose) for thing in things]
    sun, moved_sun = (
        Lamp("sun", direction=tuple(turn @ (1, 2, 3)), shadows=True) for turn in (np.eye(3), away.rotation)
    )
    ambient, pose = Lamp("ambient", (0.3,) * 3), Pose.of((3, 2, 1))
    here = render(Snapshot(things, [ambient, sun]), CAMERA, pose)
    there = render(Snapshot(moved, [ambient, moved_sun]), CAMERA, away @ pose)
    assert np.array_equal(here.thing, there.thing) and len(np.unique(here.thing)) > 10
    np.testing.assert_allclose(here.depth, there.depth, rtol=1e-5)
    np.testing.assert_allclose(here.light, there.light, atol=1e-4)
