"""Pictures of a world agree with geometry that is known in closed form."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixels_of
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.render import Picture, render
from vid2ev.scenes.snapshot import Lamp, Shape, Snapshot, Surface, Texture, Thing

CAMERA = Intrinsics.of_field((64, 48), 60)
AMBIENT = Lamp("ambient")


def seen(*things: Thing, camera: Intrinsics = CAMERA, pose: Pose = IDENTITY, samples: int = 2) -> Picture:
    return render(Snapshot(things, [AMBIENT]), camera, pose, samples=samples, threads=1)


def thing(kind: str, size: tuple, turn: tuple = (0, 0, 0), way: tuple = (0, 0, 5), **surface: object) -> Thing:
    return Thing("it", Shape(kind, size), Surface(**surface), Pose.of(turn, way))  # type: ignore[arg-type]


def test_a_white_surface_under_ambient_light_has_light_one_and_its_depth():
    picture = seen(thing("plane", (99, 99, 0), way=(0, 0, 3)))
    np.testing.assert_allclose(picture.light, 1, rtol=1e-6)
    np.testing.assert_allclose(picture.depth, 3, rtol=1e-6)
    assert (picture.thing == 0).all()


def test_where_nothing_is_it_is_dark_and_infinitely_far():
    picture = seen()
    assert (picture.light == 0).all() and np.isposinf(picture.depth).all() and (picture.thing == -1).all()
    assert [array.dtype for array in picture] == [np.float32, np.float32, np.int32]


@pytest.mark.parametrize("turn", [0, 3, 14, 33, 45, 80])
def test_an_edge_covers_each_pixel_by_its_area(turn):
    # A wide plane turned in the picture, whose near edge goes through the middle at `turn` degrees.
    wide = thing("plane", (40, 40, 0), (0, 0, turn), way=(0, 0, 5))
    turned = wide.pose.apply(np.array([-20.0, 0, 0])) - (0, 0, 5)  # its left edge, brought to the middle
    picture = seen(Thing("it", wide.shape, pose=Pose(wide.pose.rotation, np.array([0, 0, 5]) - turned)))
    x, y = np.meshgrid(np.arange(64) - CAMERA.centre_px[0], np.arange(48) - CAMERA.centre_px[1])
    fine = (np.arange(64) + 0.5) / 64 - 0.5
    across, down = np.meshgrid(fine, fine)
    cos, sin = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    inside = (cos * (x[..., None] + across.ravel()) + sin * (y[..., None] + down.ravel())) > 0
    np.testing.assert_allclose(picture.light[..., 0], inside.mean(axis=-1), atol=0.02)
    assert abs(picture.light[..., 0].mean() - inside.mean()) < 2e-4


def test_a_corner_of_a_box_is_where_projection_puts_it():
    camera, box = Intrinsics.of_field((320, 240), 60), thing("box", (1, 0.8, 0.6), (20, 30, 10))
    mask = seen(box, camera=camera, samples=4).light[..., 0].astype(np.float64)
    corners = box.pose.apply(np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.4, 0.4) for z in (-0.3, 0.3)]))
    pixels = corners[:, :2] / corners[:, 2:] * camera.focal_px + camera.centre_px
    hull = cv2.convexHull(pixels.astype(np.float32))[:, 0].astype(np.float64)
    assert mask.sum() == pytest.approx(cv2.contourArea(hull.astype(np.float32)), rel=2e-4)
    for a, b in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        # the place of each edge along the lines that cross it, against the line between the projected corners
        across = 0 if abs(b[1] - a[1]) > abs(b[0] - a[0]) else 1
        lines = np.arange(
            math.ceil(min(a[1 - across], b[1 - across])) + 2, math.floor(max(a[1 - across], b[1 - across])) - 2
        )
        for line in lines:
            true = a[across] + (b - a)[across] * (line - a[1 - across]) / (b - a)[1 - across]
            low = int(true) - 3
            values = mask[line, low : low + 8] if across == 0 else mask[low : low + 8, line]
            rises = values[-1] > values[0]
            found = low + 7.5 - values.sum() if rises else low - 0.5 + values.sum()
            assert found == pytest.approx(true, abs=0.01)


def test_the_area_of_a_sphere_is_that_of_its_projected_ellipse():
    camera = Intrinsics.of_field((320, 240), 60)
    centre, radius = np.array([0.8, -0.4, 4.0]), 0.7
    picture = seen(thing("sphere", (2 * radius,) * 3, (10, 20, 30), tuple(centre)), camera=camera)
    d2, f = centre @ centre, camera.focal_px[0]
    # the conic section of the cone of rays that touch the sphere
    area = math.pi * f * f * radius**2 * math.sqrt((d2 - radius**2) / (centre[2] ** 2 - radius**2) ** 3)
    assert picture.light[..., 0].sum() == pytest.approx(area, rel=3e-4)
    assert centre[2] - radius < picture.depth.min() < centre[2]


def test_depth_of_shapes_is_exact_along_the_middle_ray():
    camera = Intrinsics(size=(3, 3), focal_px=(100, 100), centre_px=(1, 1))
    for kind, nearest in (("plane", 5.0), ("box", 4.5), ("sphere", 4.5), ("cylinder", 4.5)):
        assert seen(thing(kind, (1, 1, 1)), camera=camera).depth[1, 1] == pytest.approx(nearest, rel=1e-7), kind
    inside = seen(thing("box", (2, 2, 2), way=(0, 0, 0)), camera=camera)
    assert inside.depth[1, 1] == 1.0  # from within one sees the far side
    turned = seen(thing("cylinder", (1, 0.6, 3), (0, 90, 0)), camera=camera)
    assert turned.depth[1, 1] == pytest.approx(4.5, rel=1e-7)


def test_faces_show_their_picture_upright_and_unmirrored():
    colours = np.zeros((2, 2, 3), np.float32)
    colours[0, 0], colours[0, 1], colours[1, 0], colours[1, 1] = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)
    for kind in ("plane", "box", "cylinder", "sphere"):
        light = seen(thing(kind, (3, 3, 3), texture=Texture(colours))).light
        if kind == "sphere":  # (its front is the middle of the picture)
            assert light[20, 28].argmax() == 0 and light[20, 35].argmax() == 1
        else:
            assert light[14, 22].argmax() == 0 and light[14, 42].argmax() == 1 and light[34, 22].argmax() == 2


@pytest.mark.parametrize("kind", ["plane", "box", "sphere"])
@pytest.mark.parametrize("times", [1, 2])
def test_a_picture_that_is_repeated_less_than_no_time_is_mirrored(kind, times):
    picture = Texture(np.random.default_rng(0).random((8, 8, 3)))
    one, across, down = (
        seen(thing(kind, (2, 2, 2), way=(0, 0, 3), texture=picture, repeat=repeat)).light
        for repeat in ((times, times), (-times, times), (times, -times))
    )
    assert one.std() > 0.1
    np.testing.assert_allclose(across, one[:, ::-1], atol=2e-5)
    np.testing.assert_allclose(down, one[::-1], atol=2e-5)


def test_a_pixel_does_not_depend_on_threads_or_on_other_frames():
    box = thing("box", (1, 1, 1), (10, 20, 30), texture=Texture(np.random.default_rng(1).random((32, 32, 3))))
    world = Snapshot([box], [AMBIENT, Lamp("point", shadows=True)])
    first = render(world, CAMERA, IDENTITY, threads=1)
    render(Snapshot([thing("sphere", (1, 1, 1))], [AMBIENT]), CAMERA, IDENTITY)
    again = render(world, CAMERA, IDENTITY, threads=2)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))


@pytest.mark.parametrize("kind", ["plane", "box", "sphere", "cylinder"])
def test_light_changes_smoothly_while_things_move(kind):
    # The steepest honest slope is one pixel of full contrast per pixel of motion; corners of shapes may pop a little.
    steps, shift_px = 200, 1.0
    frames = []
    for k in range(steps):
        way = (shift_px * k / steps / CAMERA.focal_px[0] * 5, 0, 5)
        frames.append(seen(thing(kind, (1.5, 1.2, 0.7), (33, 20, 10), way)).light[..., 0])
    change = np.abs(np.diff(frames, axis=0))
    assert np.quantile(change[change > 1e-6], 0.99) < 2 * shift_px / steps
    assert change.max() < 0.2


@pytest.mark.parametrize("width_px", [0.25, 0.6, 1.3])
@pytest.mark.parametrize("kind", ["box", "cylinder", "plane"])
def test_what_is_thinner_than_a_pixel_has_its_width(kind, width_px):
    width = width_px / CAMERA.focal_px[0] * 5
    # a pole that is longer than the picture is high, at a slant (a cylinder's length is along z)
    turn = Pose.of((0, 0, 10)) @ Pose.of((90, 0, 0) if kind == "cylinder" else (0, 0, 0))
    size = (width, width, 3.0) if kind == "cylinder" else (width, 3.0, 1e-9)
    light = seen(Thing("pole", Shape(kind, size), pose=Pose(turn.rotation, np.array([0.01, 0.02, 5])))).light[..., 0]
    across = light[12:36].sum(axis=1)
    np.testing.assert_allclose(across, width_px / math.cos(math.radians(10)), rtol=0.12, atol=0.04)


def test_nothing_is_missing_where_a_tile_sees_nearly_half_of_all_around():
    # (eleven pixels across 169 degrees, and 98 down through the same lens)
    camera, rng = Intrinsics.of_field((11, 98), 169), np.random.default_rng(1)
    plane = rays_of_pixels(camera)[1:-1, 1:-1]
    rays = np.concatenate([plane, np.ones((98, 11, 1))], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    for x, y, z in rng.normal(size=(60, 3)):
        centre = np.array([x, y, 0.3 * abs(z)]) * 3 / math.hypot(x, y, 0.3 * z)
        picture = seen(thing("sphere", (1.5,) * 3, way=tuple(centre)), camera=camera, samples=1)
        along = rays @ centre
        assert np.array_equal(picture.thing == 0, (along > 0) & (along**2 > centre @ centre - 0.75**2))


def test_what_is_smaller_than_a_pixel_has_its_area():
    for radius_px in (0.3, 0.5, 0.9):
        for shift in (0, 0.3, 0.5):
            way = (shift / CAMERA.focal_px[0] * 5, 0, 5)
            light = seen(thing("sphere", (2 * radius_px / CAMERA.focal_px[0] * 5,) * 3, way=way)).light[..., 0]
            assert light.sum() == pytest.approx(math.pi * radius_px**2, rel=0.06)


def test_rays_through_a_lens_land_where_opencv_projects():
    lenses = {"radtan": (-0.2, 0.05, 0.001, -0.002), "equidistant": (0.01, -0.003, 0.001, 0.0)}
    for model, distortion in lenses.items():
        camera = Intrinsics(size=(64, 48), focal_px=(40, 41), centre_px=(31, 23), model=model, distortion=distortion)  # type: ignore[arg-type]
        wall = seen(thing("plane", (99, 99, 0), (10, 15, 0)), camera=camera)
        rays = rays_of_pixels(camera)[1:-1, 1:-1]
        points = np.concatenate([rays, np.ones((48, 64, 1))], axis=-1) * wall.depth[..., None]
        y, x = np.mgrid[:48, :64]
        np.testing.assert_allclose(
            pixels_of(points.reshape(-1, 3), camera), np.stack([x, y], -1).reshape(-1, 2), atol=1e-3
        )


def test_samples_that_cannot_be_meant_are_refused():
    with pytest.raises(UsageError, match="samples"):
        render(Snapshot(), CAMERA, IDENTITY, samples=0)


def test_an_even_sky_lights_a_white_surface_as_itself() -> None:
    wall = Thing("wall", Shape("plane", (9.0, 9.0, 0.0)), pose=Pose.of((0, 0, 0), (0, 0, 2)))
    for size in ((1, 1), (2, 3), (64, 128)):
        around = Texture(np.full((*size, 3), 0.2, np.float32))
        light = render(Snapshot([wall], environment=around), Intrinsics.of_field((8, 6)), IDENTITY, threads=1).light
        assert np.allclose(light, 0.2, rtol=2e-3), size
