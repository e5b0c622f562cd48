"""Poses compose, invert and turn as rigid motions do."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vid2ev.rig.pose import Pose, rotation_of, rotation_vector_deg

component = st.floats(-200, 200)
vectors = st.tuples(component, component, component)


@given(vectors, vectors, vectors, vectors, vectors)
def test_poses_compose_and_invert(turn, way, other_turn, other_way, point):  # type: ignore[no-untyped-def]
    a, b = Pose.of(turn, way), Pose.of(other_turn, other_way)
    np.testing.assert_allclose((a @ b).apply(np.array(point)), a.apply(b.apply(np.array(point))), atol=1e-9)
    np.testing.assert_allclose(a.inverse().apply(a.apply(np.array(point))), point, atol=1e-9)


@pytest.mark.parametrize(
    "angle", [0, 1e-200, 1e-12, 1e-9, 1e-7, 1e-5, 0.1, 1, 3, np.pi - 1e-9, np.pi - 1e-7, np.pi - 1e-5, np.pi]
)
def test_turns_are_those_of_opencv(angle: float) -> None:
    for seed in range(20):
        axis = np.random.default_rng(seed).normal(size=3)
        vector = angle * axis / np.linalg.norm(axis)
        turn = rotation_of(vector)
        np.testing.assert_allclose(turn, cv2.Rodrigues(vector)[0], atol=1e-12)
        np.testing.assert_allclose(rotation_of(np.radians(rotation_vector_deg(turn))), turn, atol=1e-9)
        if angle < 3:
            np.testing.assert_allclose(np.radians(rotation_vector_deg(turn)), vector, rtol=1e-9, atol=1e-15)


def test_half_of_a_way_is_half_of_the_turn_and_half_of_the_line() -> None:
    start, end = Pose.of((0, 10, 0), (0, 0, 1)), Pose.of((0, 70, 0), (2, 0, 1))
    middle = start.between(end, 0.5)
    np.testing.assert_allclose(rotation_vector_deg(middle.rotation), (0, 40, 0), atol=1e-9)
    np.testing.assert_allclose(middle.translation_m, (1, 0, 1))
    np.testing.assert_allclose(start.between(end, 0.25).translation_m, (0.5, 0, 1))
    np.testing.assert_allclose(start.between(end, 1).rotation, end.rotation, atol=1e-12)


@given(vectors)
def test_a_quaternion_turns_as_its_matrix_does(turn) -> None:  # type: ignore[no-untyped-def]
    pose = Pose.of(turn)
    x, y, z, w = pose.quaternion()
    vector = np.array([x, y, z])
    point = np.array([0.3, -1, 2])
    turned = point + 2 * np.cross(vector, np.cross(vector, point) + w * point)  # (v + 2 q x (q x v + w v))
    np.testing.assert_allclose(turned, pose.apply(point), atol=1e-9)
    assert w >= 0 and abs(x * x + y * y + z * z + w * w - 1) < 1e-12
