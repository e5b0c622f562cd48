"""Poses: where a camera or an object is, and how it is turned.

    X_parent = R X_child + t

Coordinates of a camera are those of OpenCV: x to the right, y down, z forwards.  A turn is written as a rotation
vector: its direction is the axis, its length the angle (right-handed).

Source: rotation vectors and quaternions as in B. Siciliano, O. Khatib (eds.), "Springer Handbook of Robotics",
section 1.2; slerp, K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion from child to parent coordinates: `rotation` [3, 3] float64, `translation_m` [3] float64, m."""

    rotation: np.ndarray
    translation_m: np.ndarray

    @classmethod
    def of(cls, rotation_deg: Sequence[float] = (0, 0, 0), translation_m: Sequence[float] = (0, 0, 0)) -> Self:
        """The pose of a rotation vector [deg] and a translation [m]."""
        return cls(rotation_of(np.radians(rotation_deg)), np.array(translation_m, np.float64))

    def __matmul__(self, other: Pose) -> Pose:
        """This pose after the other: (self @ other).apply(x) == self.apply(other.apply(x))."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.translation_m + self.translation_m)

    def inverse(self) -> Pose:
        """From parent to child coordinates."""
        return Pose(self.rotation.T.copy(), -self.rotation.T @ self.translation_m)

    def apply(self, points_m: np.ndarray) -> np.ndarray:
        """Points [..., 3] of the child, in coordinates of the parent."""
        return points_m @ self.rotation.T + self.translation_m

    def quaternion(self) -> np.ndarray:
        """The rotation as a unit quaternion x, y, z, w with w >= 0."""
        angle, axis = angle_axis(self.rotation)
        return np.array([*np.sin(angle / 2) * axis, math.cos(angle / 2)])

    def between(self, other: Pose, share: float) -> Pose:
        """The pose after `share` of the shortest way to the other: an even turn, and a straight line."""
        angle, axis = angle_axis(self.rotation.T @ other.rotation)
        way = other.translation_m - self.translation_m
        return Pose(self.rotation @ rotation_of(share * angle * axis), self.translation_m + share * way)


def rotation_of(vector_rad: np.ndarray) -> np.ndarray:
    """The rotation matrix of a rotation vector [3, rad] (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector_rad))
    cross = cross_matrix(np.asarray(vector_rad, np.float64))
    # sinc(x) = sin(pi x) / (pi x), without a division by nothing
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * cross @ cross


def angle_axis(rotation: np.ndarray) -> tuple[float, np.ndarray]:
    """The angle [rad, 0 ... pi] and the unit axis [3] of a rotation matrix."""
    turned = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    angle = math.atan2(float(np.linalg.norm(turned)), float(np.trace(rotation)) - 1)
    if np.linalg.norm(turned) > (1e-6 if angle > 1 else 1e-200):
        return angle, turned / np.linalg.norm(turned)
    # (no turn, or nearly half of one: R + R' = 2 cos + 2 (1 - cos) a a' has the axis as its largest column)
    columns = rotation + rotation.T + (1 - np.trace(rotation)) * np.eye(3)
    axis = columns[:, np.argmax(np.linalg.norm(columns, axis=0))]
    length = np.linalg.norm(axis)
    axis = axis / length if length > 1e-6 else np.array([0.0, 0.0, 1.0])
    return angle, axis if axis @ turned >= 0 else -axis


def rotation_vector_deg(rotation: np.ndarray) -> np.ndarray:
    """The rotation vector [3, deg] of a rotation matrix."""
    angle, axis = angle_axis(rotation)
    return np.degrees(angle) * axis


def cross_matrix(vector: np.ndarray) -> np.ndarray:
    """The matrix [3, 3] with which cross_matrix(a) @ b is the cross product of a and b."""
    x, y, z = vector
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], np.float64)


IDENTITY = Pose.of()
