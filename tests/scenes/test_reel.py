"""Pictures one after the other are those that are rendered by themselves, and what is said to have stayed has."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_any_world import TEXTURES, point, surfaces, things, turn, worlds

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.scenes.moves import _shadow
from vid2ev.scenes.reel import Reel, still_of
from vid2ev.scenes.render import canvas_of, paint, render, tiles_of
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.snapshot import Lamp, Mesh, Shape, Snapshot, Surface, Thing
from vid2ev.scenes.world import World
from vid2ev.scenes.world_numbers import numbers_of
from vid2ev.seen.instants import instants
from vid2ev.seen.recipe import Recipe
from vid2ev.upsample.stillness import still_strips

CAMERA = Intrinsics.of_field((150, 70), 80)
RIG = """
[[camera]]
name = "left"
kind = "dvs"
sensor = "ideal"

[[camera]]
name = "right"
kind = "cis"
translation_mm = [12, 0, 0]
"""
BALL = """
[scene]
duration_s = 0.02
ambient = 1

[camera]
size = [320, 96]

[[objects]]
name = "wall"
kind = "plane"
size_m = 20
trajectory = { kind = "fixed", position_m = [0, 0, 5] }

[[objects]]
name = "ball"
kind = "sphere"
size_m = 0.3
colour = [0.2, 0.4, 0.1]
trajectory = { kind = "straight", position_m = [0.2, 0.1, 4], velocity_m_s = [2, 0, 0] }
"""
HOME = Pose.of((0, 0, 0), (0, 0, 0))
nudge = st.tuples(*[st.floats(-0.3, 0.3)] * 3)


def assert_same_as_alone(snapshots: list[Snapshot], poses: list[Pose]) -> list[float]:
    """Renders both ways; returns the share of strips that are said to be still, of each picture but the first."""
    reel, before, shares = Reel(World(Scene()), CAMERA), None, []
    for snapshot, pose in zip(snapshots, poses, strict=True):
        picture, still = reel.render(snapshot, pose)
        alone = render(snapshot, CAMERA, pose, threads=1)
        for ours, theirs in zip(picture, alone, strict=True):
            assert np.array_equal(ours, theirs)
        assert (still is None) == (before is None)
        if still is not None:
            assert not (still & ~still_strips(before, alone.light)).any()
            shares.append(float(still.mean()))
        before = picture.light
    return shares


def moved(snapshot: Snapshot, number: int, way, turned) -> Snapshot:
    """The same with one thing elsewhere."""
    if not snapshot.things:
        return snapshot
    all_things = list(snapshot.things)
    thing = all_things[number % len(all_things)]
    all_things[number % len(all_things)] = replace(thing, pose=Pose.of(turned, way) @ thing.pose)
    return replace(snapshot, things=all_things)


changes = st.lists(
    st.one_of(
        st.tuples(st.just("move"), st.integers(0, 3), nudge, turn),
        st.tuples(st.just("look"), st.integers(0, 3), surfaces),
        st.tuples(st.just("another"), things),
        st.tuples(st.just("camera"), nudge),
        st.tuples(st.just("lamp"), point),
        st.tuples(st.just("nothing")),
    ),
    min_size=1,
    max_size=4,
)


@settings(max_examples=120)
@given(worlds, st.builds(Pose.of, turn, point), changes)
def test_whatever_changes_the_picture_is_the_same(world, pose, happenings):
    snapshots, poses = [world], [pose]
    for what, *how in happenings:
        last, here = snapshots[-1], poses[-1]
        if what == "move":
            last = moved(last, *how)
        elif what == "look" and last.things:
            changed = list(last.things)
            changed[how[0] % len(changed)] = replace(changed[how[0] % len(changed)], surface=how[1])
            last = replace(last, things=changed)
        elif what == "another":
            last = replace(last, things=[*last.things, how[0]])
        elif what == "camera":
            here = Pose.of((0, 0, 0), how[0]) @ here
        elif what == "lamp" and last.lamps:
            last = replace(last, lamps=[replace(last.lamps[0], position_m=how[0]), *last.lamps[1:]])
        snapshots.append(last)
        poses.append(here)
    assert_same_as_alone(snapshots, poses)


LAMPS = {
    "none": [],
    "sun": [Lamp("sun", direction=(0.4, 1.0, 0.7), shadows=True)],
    "low sun": [Lamp("sun", direction=(1.0, 0.05, 0.02), shadows=True)],
    "point": [Lamp("point", position_m=(0.5, -1.5, 1.0), reach_m=2.0, shadows=True)],
    "point among things": [Lamp("point", position_m=(0.2, 0.2, 2.2), shadows=True)],
    "two": [Lamp("sun", direction=(0, 0.3, 1.0), shadows=True), Lamp("point", position_m=(-1, 0, 1), shadows=True)],
}


def still_life(lamps: list[Lamp], seed: int) -> Snapshot:
    """A room's corner with things of all kinds in it."""
    rng = np.random.default_rng(seed)
    walls = [
        Thing("back", Shape("plane", (9, 7, 0)), Surface(TEXTURES[2]), Pose.of((0, 0, 0), (0, 0, 5))),
        Thing("floor", Shape("plane", (9, 9, 0)), Surface(TEXTURES[1]), Pose.of((90, 0, 0), (0, 1.2, 3))),
    ]
    kinds = ("sphere", "box", "cylinder", "plane")
    small = [
        Thing(
            kinds[k % 4],
            Shape(kinds[k % 4], tuple(rng.uniform(0.05, 0.7, 3))),
            Surface(TEXTURES[k % 3], specular=0.3),
            Pose.of(rng.uniform(-90, 90, 3), rng.uniform((-1.5, -0.8, 1.8), (1.5, 0.9, 4))),
        )
        for k in range(7)
    ]
    return Snapshot([*walls, *small], [Lamp("ambient", (0.3, 0.3, 0.3)), *lamps])


