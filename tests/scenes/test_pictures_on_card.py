"""Pictures that are painted on a GPU, here a simulated one, are those of the CPU to the bit, by the same text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_any_world import TEXTURES, point, turn, worlds

from vid2ev.kernels.cuda.memory import Simulated
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes import on_card
from vid2ev.scenes.flow import flow
from vid2ev.scenes.reel_on_card import ReelOnCard
from vid2ev.scenes.render import render
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.scene_file import scene_names
from vid2ev.scenes.snapshot import Lamp, Mesh, Shape, Snapshot, Surface, Texture, Thing
from vid2ev.scenes.source import open_scene
from vid2ev.scenes.world import World

pytestmark = pytest.mark.long

CAMERA = Intrinsics.of_field((14, 14), 80)  # (with its margin one tile: of each thread the simulator makes one)
LENS = Intrinsics(
    size=(14, 14), focal_px=(9, 9), centre_px=(6.5, 7), model="radtan", distortion=(-0.3, 0.05, 0.001, -0.002)
)
FISH_EYE = Intrinsics(
    size=(14, 14), focal_px=(4, 4), centre_px=(6.5, 6.5), model="equidistant", distortion=(0.02, 0, 0, 0)
)


class Counting(Simulated):
    """A simulated card that counts what is put on it [bytes], and how often each kernel runs."""

    def __init__(self) -> None:
        self.put_bytes, self.launches = 0, Counter[int]()

    @property
    def paintings(self) -> int:
        """How often the kernel ran with which a painting begins."""
        return next(iter(self.launches.values()))

    def put(self, array):
        self.put_bytes += np.asarray(array).nbytes
        return super().put(array)

    def launch(self, kernel, threads, *arguments):
        self.launches[id(kernel)] += 1
        super().launch(kernel, threads, *arguments)


def reel_of(camera: Intrinsics, samples: int = 2, memory: Simulated | None = None) -> ReelOnCard:
    world = World(Scene.model_validate({"scene": {"samples": samples}}))
    return ReelOnCard(world, memory or Simulated(), camera)


def assert_same(ours: Sequence[np.ndarray], theirs: Sequence[np.ndarray]) -> None:
    for one, other in zip(ours, theirs, strict=True):
        assert np.asarray(one).dtype == other.dtype
        assert np.array_equal(np.asarray(one), other, equal_nan=other.dtype.kind == "f")


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_is_the_same(name):
    world = World.of(name, settings=["camera.size=[30, 14]"])
    t0_ns, t1_ns = world.duration_ns // 3, world.duration_ns // 2
    reel = ReelOnCard(world, Simulated())
    first, second = reel.pictures([t0_ns, t1_ns])
    theirs = world.render(t0_ns)
    assert_same(first, theirs)
    assert_same(second, world.render(t1_ns))
    assert_same(reel.flow(t0_ns, t1_ns, first), world.flow(t0_ns, t1_ns, theirs))


poses = st.builds(Pose.of, turn, point)


@settings(max_examples=10)
@given(worlds, poses, poses, st.sampled_from([1, 2, 3]), st.sampled_from([CAMERA, LENS, FISH_EYE]))
def test_any_world_is_the_same(world, pose, other, samples, camera):
    reel = reel_of(camera, samples)
    ours, theirs = next(reel.render(iter([(world, pose)]))), render(world, camera, pose, samples=samples, threads=1)
    assert_same(ours, theirs)
    there = flow(world, pose, world, other, camera, theirs)
    assert_same(reel.flow_between((world, pose), (world, other), ours), there)


def everything() -> Snapshot:
    """All kinds of shapes, lamps and pictures, near enough to hide each other and to be mixed in many pixels."""
    spots = np.random.default_rng(3).normal(size=(30, 3))
    normals = spots / np.linalg.norm(spots, axis=1, keepdims=True)
    rng, corners = np.random.default_rng(0), np.arange(30).reshape(10, 3)
    meshes = [
        Mesh(spots, corners),
        Mesh(spots, corners, spots[:, :2], normals, rng.random((30, 3)), TEXTURES[1]),
    ]
    shapes = [Shape(kind, (1.2, 0.8, 1)) for kind in ("plane", "box", "sphere", "cylinder")]
    shapes += [Shape("mesh", mesh=mesh) for mesh in meshes] + [
        Shape("plane", (3, 0.02, 0)),
        Shape("sphere", (0.05,) * 3),
    ]
    things = [
        Thing(
            "it", shape, Surface(TEXTURES[k % 3] if k % 2 else None, repeat=(2, 3), specular=0.5, emission=0.1),
            Pose.of(rng.uniform(-90, 90, 3), rng.uniform((-1.5, -1.5, 3), (1.5, 1.5, 5))),
        )
        for k, shape in enumerate(shapes)
    ]  # fmt: skip
    lamps = [
        Lamp("ambient", (0.2, 0.3, 0.1)),
        Lamp("sun", direction=(1, 2, 3), shadows=True),
        Lamp("point", position_m=(1, -2, 1), reach_m=2, shadows=True),
        Lamp("point", position_m=(-1, 0, 0)),
    ]
    return Snapshot(things, lamps, TEXTURES[2], 0.5)


@pytest.mark.parametrize("camera", [CAMERA, LENS, FISH_EYE], ids=["pinhole", "radtan", "equidistant"])
def test_everything_at_once_is_the_same_and_so_is_where_it_goes(camera):
    before, after, pose = everything(), everything(), Pose.of((1, -3, 8), (0.1, 0, -0.2))
    for thing in after.things[::2]:
        thing.pose.translation_m[:] += 0.3, 0.1, -0.2
    reel = reel_of(camera, 3)
    ours, theirs = next(reel.render(iter([(before, IDENTITY)]))), render(before, camera, IDENTITY, samples=3)
    assert_same(ours, theirs)
    assert len(np.unique(theirs.thing)) > 4
    there = flow(before, IDENTITY, after, pose, camera, theirs)
    assert 0 < there.covisible.mean() < 1
    assert_same(reel.flow_between((before, IDENTITY), (after, pose), ours), there)


def test_pictures_painted_together_are_those_painted_alone():
    snapshot, memory = everything(), Counting()
    poses = [Pose.of((0, 4 * k, 0), (0.2 * k, 0, 0)) for k in range(3)]
    ours = list(reel_of(CAMERA, memory=memory).render((snapshot, pose) for pose in poses))
    assert memory.paintings == 1
    for one, pose in zip(ours, poses, strict=True):
        assert_same(one, render(snapshot, CAMERA, pose))


def test_few_pixels_at_a_time_are_measured_as_all(monkeypatch):
    memory, at_once = Counting(), 24
    monkeypatch.setattr(on_card, "MEASURED", at_once * (2 * 9 + 2 * 12 + 3 * 4))  # (of fine cells, three)
    (ours,) = reel_of(CAMERA, memory=memory).render(iter([(everything(), IDENTITY)]))
    assert_same(ours, render(everything(), CAMERA, IDENTITY))
    assert max(memory.launches.values()) > 3


def test_worlds_that_cannot_go_together_are_painted_one_after_the_other():
    first = everything()
    others = [
        first,
        Snapshot(environment=TEXTURES[2]),
        Snapshot(environment=Texture(TEXTURES[2].pixels / 2)),
        replace(first, things=first.things[:2]),
        replace(first, environment=None),
        replace(first, lamps=first.lamps[:1]),
        Snapshot(),
        Snapshot(),
    ]
    memory = Counting()
    ours = list(reel_of(CAMERA, memory=memory).render((snapshot, IDENTITY) for snapshot in others))
    for one, snapshot in zip(ours, others, strict=True):
        assert_same(one, render(snapshot, CAMERA, IDENTITY))
    assert memory.paintings == 7


def test_what_does_not_move_is_uploaded_once():
    snapshot, memory = replace(everything(), environment=TEXTURES[0]), Counting()
    reel = reel_of(CAMERA, memory=memory)
    sizes = []
    for k in range(3):
        before = memory.put_bytes
        next(reel.render(iter([(snapshot, Pose.of((0, k, 0)))])))
        sizes.append(memory.put_bytes - before)
    texels = sum(texture.levels.pixels.nbytes for texture in TEXTURES)
    assert sizes[1] < sizes[0] - texels and abs(sizes[2] - sizes[1]) < 2000  # (places of details move)


def test_a_source_gives_the_light_of_the_device():
    text = "spinning-shapes,size=14x14,scene.duration_s=0.004"
    here, there = open_scene(text, fps=1000), open_scene(text, fps=1000)
    there.memory = Simulated()
    for start in (0, 2):
        ours, theirs = list(there.frames(start)), list(here.frames(start))
        assert [frame.t_ns for frame in ours] == [frame.t_ns for frame in theirs] and len(theirs) == 5 - start
        for one, other in zip(ours, theirs, strict=True):
            # (a sum of three products, in another order: two roundings of float32)
            np.testing.assert_allclose(one.light.numpy(), other.light, rtol=2.5e-7)
    there.colour = here.colour = "rgb"
    assert np.array_equal(next(iter(there.frames())).light.numpy(), next(iter(here.frames())).light)
