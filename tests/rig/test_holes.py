"""Holes are filled from one surface: inverse depths up to 1.05 times as large."""

from __future__ import annotations

import numpy as np
import pytest

from vid2ev.rig.holes import apply_fill, fill_of

HOLE, FAR, NEAR = 0.0, 0.2, 0.9  # light
surfaces = pytest.mark.parametrize(("inverse", "one"), [(1.04, True), (1.06, False), (2.0, False)])


def filled(inverse: list[list[float]], light: list[list[float]], inset: int = 0, smoothings: int = 0) -> np.ndarray:
    picture = np.float32(light)[..., None]
    apply_fill(fill_of(np.float32(inverse), inset), picture, smoothings)
    return picture[..., 0]


@surfaces
def test_only_the_farthest_surface_around_a_hole_counts(inverse: float, one: bool) -> None:
    found = filled([[1.0, -1, inverse]], [[FAR, HOLE, NEAR]])[0, 1]
    assert found == pytest.approx((FAR + NEAR) / 2 if one else FAR)


@surfaces
def test_beyond_the_rim_is_looked_at_on_the_same_surface(inverse: float, one: bool) -> None:
    found = filled([[inverse, 1.0, -1]], [[NEAR, FAR, HOLE]], inset=1)[0, 2]
    assert found == pytest.approx(NEAR if one else FAR)


@surfaces
def test_surfaces_are_smoothed_apart(inverse: float, one: bool) -> None:
    found = filled([[1.0, -1], [inverse, -1]], [[FAR, HOLE], [NEAR, HOLE]], smoothings=1)[:, 1]
    assert found == pytest.approx([(FAR + NEAR) / 2] * 2 if one else [FAR, NEAR])


def test_slivers_beside_a_surface_count_for_little() -> None:
    found = filled([[1.0, 0.1, -1, 0.1, 0.1, 0.1]], [[5, 9, HOLE, 1, 1, 1]], inset=1)
    assert found[0, 2] == pytest.approx((0.02 * 9 + 1) / 1.02)  # (9 is between the near surface and the hole)


@pytest.mark.parametrize("turns", range(4))
def test_what_fills_a_hole_comes_from_beyond_its_rim_on_every_side(turns: int) -> None:
    inverse, light = (np.rot90([row], turns).tolist() for row in ([1.0, 1.0, -1], [FAR, NEAR, HOLE]))
    assert np.rot90(filled(inverse, light, inset=1), -turns)[0, 2] == pytest.approx(FAR)


def test_rims_count_by_the_square_of_how_near_they_are() -> None:
    found = filled([[1, -1, -1, 1]], [[0.2, HOLE, HOLE, 0.8]])
    assert found[0, 1] == pytest.approx((0.2 + 0.8 / 4) / (1 + 1 / 4))
