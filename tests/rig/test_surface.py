"""A surface of depth that is cut: each corner of a quad keeps a quarter of it, and those of one surface meet."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.rig.bands import Bands
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.rig.surface import _patches_of, corners_of, seen_of, surface_of
from vid2ev.rig.triangles import draw_patches

SOURCE = Intrinsics.of_field((24, 16), 60)


@pytest.fixture(scope="module")
def quarters() -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """The inverse depths [n, 4] of the corners of quads that are cut, whether each is on one surface with the next, and
    the patches: columns, rows, inverse depths [n, 4, 4 (corner, half-way to the next, middle, half-way back)]."""
    rng = np.random.default_rng(5)
    slopes = 1 + 0.02 * rng.random((16, 24))
    inverse = slopes * rng.choice([1.0, 1.8, 3.0, 9.0], (16, 24))  # (1 and 1.8 are joined, and 1.8 and 3; no others)
    surface = surface_of(inverse, corners_of(SOURCE), SOURCE)
    quads = np.argwhere(surface.cut)
    j, i = quads.T
    depth = np.stack([surface.inverse[j + down, i + right] for down, right in ((0, 0), (0, 1), (1, 1), (1, 0))], 1)
    after = np.roll(depth, -1, axis=1)
    patches = _patches_of(surface, quads)
    each = [values.reshape(-1, 4, 4) for values in (patches.columns, patches.rows, patches.inverse)]
    return depth, np.abs(depth - after) <= surface.steep * np.maximum(depth, after), each


def test_quarters_are_of_all_kinds(quarters: tuple[np.ndarray, np.ndarray, list[np.ndarray]]) -> None:
    _, joined, _ = quarters
    assert len(joined) > 100 and set(joined.sum(axis=1).tolist()) == {0, 1, 2, 3, 4}


def test_quarters_of_one_surface_meet_and_those_of_others_keep_their_depth(
    quarters: tuple[np.ndarray, np.ndarray, list[np.ndarray]],
) -> None:
    depth, joined, (columns, rows, inverse) = quarters
    for values in (columns, rows):  # (in the source all four share the middle, and two the way between their corners)
        assert np.ptp(values[:, :, 2], axis=1).max() == 0
        assert np.array_equal(values[:, :, 1], np.roll(values[:, :, 3], -1, axis=1))
    following = np.roll(inverse, -1, axis=1)
    assert np.array_equal(inverse[:, :, 0], depth)
    assert np.array_equal(inverse[:, :, 1][joined], following[:, :, 3][joined])
    np.testing.assert_allclose(inverse[:, :, 2][joined], following[:, :, 2][joined], rtol=1e-6)
    assert np.array_equal(inverse[:, :, 1][~joined], depth[~joined])
    assert np.array_equal(following[:, :, 3][~joined], np.roll(depth, -1, axis=1)[~joined])


def test_the_middle_is_the_mean_of_what_is_on_one_surface(
    quarters: tuple[np.ndarray, np.ndarray, list[np.ndarray]],
) -> None:
    depth, joined, (_, _, inverse) = quarters
    for corners, ways, middles in zip(depth, joined, inverse[:, :, 2], strict=True):
        for k in range(4):
            reached = {k}
            for _ in range(3):
                reached |= {(at + 1) % 4 for at in reached if ways[at]} | {
                    at for at in range(4) if ways[at] and (at + 1) % 4 in reached
                }
            assert middles[k] == pytest.approx(corners[sorted(reached)].mean(), rel=1e-6)


@pytest.mark.parametrize("across", [True, False])
def test_a_cut_is_near_to_the_two_pixels_on_either_side(across: bool) -> None:
    """Sampling looks two pixels away from the nearest one, from side to side and up and down."""
    inverse = np.ones((20, 20), np.float32)
    inverse[:, 12:] = 0.1
    camera = Intrinsics.of_field((20, 20), 60)
    found = surface_of(inverse if across else inverse.T.copy(), corners_of(camera), camera).near_cut
    expected = np.zeros((20, 20), np.bool_)
    expected[:, 10:14] = True
    np.testing.assert_array_equal(found if across else found.T, expected)


@pytest.mark.parametrize("turn_deg", range(0, 360, 15))
def test_where_a_lens_ends_rows_are_the_same_whatever_bands_they_are_drawn_in(turn_deg: int) -> None:
    """A quad with a corner that the lens does not see may have a triangle that it does."""
    source = Intrinsics.of_field((24, 16), 100)
    surface = surface_of(np.full((16, 24), 0.5, np.float32), corners_of(source), source)
    camera = Intrinsics(
        size=(40, 40), focal_px=(25.0, 25.0), centre_px=(19.5, 19.5), model="radtan", distortion=(-0.35, 0.02, 0, 0)
    )
    pose = Pose.of((0, 0, turn_deg), (0.05, 0, 0))
    for one, other in zip(*(seen_of(surface, camera, pose, Bands(count)) for count in (1, 40)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_what_is_seen_from_its_edge_is_where_its_corners_are() -> None:
    """Its triangles have no area but for rounding; what is drawn of them lies between their corners all the same."""
    rng, f32 = np.random.default_rng(3), np.float32
    for _ in range(40):
        x, y, inverse = (np.full((8, 8), value, f32) for value in (1, 1, -1))
        start, way = rng.integers(0, 8, (2, 1000, 1)), rng.normal(size=(2, 1000, 1)) * 10.0 ** rng.uniform(-2, 4)
        u, v = (start + rng.choice([0, 1, -1, 0.3, 0.7, 3, 2 / 7], (1000, 4)) * way).astype(f32)
        q, depth = (10.0 ** rng.uniform(-3, 6, (1000, 4))).astype(f32), rng.uniform(1, 2, (1000, 4)).astype(f32)
        columns, rows = rng.uniform(1, 2, (2, 1000, 4)).astype(f32)
        draw_patches(0, 8, u, v, q, depth, columns, rows, x, y, inverse)
        for values in (x, y, inverse[inverse >= 0]):
            assert (values > 1 - 1e-6).all() and (values < 2 + 1e-6).all()
