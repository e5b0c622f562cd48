"""Light on surfaces follows its law: distance, angle, highlights, shadows, environments."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Lamp, Mesh, Shape, Snapshot, Surface, Texture, Thing
from vid2ev.scenes.surroundings import irradiance_of

MIDDLE = Intrinsics(size=(3, 3), focal_px=(1000, 1000), centre_px=(1, 1))
WALL = Thing("wall", Shape("plane", (9, 9, 0)), pose=Pose.of((0, 0, 0), (0, 0, 4)))


def middle_of(*lamps: Lamp, wall: Thing = WALL, things: tuple = (), **sky: object) -> np.ndarray:
    world = Snapshot([wall, *things], lamps, **sky)  # type: ignore[arg-type]
    return render(world, MIDDLE, IDENTITY, threads=1).light[1, 1]


def test_a_point_lamp_falls_with_the_square_of_distance_and_the_cosine():
    assert middle_of(Lamp("point", position_m=(0, 0, 3))) == pytest.approx(1, rel=1e-5)
    assert middle_of(Lamp("point", position_m=(0, 0, 2))) == pytest.approx(1 / 4, rel=1e-5)
    assert middle_of(Lamp("point", position_m=(0, 0, 2), reach_m=2)) == pytest.approx(1, rel=1e-5)
    assert middle_of(Lamp("point", position_m=(1, 0, 3))) == pytest.approx(1 / 2 / np.sqrt(2), rel=1e-5)
    assert middle_of(Lamp("point", position_m=(0, 0, 3.98))) == pytest.approx(1 / 0.02**2, rel=1e-5)
    for nearer_m in (0.009, 1e-4):  # than 1 % of the reach
        assert middle_of(Lamp("point", position_m=(0, 0, 4 - nearer_m))) == pytest.approx(1e4, rel=1e-2)
    assert middle_of(Lamp("point", position_m=(0, 0, 5))) == pytest.approx(0)  # behind the wall
    assert np.isfinite(middle_of(Lamp("point", position_m=(0, 0, 4)))).all()


def test_a_sun_and_emission_add_up_with_the_colour_of_the_surface():
    wall = Thing("wall", WALL.shape, Surface(colour=(0.5, 0.25, 1), emission=3), WALL.pose)
    light = middle_of(Lamp("sun", (0.2, 0.4, 0.6), direction=(0, 1, 1)), Lamp("ambient", (0.1, 0.1, 0.1)), wall=wall)
    expected = np.array([0.5, 0.25, 1]) * (np.array([0.2, 0.4, 0.6]) / np.sqrt(2) + 0.1 + 3)
    np.testing.assert_allclose(light, expected, rtol=1e-5)


def test_the_highlight_is_that_of_blinn_and_phong():
    wall = Thing("wall", WALL.shape, Surface(colour=(0, 0, 0), specular=0.7, shininess=20), WALL.pose)
    # towards the lamp: (0, -1, -1) / sqrt 2; towards the eye: (0, 0, -1)
    half = np.cos(np.radians(22.5))
    light = middle_of(Lamp("sun", direction=(0, 1, 1)), wall=wall)
    np.testing.assert_allclose(light, 0.7 * np.sqrt(0.5) * half**20, rtol=1e-4)


@pytest.mark.parametrize("kind", ["sphere", "box", "mesh"])
def test_things_cast_shadows_if_the_lamp_does(kind):
    mesh = Mesh(np.array([[-0.3, -0.3, 0], [0.3, -0.3, 0], [0, 0.4, 0]]), np.array([[0, 1, 2]]))
    shape = Shape("mesh", mesh=mesh) if kind == "mesh" else Shape(kind, (0.5, 0.5, 0.5))  # type: ignore[arg-type]
    between = Thing("between", shape, pose=Pose.of((0, 0, 0), (0, -1, 3)))
    for lamp in (Lamp("sun", direction=(0, 1, 1), shadows=True), Lamp("point", position_m=(0, -2, 2), shadows=True)):
        assert middle_of(lamp, things=(between,)) == pytest.approx(0)
        assert (middle_of(lamp) > 0.05).all()
    short = Lamp("point", position_m=(0, -0.5, 3.5), shadows=True)  # it stands nearer than the thing
    assert (middle_of(short, things=(between,)) > 0.1).all()
    assert (middle_of(Lamp("sun", direction=(0, 1, 1)), things=(between,)) > 0.1).all()


def test_each_of_many_lamps_has_shadows_of_its_own():
    camera, ball = Intrinsics.of_field((64, 48), 60), Thing("ball", Shape("sphere", (0.6, 0.6, 0.6)))
    ball = Thing("ball", ball.shape, pose=Pose.of((0, 0, 0), (0, 0, 3)))
    turns = 2 * np.pi * np.arange(2 * 16) / (2 * 16)  # (every other one without)
    lamps = [
        Lamp("sun", (0.1, 0.1, 0.1), direction=(np.cos(turn), np.sin(turn), 1), shadows=bool(k % 2))
        for k, turn in enumerate(turns)
    ]

    def light(*some: Lamp) -> np.ndarray:
        return render(Snapshot([WALL, ball], some), camera, IDENTITY, threads=1).light.astype(np.float64)

    # (pixels in which many edges of shadows meet are not measured to the last bit)
    np.testing.assert_allclose(light(*lamps), sum(light(lamp) for lamp in lamps), atol=0.01)
    with pytest.raises(UsageError, match="17 lamps with shadows"):
        light(*lamps, lamps[1])


def test_the_edge_of_a_shadow_is_smooth():
    camera = Intrinsics.of_field((64, 48), 60)
    frames = []
    for k in range(50):
        edge = Thing("edge", Shape("plane", (4, 4, 0)), pose=Pose.of((0, 0, 20), (-2.4 + 0.02 * k / 50, 0, -1)))
        world = Snapshot([WALL, edge], [Lamp("sun", direction=(0, 0, 1), shadows=True)])
        frames.append(render(world, camera, IDENTITY, threads=1).light[..., 0])
    pixels_per_step = 0.02 / 50 * camera.focal_px[0] / 4
    assert np.abs(np.diff(frames, axis=0)).max() < 3 * pixels_per_step
    assert 0.1 < np.mean(frames[0]) < 0.9


def test_an_even_sky_is_ambient_light():
    sky = Texture(np.full((32, 64, 3), 0.7, np.float32))
    np.testing.assert_allclose(middle_of(environment=sky), 0.7, rtol=1e-4)
    np.testing.assert_allclose(middle_of(environment=sky, environment_gain=2.0), 1.4, rtol=1e-4)


def test_light_of_a_smooth_sky_on_any_normal():
    # L = 1 + y + x z / 2 has harmonics up to the second order only: its cosine-weighted mean is 1 + 2/3 y + x z / 8.
    v, u = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128, indexing="ij")
    x, y = np.sin(np.pi * v) * np.sin(2 * np.pi * (u - 0.5)), -np.cos(np.pi * v)
    z = np.sin(np.pi * v) * np.cos(2 * np.pi * (u - 0.5))
    sky = Texture(np.repeat((1 + y + x * z / 2)[..., None], 3, axis=2))
    assert irradiance_of(sky).shape == (9, 3)
    for turn in ((0, 0, 0), (40, 0, 0), (20, 50, 0), (-60, 10, 30)):
        wall = Thing("wall", WALL.shape, pose=Pose.of(turn, (0, 0, 4)))
        nx, ny, nz = -wall.pose.rotation[:, 2]
        np.testing.assert_allclose(middle_of(wall=wall, environment=sky), 1 + 2 / 3 * ny + nx * nz / 8, atol=2e-3)


def test_the_environment_is_seen_where_one_looks():
    colours = np.zeros((64, 128, 3), np.float32)
    colours[:, 60:68] = (1, 0, 0)  # ahead
    colours[:, 92:100] = (0, 1, 0)  # to the right
    colours[:8] = (0, 0, 1)  # above
    sky = Snapshot(environment=Texture(colours))
    looks = {(0, 0, 0): 0, (0, 90, 0): 1, (90, 0, 0): 2}
    for turn, channel in looks.items():
        light = render(sky, MIDDLE, Pose.of(turn)).light[1, 1]
        assert light[channel] == pytest.approx(1, abs=1e-3) and light.sum() == pytest.approx(1, abs=1e-3)
    turned = Snapshot(environment=Texture(colours), environment_pose=Pose.of((0, 90, 0)))
    assert render(turned, MIDDLE, Pose.of((0, 90, 0))).light[1, 1].argmax() == 0


def test_an_environment_is_not_blurred_where_its_pixels_are_as_large_as_the_picture_s():
    # (at the border of 120 degrees, where a pixel takes up half the angle across and down that it does in the middle)
    camera, sky = Intrinsics.of_field((64, 5), 120), np.random.default_rng(0).random((104, 128, 3)).astype(np.float32)
    light = render(Snapshot(environment=Texture(sky)), camera, IDENTITY).light
    for column, line in ((0, 0), (0, 2), (63, 3), (63, 4)):
        x, y = (np.array([column, line]) - camera.centre_px) / camera.focal_px
        length = np.sqrt(x * x + y * y + 1)
        u, v = 128 * (0.5 + np.arctan2(x, 1) / (2 * np.pi)) - 0.5, 104 * np.arccos(-y / length) / np.pi - 0.5
        left, top = int(u), int(v)
        right, down = u - left, v - top
        rows = sky[[top, top + 1], left] * (1 - right) + sky[[top, top + 1], left + 1] * right
        np.testing.assert_allclose(light[line, column], rows[0] * (1 - down) + rows[1] * down, atol=1e-5)


def test_what_cannot_be_meant_is_refused():
    with pytest.raises(UsageError, match="one of ambient, point, sun"):
        Lamp("candle")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="reach"):
        Lamp("point", reach_m=0)
    with pytest.raises(UsageError, match="direction"):
        Lamp("sun", direction=(0, 0, 0))
    with pytest.raises(UsageError, match="one of plane"):
        Shape("cone")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="size"):
        Shape("box", (1, -1, 1))
    with pytest.raises(UsageError, match="mesh"):
        Shape("mesh")
    with pytest.raises(UsageError, match="texture"):
        Texture(np.zeros((4, 4)))