@pytest.mark.parametrize("lamps", list(LAMPS))
@pytest.mark.parametrize("seed", range(4))
def test_shadows_of_what_moves_fall_where_they_fell(lamps, seed):
    rng = np.random.default_rng(seed + 100)
    snapshots = [still_life(LAMPS[lamps], seed)]
    for k in range(4):
        snapshots.append(moved(snapshots[-1], 2 + (seed + k) % 7, rng.uniform(-0.2, 0.2, 3), rng.uniform(-20, 20, 3)))
    assert_same_as_alone(snapshots, [HOME] * 5)


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize("seed", range(20))
def test_all_that_a_ball_may_hide_from_a_lamp_is_in_the_balls_of_its_shadow(near, seed):
    rng = np.random.default_rng(seed)
    centre, radius, lamp = rng.normal(0, 1, 3), rng.uniform(0.05, 0.5), rng.normal(0, 1, 3)
    lamp /= np.linalg.norm(lamp)
    lamp = centre + radius * 1.2 * 40 ** rng.random() * lamp if near else lamp
    way = (centre - lamp) / np.linalg.norm(centre - lamp) if near else -lamp
    things = np.column_stack([centre + rng.uniform(1, 5, (3, 1)) * way + rng.normal(0, 0.3, (3, 3)), [0.3, 1, 3]])
    rims = rng.normal(0, 1, (4000, 3))
    rims[::2] -= np.outer(rims[::2] @ way, way)  # (every other one is where light grazes the ball)
    rims /= np.linalg.norm(rims, axis=1, keepdims=True)
    towards = radius / np.linalg.norm(centre - lamp) if near else 0.0
    rims[::2] = math.sqrt(1 - towards**2) * rims[::2] - towards * way
    rims = centre + radius * rims
    behind = rims + rng.uniform(0, 8, (4000, 1)) * (rims - lamp if near else -lamp)
    gaps = np.linalg.norm(behind[:, None] - things[:, :3], axis=2) - things[:, 3]
    behind = behind[(gaps <= 0).any(axis=1)]
    balls = _shadow(np.array([*centre, radius]), lamp, near, things)
    assert len(behind) > 100
    assert (np.linalg.norm(behind[:, None] - balls[:, :3], axis=2) <= balls[:, 3]).any(axis=1).all()


def test_strips_of_a_tile_that_is_painted_are_not_said_to_be_still():
    camera = Intrinsics.of_field((512, 40), 80)
    numbers = numbers_of(still_life([], 0), HOME)
    for row, column in np.ndindex(tiles_of(camera.size)):
        wanted = np.zeros(tiles_of(camera.size), np.uint8)
        wanted[row, column] = 1
        canvas = canvas_of(camera.size)
        for plane in canvas:
            plane[...] = 99
        paint(canvas, numbers, np.zeros_like(canvas.depth, np.uint8), camera, wanted, 1)
        assert not (still_of(canvas.light, wanted) & ~still_strips(np.full_like(canvas.light, 99), canvas.light)).any()


