"""Worlds: what is seen at t is a function of scene, seed and t alone, and where the trajectories say."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from vid2ev.errors import DataError, UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid, rays_of
from vid2ev.rig.pose import Pose
from vid2ev.scenes.scene_file import read_scene, scene_names
from vid2ev.scenes.world import World
from vid2ev.toml_text import toml_text

SMALL = ["camera.size=[48, 36]"]
BALL = """
[scene]
duration_s = 1
ambient = 0.5

[camera]
size = [160, 120]
focal_px = [150, 150]
trajectory = { kind = "straight", velocity_m_s = [0.2, 0, 0] }

[[objects]]
name = "ball"
kind = "sphere"
size_m = 0.4
colour = [0.8, 0.4, 0.2]
trajectory = { kind = "straight", position_m = [-0.3, 0.1, 2.0], velocity_m_s = [1.0, -0.3, 0.5] }
"""


WALL = """
[[objects]]
name = "wall"
kind = "plane"
size_m = 9
trajectory = { kind = "fixed", position_m = [0, 0, 1] }
"""


@pytest.fixture
def ball(tmp_path: Path) -> World:
    file = tmp_path / "ball.toml"
    file.write_text(BALL)
    return World.of(file)


@pytest.mark.parametrize(
    "lens",
    [
        Intrinsics(size=(60, 60), focal_px=(18, 18), centre_px=(29.5, 29.5), model="equidistant", distortion=(0,) * 4),
        Intrinsics(size=(60, 60), focal_px=(60, 60), centre_px=(25, 31), model="radtan", distortion=(-1, 0, 0, 0)),
    ],
)
def test_what_a_lens_does_not_see_is_black_and_its_depth_is_not_known(tmp_path: Path, lens: Intrinsics) -> None:
    file = tmp_path / "inside.toml"
    file.write_text('[scene]\nambient = 1\n[[objects]]\nname = "all"\nkind = "sphere"\nsize_m = 4\n')
    seen = np.isfinite(rays_of(pixel_grid((60, 60)), lens)[..., 0])
    picture = World.of(file).render(0, lens)
    assert 0.1 < seen.mean() < 0.9
    np.testing.assert_array_equal(np.isfinite(picture.depth), seen)
    assert np.isnan(picture.depth[~seen]).all() and np.isfinite(picture.light).all()
    assert picture.light[seen].min() > 0.05
    far = ~cv2.dilate(seen.astype(np.uint8), np.ones((3, 3))).astype(bool)
    assert far.any() and not picture.light[far].any()
    file.write_text(file.read_text().replace("ambient", "background"))  # (which lights as much, and is nowhere seen)
    np.testing.assert_allclose(World.of(file).render(0, lens).light, picture.light, atol=1e-3)


@pytest.mark.parametrize("name", scene_names())
def test_a_frame_does_not_depend_on_which_others_were_asked_for(name: str) -> None:
    t_ns = 123_456_789
    fresh = World.of(name, 2, SMALL).render(t_ns)
    used = World(read_scene(name, SMALL), 2, threads=1)
    for other_ns in (0, used.duration_ns, t_ns + 1, 7):
        used.render(other_ns)
    again = used.render(t_ns)
    assert all(np.array_equal(one, other) for one, other in zip(fresh, again, strict=True))
    assert not np.array_equal(fresh.light, World.of(name, 3, SMALL).render(t_ns).light)
    assert fresh.light.std() > 0.001 and np.isfinite(fresh.light).all()


def test_a_resolved_scene_gives_the_very_same_pictures(tmp_path: Path) -> None:
    world = World.of("spinning-shapes", 4, SMALL)
    file = tmp_path / "resolved.toml"
    file.write_text(toml_text(world.scene.tables()), encoding="utf-8")
    again = World.of(file)
    for t_ns in (0, 777_777_777):
        assert np.array_equal(world.render(t_ns).light, again.render(t_ns).light)


@pytest.mark.parametrize("t_ns", [0, 400_000_000, 1_000_000_000])
def test_things_are_seen_where_their_trajectories_say(ball: World, t_ns: int) -> None:
    t_s = 1e-9 * t_ns
    centre = np.array([-0.3 + 1.0 * t_s - 0.2 * t_s, 0.1 - 0.3 * t_s, 2.0 + 0.5 * t_s])
    picture = ball.render(t_ns)
    rows, columns = np.nonzero(picture.thing == 0)
    intrinsics = ball.intrinsics
    x, y = (150 * centre[k] / centre[2] + intrinsics.centre_px[k] for k in (0, 1))
    # (a sphere's outline is an ellipse whose middle is a little farther out than the sphere's)
    outwards = 1 / (1 - (0.2 / centre[2]) ** 2)
    assert abs(columns.mean() - (intrinsics.centre_px[0] + (x - intrinsics.centre_px[0]) * outwards)) < 0.3
    assert abs(rows.mean() - (intrinsics.centre_px[1] + (y - intrinsics.centre_px[1]) * outwards)) < 0.3
    nearest = picture.depth[round(y), round(x)]
    assert np.linalg.norm(centre) - 0.2 < nearest * 1.05 and nearest < centre[2] - 0.15
    assert np.isinf(picture.depth[picture.thing < 0]).all()
    assert np.allclose(picture.light[round(y), round(x)], [0.4, 0.2, 0.1], rtol=1e-5)


def test_a_camera_of_the_rig_sees_disparity(ball: World) -> None:
    reference, right = ball.render(0), ball.render(0, pose_in_rig=Pose.of(translation_m=(0.05, 0, 0)))
    shift = np.nonzero(reference.thing == 0)[1].mean() - np.nonzero(right.thing == 0)[1].mean()
    assert shift == pytest.approx(150 * 0.05 / 2.0, abs=0.3)
    coarse = ball.render(0, Intrinsics.of_field((40, 30), 60), Pose.of((0, 0, 90)))
    assert coarse.light.shape == (30, 40, 3)


def test_flow_is_the_motion_between_two_instants(ball: World) -> None:
    picture = ball.render(0)
    shift, seen = ball.flow(0, 10_000_000, picture)
    middle = shift[picture.thing == 0].mean(axis=0)
    before = np.nonzero(picture.thing == 0)[1].mean()
    after = np.nonzero(ball.render(10_000_000).thing == 0)[1].mean()
    x0, x1 = 150 * -0.3 / 2.0, 150 * (-0.3 + 0.008) / 2.005
    assert middle[0] == pytest.approx(x1 - x0, rel=0.1) and after - before == pytest.approx(x1 - x0, abs=0.4)
    assert shift.dtype == np.float32 and seen.shape == picture.depth.shape and seen[picture.thing == 0].mean() > 0.9


def test_meshes_have_the_size_that_is_asked_for(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((2, 4, 8)).apply_translation((5, 5, 5)).export(tmp_path / "block.ply")
    file = tmp_path / "mesh.toml"
    file.write_text(
        "[scene]\nambient = 1\n[camera]\nsize = [101, 101]\nfocal_px = [100, 100]\n"
        '[[objects]]\nname = "block"\nkind = "mesh"\nfile = "block.ply"\nsize_m = 0.8\n'
        'trajectory = { kind = "fixed", position_m = [0, 0, 1.4] }\n'
    )
    picture = World.of(file).render(0)
    rows, columns = np.nonzero(picture.thing == 0)
    assert picture.depth[50, 50] == pytest.approx(1.0, rel=1e-5)  # (0.8 m deep, around its middle)
    assert np.ptp(columns) + 1 == 20 + 1 and np.ptp(rows) + 1 == 40 + 1  # (0.2 x 0.4 m, a metre away, borders included)
    with pytest.raises(UsageError, match=r"objects.block.file = 'none.ply': no such file"):
        read_scene(file, ["objects.block.file=none.ply"])
    (tmp_path / "bad.ply").write_text("ply\n")
    with pytest.raises(DataError, match=r"bad\.ply"):
        World.of(file, 0, ["objects.block.file=bad.ply"])


def test_environments_are_pictures_of_any_light(tmp_path: Path) -> None:
    around = np.full((8, 16, 3), 0.5, np.float32)
    around[:, 8:] = [1.0, 4.0, 20.0]  # (blue, green, red) on the right half
    cv2.imwrite(str(tmp_path / "around.hdr"), around)
    file = tmp_path / "sky.toml"
    file.write_text(
        '[scene]\nenvironment = "around.hdr"\nenvironment_gain = 0.5\n'
        "[camera]\nsize = [41, 21]\nfov_deg = 90\n"
        'trajectory = { kind = "fixed", rotation_deg = [0, 0, 0] }\n'
    )
    light = World.of(file).render(0).light
    assert np.allclose(light[10, 36], [10, 2, 0.5], rtol=0.02) and np.allclose(light[10, 4], 0.25, rtol=0.02)
    turned = World.of(file, 0, ["environment_rotation_deg=[0, 180, 0]"]).render(0).light
    assert np.allclose(turned[10, 4], [10, 2, 0.5], rtol=0.02)
    plain = World.of(file, 0, ["environment={ pattern = 'checker' }", "background=0.3"]).render(0).light
    assert plain.std() > 0.1
    with pytest.raises(UsageError, match="no such file"):
        World.of(file, 0, ["environment=none.hdr"])


def test_a_rig_is_read_before_anything_is_rendered(ball: World, tmp_path: Path) -> None:
    assert ball.viewpoints == ()
    pair = World.of("close-object", 0, SMALL).viewpoints
    assert [view.camera.name for view in pair] == ["dvs", "cis"]
    assert np.linalg.norm(pair[1].pose.translation_m - pair[0].pose.translation_m) == pytest.approx(0.015)
    (tmp_path / "rig.toml").write_text('[[camera]]\nname = "a"\nkind = "eye"\n')
    with pytest.raises(UsageError, match="eye"):
        World.of(tmp_path / "ball.toml", 0, ["rig=rig.toml"])


def test_flicker_is_a_sine(tmp_path: Path) -> None:
    file = tmp_path / "flicker.toml"
    flicker = "flicker = { frequency_hz = 100, depth = 0.5, phase_deg = 30 }"
    file.write_text("[camera]\nsize = [9, 9]\n" + WALL + f'[[lights]]\nname = "a"\nkind = "ambient"\n{flicker}\n')
    world = World.of(file)
    for t_s in (0.0, 0.0013, 0.5071):
        wanted = 1 + 0.5 * np.sin(2 * np.pi * 100 * t_s + np.radians(30))
        assert world.render(round(1e9 * t_s)).light[4, 4, 1] == pytest.approx(wanted, rel=1e-5)


def test_lamps_move_and_objects_glow(tmp_path: Path) -> None:
    file = tmp_path / "lamp.toml"
    file.write_text(
        "[camera]\nsize = [33, 33]\n"
        + WALL
        + '[[objects]]\nname = "bulb"\nkind = "sphere"\nsize_m = 0.2\nemission = 50\ncolour = [1, 0.5, 0.5]\n'
        'trajectory = { kind = "fixed", position_m = [0, 0.2, 0.9] }\n'
        '[[lights]]\nname = "a"\nkind = "point"\nreach_m = 0.5\n'
        'trajectory = { kind = "straight", position_m = [-0.5, 0, 0.5], velocity_m_s = [1, 0, 0] }\n'
    )
    world = World.of(file)
    brightest = [int(world.render(round(1e9 * t_s)).light[:12, :, 2].sum(axis=0).argmax()) for t_s in (0.1, 0.5, 0.9)]
    assert brightest[0] < brightest[1] < brightest[2] and brightest[1] in (15, 16, 17)
    bulb = world.render(0)
    assert np.allclose(bulb.light[bulb.thing == 1].max(axis=0), [50, 25, 25], rtol=0.1)
    at_centre = world.render(500_000_000).light[10, 16, 0]
    assert 0.5 < at_centre <= 1.0  # (the wall is half a metre away, which is its reach)


def test_the_gain_of_an_environment_is_none_of_a_background(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text("[scene]\nbackground = 0.2\nenvironment_gain = 3\n[camera]\nsize = [4, 4]\n")
    np.testing.assert_allclose(World.of(path).render(0).light, 0.2, rtol=1e-6)
