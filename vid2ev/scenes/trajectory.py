"""Trajectories: where things are at any instant.

A trajectory is a motion, or a list of motions, each in the coordinates of those before it:

    pose(t) = motion_1(t) motion_2(t) ... motion_n(t)

    fixed      a place and a turn
    straight   position + velocity (t - at), and a turn
    spin       a turn about an axis by phase + rate t
    orbit      a circle about a centre; what goes round is not turned
    keyframes  through poses at given times
    shake      the tremor of a hand
    look-at    turns, in place of all turns before it, so that z points to a target

Lengths are metres, turns are rotation vectors in degrees, t is in seconds from the beginning of the scene.  The axes of
the world are those of a camera that is not turned: x to the right, y down, z forwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from vid2ev.rig.pose import Pose, rotation_of
from vid2ev.scenes.keyframes import Keyframes
from vid2ev.scenes.part import Degrees, Direction, Part, Point, Seconds, Turn
from vid2ev.scenes.shake import Shake

__all__ = ["Fixed", "Keyframes", "LookAt", "Orbit", "Shake", "Spin", "Straight", "Trajectory", "pose_of"]


class Fixed(Part):
    """A place and a turn."""

    kind: Literal["fixed"]
    position_m: Point = Field(default=(0.0, 0.0, 0.0), description="where [m]")
    rotation_deg: Turn = Field(default=(0.0, 0.0, 0.0), description="how it is turned: a rotation vector [deg]")

    @cached_property
    def _pose(self) -> Pose:
        return Pose.of(self.rotation_deg, self.position_m)

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        return pose @ self._pose


class Straight(Part):
    """A straight line at an even speed."""

    kind: Literal["straight"]
    position_m: Point = Field(default=(0.0, 0.0, 0.0), description="where it is at at_s [m]")
    velocity_m_s: Point = Field(description="how fast, and whither [m/s]")
    at_s: Seconds = Field(default=0.0, description="when it is at position_m [s]")
    rotation_deg: Turn = Field(default=(0.0, 0.0, 0.0), description="how it is turned: a rotation vector [deg]")

    @cached_property
    def _rotation(self) -> np.ndarray:
        return rotation_of(np.radians(self.rotation_deg))

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        place = np.array(self.position_m) + np.array(self.velocity_m_s) * (t_s - self.at_s)
        return pose @ Pose(self._rotation, place)


class _Turning(Part):
    """What goes round an axis."""

    axis: Direction = Field(default=(0.0, 0.0, 1.0), description="the axis; seen along it, turns are clockwise")
    phase_deg: Degrees = Field(default=0.0, description="the angle at time 0 [deg]")

    @model_validator(mode="after")
    def _has_axis(self) -> _Turning:
        if not 1e-9 < math.hypot(*self.axis) < 1e9:
            raise ValueError(f"axis {list(self.axis)} has no direction; give one such as [0, 1, 0]")
        return self

    @cached_property
    def _along(self) -> np.ndarray:
        return np.array(self.axis) / math.hypot(*self.axis)


class Spin(_Turning):
    """A turn at an even rate."""

    kind: Literal["spin"]
    rate_deg_s: Degrees = Field(description="how fast [deg/s]")

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        angle = math.radians(math.fmod(self.phase_deg + self.rate_deg_s * t_s, 360.0))
        return pose @ Pose(rotation_of(angle * self._along), np.zeros(3))


class Orbit(_Turning):
    """A circle, at an even speed; what goes round keeps its turn."""

    kind: Literal["orbit"]
    centre_m: Point = Field(default=(0.0, 0.0, 0.0), description="the centre [m]")
    radius_m: float = Field(ge=0, le=1e5, description="the radius [m]")
    period_s: float = Field(ge=1e-3, le=1e6, description="the time of one round [s]")

    @cached_property
    def _sides(self) -> tuple[np.ndarray, np.ndarray]:
        # (the side at angle 0 is the axis of the world that is farthest from the orbit's own, made square to it)
        away = np.eye(3)[int(np.argmin(np.abs(self._along)))]
        first = away - (away @ self._along) * self._along
        first /= np.linalg.norm(first)
        return first, np.cross(self._along, first)

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        angle = 2 * math.pi * math.fmod(t_s / self.period_s + self.phase_deg / 360, 1.0)
        first, second = self._sides
        round_ = self.radius_m * (math.cos(angle) * first + math.sin(angle) * second)
        return pose @ Pose(np.eye(3), np.array(self.centre_m) + round_)


class LookAt(Part):
    """Turns so that z points to a target; where that is straight above or below, the turn about z is left open."""

    kind: Literal["look-at"]
    target_m: Point = Field(description="what is looked at, in the world [m]")
    up: Direction = Field(default=(0.0, -1.0, 0.0), description="what is up in the picture")

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        forwards = np.array(self.target_m) - pose.translation_m
        if (distance := np.linalg.norm(forwards)) < 1e-9:
            return pose
        forwards /= distance
        right = np.cross(forwards, self.up)
        if np.linalg.norm(right) < 1e-6 * max(math.hypot(*self.up), 1e-9):
            right = np.cross(forwards, np.eye(3)[int(np.argmin(np.abs(forwards)))])
        right /= np.linalg.norm(right)
        return Pose(np.stack([right, np.cross(forwards, right), forwards], axis=1), pose.translation_m)


Motion = Annotated[
    Fixed | Straight | Spin | Orbit | Keyframes | Shake | LookAt,
    Field(discriminator="kind"),
]


def _listed(value: object) -> object:
    return (value,) if isinstance(value, dict) else value


Trajectory = Annotated[tuple[Motion, ...], BeforeValidator(_listed)]


def pose_of(trajectory: Sequence[Motion], t_s: float) -> Pose:
    """Where a trajectory is at an instant [s]."""
    pose = Pose(np.eye(3), np.zeros(3))
    for motion in trajectory:
        pose = motion.after(pose, t_s)
    return pose
