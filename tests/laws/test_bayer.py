"""Colour filters: each pixel sees its primary, and where there is no colour they change nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vid2ev import UsageError, events_of
from vid2ev.physics.bayer import PATTERNS, mosaic
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.upsample import make_upsampler

F = np.float32


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (5, 7), (6, 4)])
def test_each_pixel_sees_its_primary(pattern: str, shape: tuple[int, int]) -> None:
    rgb = np.random.default_rng(0).uniform(-0.2, 2, (*shape, 3)).astype(F)
    seen = mosaic(rgb, pattern)
    for y, x in np.ndindex(shape):
        channel = "RGB".index(pattern[2 * (y % 2) + x % 2])
        assert seen[y, x] == max(rgb[y, x, channel], 0)


def test_another_pattern_is_refused() -> None:
    with pytest.raises(UsageError, match="RGGB"):
        mosaic(np.zeros((2, 2, 3), F), "RGBW")
    with pytest.raises(UsageError, match="RGGB"):
        next(events_of("synthetic:moving-edge,size=8x8", bayer="RRGB"))


def stack(folder: Path, colours: tuple[float, float, float]) -> Path:
    """Six frames of a texture that moves by 2 px each, in a colour."""
    texture = np.random.default_rng(3).uniform(0.1, 1, (48, 96)).astype(F)
    texture = (texture + np.roll(texture, 1, 1) + np.roll(texture, 1, 0)) / 3
    frames = np.stack([np.roll(texture, 2 * k, 1)[:, 16:80] for k in range(6)])
    np.save(folder / "clip.npy", frames[..., None] * np.array(colours, F))
    return folder / "clip.npy"


def events(path: Path, bayer: str | None, upsample: str) -> Events:
    options = {"fps": 100.0, "upsample": upsample, "bayer": bayer} | ({"subframes": 4} if upsample != "none" else {})
    return Events.concatenate(events_of(path, "ideal", **options))


@pytest.mark.parametrize("upsample", ["none", "linear", "flow"])
def test_gray_scenes_look_the_same_through_filters(tmp_path: Path, upsample: str) -> None:
    path = stack(tmp_path, (1, 1, 1))
    one, other = events(path, None, upsample), events(path, "GRBG", upsample)
    assert len(one) > 1000 and abs(len(one) - len(other)) < 0.001 * len(one)


def test_a_red_scene_is_seen_by_red_pixels_alone(tmp_path: Path) -> None:
    seen = events(stack(tmp_path, (1, 0, 0)), "RGGB", "flow")
    assert len(seen) > 100 and not np.any(seen.x % 2) and not np.any(seen.y % 2)


def test_motion_carries_each_channel_as_it_would_alone() -> None:
    rng = np.random.default_rng(0)
    texture = rng.uniform(0.1, 1, (60, 90)).astype(F)
    before, after = (np.repeat(np.roll(texture, k, 1)[..., None], 3, 2) for k in (0, 3))
    rgb = [frame.light for frame in make_upsampler("flow", 4).between(Frame(before, 0), Frame(after, 10**7))]
    gray = [frame.light for frame in make_upsampler("flow", 4).between(
        Frame(np.ascontiguousarray(before[..., 0]), 0), Frame(np.ascontiguousarray(after[..., 0]), 10**7)
    )]  # fmt: skip
    for coloured, plain in zip(rgb, gray, strict=True):
        assert coloured.shape == (60, 90, 3)
        np.testing.assert_allclose(coloured[..., 1], plain, atol=1e-3)
