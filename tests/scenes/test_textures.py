"""Pictures on surfaces: in their place through perspective, and never finer than pixels."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY, Pose
from vid2ev.scenes.render import render
from vid2ev.scenes.snapshot import Lamp, Shape, Snapshot, Surface, Texture, Thing

CAMERA = Intrinsics.of_field((160, 120), 60)


def wave(texels: int) -> Texture:
    """One period of a sine across; its texels are means over themselves."""
    edges = -np.cos(2 * np.pi * np.arange(texels + 1) / texels) / (2 * np.pi) * texels
    row = 0.5 + 0.4 * np.diff(edges)
    return Texture(np.broadcast_to(row[None, :, None], (8, texels, 3)))


def light_of(surface: Surface, pose: Pose, size: tuple, camera: Intrinsics = CAMERA) -> np.ndarray:
    return render(
        Snapshot([Thing("it", Shape("plane", size), surface, pose)], [Lamp("ambient")]), camera, IDENTITY
    ).light


def test_a_sine_through_perspective_is_where_it_should_be():
    pose, width, periods = Pose.of((0, 50, 0), (0, 0, 4)), 12.0, 10
    light = light_of(Surface(wave(256), repeat=(periods, 1)), pose, (width, 30, 0))[..., 0]
    rays = (np.arange(160) - CAMERA.centre_px[0]) / CAMERA.focal_px[0]
    # the plane: x = s cos 50, z = 4 - s sin 50; the ray: x = r z
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))

    def place(r: np.ndarray) -> np.ndarray:
        return 4 * r / (c + r * s)

    inside = np.abs(place(rays)) < width / 2 - 0.5
    fine = rays[:, None] + ((np.arange(64) + 0.5) / 64 - 0.5) / CAMERA.focal_px[0]
    true = (0.5 + 0.4 * np.sin(2 * np.pi * periods * (place(fine) / width + 0.5))).mean(axis=1)
    step = np.abs(np.gradient(place(rays))) * periods / width  # periods for each pixel
    clear = inside & (step < 0.1)
    assert clear.sum() > 60
    np.testing.assert_allclose(light[60, clear], true[clear], atol=0.03)


def test_far_pictures_fade_to_their_mean():
    checks = Texture(np.indices((64, 64)).sum(axis=0)[..., None] % 2 * np.ones(3))
    light = light_of(Surface(checks, repeat=(40, 40)), Pose.of((0, 0, 0), (0, 0, 20)), (60, 60, 0))
    np.testing.assert_allclose(light, 0.5, atol=1e-5)


def test_nothing_is_finer_than_pixels_on_a_floor_to_the_horizon():
    # Black and white stripes: where several fit into a pixel their mean is seen, whatever the angle; energy is kept.
    stripes = Texture(np.repeat([0.0, 1.0], 32)[None, :, None] * np.ones((64, 1, 3)))
    for turn in (0, 35, 90):
        pose = Pose.of((90, 0, 0), (0, 1, 0)) @ Pose.of((0, 0, turn))
        light = light_of(Surface(stripes, repeat=(400, 400)), pose, (200, 200, 0))[..., 0]
        # rows just below the horizon, at which a pixel holds many stripes both ways
        np.testing.assert_allclose(light[62:65].mean(), 0.5, atol=0.02)
        assert light[62:64].std() < 0.05
        assert light[110:].std() > 0.15  # and near the camera they are seen


def test_small_motions_make_small_changes_of_a_fine_picture():
    noise = Texture(np.random.default_rng(3).random((256, 256, 3)))
    frames = []
    for k in range(40):
        pose = Pose.of((80, 0, 20 + 0.01 * k), (0, 1, 3))
        frames.append(light_of(Surface(noise, repeat=(4, 4)), pose, (10, 10, 0), Intrinsics.of_field((80, 60), 60)))
    values = np.array(frames)
    assert np.abs(np.diff(values, axis=0)).max() < 0.1
    assert np.abs(np.diff(values, n=2, axis=0)).max() < 0.06


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 3), (64, 64), (37, 53)])
def test_levels_of_any_size_keep_the_mean(shape):
    texture = Texture(np.random.default_rng(1).random((*shape, 3)))
    pixels, sizes = texture.levels
    for first, width, height in sizes:
        level = pixels[first : first + width * height]
        np.testing.assert_allclose(level.mean(axis=0), texture.pixels.mean(axis=(0, 1)), atol=1e-5)
    assert tuple(sizes[-1][1:]) == (1, 1)
