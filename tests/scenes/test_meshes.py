"""Meshes: the hierarchy finds what trying all triangles finds, and files of all kinds are the same shape."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.mesh_files import load_mesh
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Lamp, Mesh, Shape, Snapshot, Surface, Thing
from vid2ev.scenes.world import World

trimesh = pytest.importorskip("trimesh", reason="trimesh reads meshes")
CAMERA = Intrinsics.of_field((64, 48), 60)


def seen(*things: Thing, camera: Intrinsics = CAMERA, pose: Pose = IDENTITY):
    return render(Snapshot(things, [Lamp("ambient"), Lamp("sun")]), camera, pose, threads=1)


def tried_all(mesh: Mesh, pose: Pose, camera: Intrinsics) -> np.ndarray:
    """Depth by trying every triangle with every ray."""
    rays = rays_of_pixels(camera)[1:-1, 1:-1]
    d = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1).reshape(-1, 1, 3)
    v = pose.apply(mesh.vertices)[mesh.triangles]
    e1, e2 = v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
    p = np.cross(d, e2)
    volume = (e1 * p).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = -v[:, 0]
        b1 = (s * p).sum(-1) / volume
        q = np.cross(s, e1)
        b2 = (d * q).sum(-1) / volume
        t = (e2 * q).sum(-1) / volume
        t[~((b1 >= 0) & (b2 >= 0) & (b1 + b2 <= 1) & (t > 0))] = np.inf
    return t.min(axis=1).reshape(rays.shape[:2])


@pytest.mark.parametrize("count", [1, 5, 300])
def test_the_hierarchy_finds_the_nearest_triangle(count):
    rng = np.random.default_rng(count)
    centres = rng.uniform(-2, 2, (count, 1, 3))
    mesh = Mesh((centres + rng.uniform(-0.5, 0.5, (count, 3, 3))).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    for pose in (Pose.of((10, 20, 30), (0, 0, 5)), Pose.of((50, 0, 0), (0.1, 0, 0))):  # from outside and from within
        picture = seen(Thing("it", Shape("mesh", mesh=mesh), pose=pose))
        np.testing.assert_allclose(picture.depth, tried_all(mesh, pose, CAMERA), rtol=1e-5)


def test_a_vertex_that_no_triangle_has_is_no_part_of_a_mesh(tmp_path):
    spots = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [50, 60, 70]], float)
    lone, own = Mesh(spots, np.array([[0, 1, 2]])), Mesh(spots[:3], np.array([[0, 1, 2]]))
    np.testing.assert_array_equal(lone.size_m, own.size_m)
    np.testing.assert_array_equal(lone.ball[0], own.ball[0])
    assert lone.ball[1] == own.ball[1]
    places = []
    for name, count in (("lone", 4), ("own", 3)):
        lines = [f"v {x} {y} {z}" for x, y, z in spots[:count]] + ["f 1 2 3"]
        (tmp_path / f"{name}.obj").write_text("\n".join(lines))
        (tmp_path / f"{name}.toml").write_text(
            f'[[objects]]\nname = "it"\nkind = "mesh"\nfile = "{name}.obj"\nsize_m = 3\n'
            'trajectory = { kind = "fixed", position_m = [0, 0, 5] }\n'
        )
        shape = World.of(tmp_path / f"{name}.toml").snapshot(0).things[0].shape
        places.append(shape.mesh.vertices[shape.mesh.triangles])
    np.testing.assert_array_equal(*places)
    assert np.ptp(places[0].reshape(-1, 3), axis=0).max() == 3


def test_of_several_meshes_the_nearest_triangle_of_all_is_seen():
    rng = np.random.default_rng(1)
    spots = [(rng.uniform(-2, 2, (200, 1, 3)) + rng.uniform(-0.3, 0.3, (200, 3, 3))).reshape(-1, 3) for _ in range(3)]
    things = [
        Thing(
            f"{k}", Shape("mesh", mesh=Mesh(places, np.arange(600).reshape(-1, 3))), pose=Pose.of((0, 0, 0), (0, 0, 5))
        )
        for k, places in enumerate(spots)
    ]
    alone = np.stack([seen(thing).depth for thing in things])
    together = seen(*things)
    np.testing.assert_array_equal(together.depth, alone.min(axis=0))
    there = np.isfinite(together.depth)
    np.testing.assert_array_equal(together.thing[there], alone.argmin(axis=0)[there])


def test_triangles_are_smooth_together_where_their_corners_have_a_normal_in_common():
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])[[0, 1, 2, 0, 2, 3]]
    for tilt, parts in ((0, 1), (1, 2)):
        normals = np.array([[0, 0, -1]] * 3 + [[tilt, 0, -1]] * 3)
        mesh = Mesh(places, np.arange(6).reshape(2, 3), normals=normals)
        assert len(set(mesh.numbers.part.tolist())) == parts


def test_a_mesh_of_a_sphere_is_nearly_a_sphere(tmp_path):
    trimesh.creation.icosphere(5).export(tmp_path / "ball.ply")
    ball, pose = load_mesh(tmp_path / "ball.ply"), Pose.of((10, 20, 30), (0.3, -0.2, 5))
    assert ball.normals is not None
    shiny = Surface(specular=0.5)
    mesh = seen(Thing("it", Shape("mesh", mesh=ball), shiny, pose))
    true = seen(Thing("it", Shape("sphere", (2, 2, 2)), shiny, pose))
    inside = (mesh.thing == 0) & (true.thing == 0)
    assert inside.mean() > 0.1 and (mesh.thing != true.thing).mean() < 0.01
    near = inside & (true.depth < 4.7)  # (at the rim depth is steep)
    np.testing.assert_allclose(mesh.depth[near], true.depth[near], atol=2e-3)
    np.testing.assert_allclose(mesh.light[near], true.light[near], atol=0.01)
    assert mesh.light.sum() == pytest.approx(true.light.sum(), rel=3e-3)


def test_edges_at_which_a_mesh_hides_itself_are_smooth():
    ring = trimesh.creation.torus(1, 0.35, major_sections=96, minor_sections=48)
    mesh = Mesh(ring.vertices, ring.faces, normals=ring.vertex_normals)
    things = [Thing("ring", Shape("mesh", mesh=mesh), pose=Pose.of((65, 20, 0), (0, 0, 4)))]
    world = Snapshot(things, [Lamp("ambient", (0.2,) * 3), Lamp("sun", direction=(0.3, 1, 0.4))])
    many = render(world, Intrinsics.of_field((64 * 12, 48 * 12), 60), IDENTITY, samples=1).light
    true = many.reshape(48, 12, 64, 12, 3).mean(axis=(1, 3))
    rough, smooth = (render(world, CAMERA, IDENTITY, samples=samples).light for samples in (1, 2))
    inside = true.min(axis=-1) > 0.2  # (the outline has its own tests)
    errors = [np.abs(light - true)[inside] for light in (rough, smooth)]
    assert errors[0].max() > 0.2 and errors[1].max() < 0.06


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb", "gltf"])
def test_files_of_all_kinds_hold_the_same_box(tmp_path, suffix):
    box = trimesh.creation.box((1, 0.8, 0.6))
    scene = trimesh.Scene(box)
    (scene if suffix == "gltf" else box).export(tmp_path / f"box.{suffix}")
    mesh, pose = load_mesh(tmp_path / f"box.{suffix}"), Pose.of((20, 30, 10), (0, 0, 3))
    np.testing.assert_allclose(mesh.size_m, (1, 0.8, 0.6), rtol=1e-5)
    picture = seen(Thing("it", Shape("mesh", mesh=mesh), pose=pose))
    true = seen(Thing("it", Shape("box", (1, 0.8, 0.6)), pose=pose))
    np.testing.assert_allclose(picture.light, true.light, atol=0.02)


def test_several_geometries_are_joined_where_they_stand(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.icosphere(3))
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), transform=trimesh.transformations.translation_matrix((5, 0, 0)))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    np.testing.assert_allclose(mesh.vertices.min(axis=0), (-1, -1, -1), atol=0.01)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (5.5, 1, 1), atol=0.01)


def test_a_picture_and_its_place_come_with_the_file(tmp_path):
    from PIL import Image

    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0] = (255, 0, 0)  # the upper half is red
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])  # y up, as in glTF
    visual = trimesh.visual.TextureVisuals(uv=[(0, 0), (1, 0), (1, 1), (0, 1)], image=Image.fromarray(picture))
    card = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], visual=visual, process=False)
    for suffix in ("glb", "obj"):
        card.export(tmp_path / f"card.{suffix}")
        mesh = load_mesh(tmp_path / f"card.{suffix}")
        assert mesh.texture is not None and mesh.uv is not None
        light = seen(Thing("it", Shape("mesh", mesh=mesh), pose=Pose.of((180, 0, 0), (0, 0, 3)))).light
        assert light[16, 32, 0] > 4 * light[32, 32, 0] and light[16, 32, 1] == 0, suffix


def test_colours_of_vertices_are_those_of_the_file(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    box.visual.vertex_colors = np.tile(np.array([255, 128, 0, 255], np.uint8), (8, 1))
    box.export(tmp_path / "box.ply")
    colours = load_mesh(tmp_path / "box.ply").colours
    np.testing.assert_allclose(colours[0], (1, 0.2158605, 0), atol=1e-3)


@pytest.mark.parametrize("content", [b"", b"nonsense", b"ply\nformat ascii 1.0\nelement vertex 9\n", b"\x00" * 200])
@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".gltf", ".glb"])
def test_broken_files_are_one_sentence(tmp_path, content, suffix):
    (tmp_path / f"bad{suffix}").write_bytes(content)
    with pytest.raises(DataError, match="bad") as caught:
        load_mesh(tmp_path / f"bad{suffix}")
    assert "\n" not in str(caught.value)


def test_files_cut_short_never_end_in_a_traceback(tmp_path):
    trimesh.creation.icosphere(1).export(tmp_path / "whole.glb")
    whole = (tmp_path / "whole.glb").read_bytes()
    for length in range(0, len(whole), len(whole) // 12):
        (tmp_path / "cut.glb").write_bytes(whole[:length])
        with pytest.raises(DataError):
            load_mesh(tmp_path / "cut.glb")


def test_other_files_are_refused(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match=r"\.obj"):
        load_mesh(tmp_path / "it.txt")
    with pytest.raises(DataError, match="no such file"):
        load_mesh(tmp_path / "it.obj")
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n")
    with pytest.raises(DataError, match="one place"):
        load_mesh(tmp_path / "flat.obj")
    (tmp_path / "points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n"
    )
    with pytest.raises(DataError, match="triangles"):
        load_mesh(tmp_path / "points.ply")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(UsageError, match=r"vid2ev\[scenes\]"):
        load_mesh(tmp_path / "flat.obj")


def test_meshes_that_cannot_be_are_refused():
    spots = np.eye(3)
    for triangles, problem in (([[0, 1, 3]], "vertices 0 to 2"), (np.zeros((0, 3)), "a triangle"), ([[0, 1]], "shape")):
        with pytest.raises(UsageError, match=problem):
            Mesh(spots, np.array(triangles))
    with pytest.raises(UsageError, match="finite"):
        Mesh(spots * np.nan, np.array([[0, 1, 2]]))
    with pytest.raises(UsageError, match="uv"):
        Mesh(spots, np.array([[0, 1, 2]]), uv=np.zeros((2, 2)))