@pytest.mark.parametrize("light", [-0.1, 1e31])
def test_light_that_sensors_mend_is_not_said_to_be_still(light):
    world = Snapshot(still_life([], 0).things, [Lamp("ambient", (light,) * 3)])
    assert assert_same_as_alone([world, world], [HOME] * 2) == [0.0]


def test_what_nearly_hides_a_lamp_has_its_shadow_anywhere():
    first = still_life([Lamp("point", position_m=(0, 0, 2), shadows=True)], 1)
    leaf = Thing("leaf", Shape("sphere", (0.2,) * 3), Surface(), Pose.of((0, 0, 0), (0, 0, 2.105)))
    first = replace(first, things=[*first.things, leaf])
    assert_same_as_alone([first, moved(first, 9, (0.3, 0, 0), (0, 0, 0))], [HOME] * 2)


def test_shadows_fall_on_meshes():
    grid = np.stack(np.meshgrid(np.linspace(-4, 4, 9), np.linspace(-3, 3, 7), [0.0]), axis=-1).reshape(-1, 3)
    corners = np.arange(54).reshape(6, 9)[:, :8].reshape(-1, 1)
    wall = Mesh(grid, np.concatenate([corners + np.array(third) for third in ((0, 1, 10), (0, 10, 9))]))
    things = [
        Thing("wall", Shape("mesh", mesh=wall), Surface(), Pose.of((0, 0, 0), (0, 0, 5))),
        Thing("ball", Shape("sphere", (0.4,) * 3), Surface(), Pose.of((0, 0, 0), (-1, -0.5, 3))),
    ]
    first = Snapshot(things, [Lamp("sun", direction=(0.9, 0.2, 1.0), shadows=True)])
    assert_same_as_alone([first, moved(first, 1, (0.1, 0, 0), (0, 0, 0))], [HOME] * 2)


def test_the_background_goes_along_with_a_camera_that_turns():
    first = replace(still_life([], 1), things=[], environment=TEXTURES[2])
    assert_same_as_alone([first, first], [HOME, Pose.of((0, 10, 0))])
    assert_same_as_alone([first, replace(first, environment_pose=Pose.of((0, 10, 0)))], [HOME] * 2)


def test_where_little_moves_most_is_kept():
    first = still_life(LAMPS["sun"], 3)
    pea = Thing("pea", Shape("sphere", (0.05,) * 3), Surface(), Pose.of((0, 0, 0), (0.5, 1.0, 2.0)))
    first = replace(first, things=[*first.things, pea])
    shares = assert_same_as_alone([first, moved(first, 9, (0.02, 0, 0), (0, 0, 0)), first, first], [HOME] * 4)
    assert min(shares) > 0.5 and shares[-1] == 1.0


def test_a_picture_stays_as_it_is_when_the_next_is_painted():
    reel, first = Reel(World(Scene()), CAMERA), still_life(LAMPS["sun"], 3)
    one, _ = reel.render(first, HOME)
    kept = [plane.copy() for plane in one]
    reel.render(moved(first, 3, (0.1, 0, 0), (0, 0, 0)), HOME)
    assert all(np.array_equal(plane, copy) for plane, copy in zip(one, kept, strict=True))


@pytest.mark.parametrize(("rig", "bayer"), [(None, None), (RIG, None), (RIG, "RGGB")])
def test_every_camera_is_told_what_stands_still(rig, bayer, tmp_path):
    (tmp_path / "rig.toml").write_text(rig or "")
    (tmp_path / "ball.toml").write_text(BALL)
    rig = {"rig": tmp_path / "rig.toml"} if rig else {}
    recipe = Recipe.of(f"scene:{tmp_path / 'ball.toml'}", "paper", (), bayer=bayer, **rig)
    before, told = None, 0
    for instant in instants(recipe):
        for k, frame in enumerate(instant.frames):
            if before is not None:
                assert frame.still is not None and frame.still.before is before[k].light
                assert not (frame.still.strips & ~still_strips(before[k].light, frame.light)).any()
                told += frame.still.strips.sum()
        before = instant.frames
    assert told > 0
