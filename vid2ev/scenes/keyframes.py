"""Keyframes: a motion through given poses at given times.

    spline   a natural cubic spline through the positions and the unit quaternions q_k, these made of length 1 again:
             position, turn, both speeds and both accelerations are continuous (C2)
    linear   straight lines, and turns at an even rate between them

The sign of each q_k is that of the shorter way from the one before.  A natural spline has no curvature at its ends, so
that it goes on beyond them with the speed it has there, and without a kink; `linear` stands still there.  Between
two keyframes there should be less than 120 degrees; with more, a turn is uneven, and always the shorter one.

Sources: C. de Boor, "A practical guide to splines", chapter IV; quaternions that are blended and made of length 1
again, as in K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from vid2ev.rig.pose import Pose
from vid2ev.scenes.part import Part, Point, Seconds, Turn


class Keyframes(Part):
    """A motion through poses at given times."""

    kind: Literal["keyframes"]
    times_s: Annotated[tuple[Seconds, ...], Field(min_length=2, description="increasing [s]")]
    positions_m: tuple[Point, ...] = Field(default=(), description="as many as times; none: it stays at the origin [m]")
    rotations_deg: tuple[Turn, ...] = Field(default=(), description="as many as times; none: it is not turned [deg]")
    path: Literal["spline", "linear"] = Field(default="spline", description="smooth, or straight from one to the next")

    @model_validator(mode="after")
    def _fits(self) -> Keyframes:
        if any(later - earlier < 1e-6 for earlier, later in pairwise(self.times_s)):
            raise ValueError(f"times_s = {list(self.times_s)} must increase, by a microsecond or more")
        for key, values in (("positions_m", self.positions_m), ("rotations_deg", self.rotations_deg)):
            if values and len(values) != len(self.times_s):
                raise ValueError(f"{key} has {len(values)} entries for {len(self.times_s)} times_s; give one for each")
        return self

    @cached_property
    def _poses(self) -> list[Pose]:
        nowhere = ((0.0, 0.0, 0.0),) * len(self.times_s)
        turns, places = self.rotations_deg or nowhere, self.positions_m or nowhere
        return [Pose.of(turn, place) for turn, place in zip(turns, places, strict=True)]

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        knots = [np.concatenate([pose.translation_m, pose.quaternion()]) for pose in self._poses]
        for before, knot in pairwise(knots):
            knot[3:] *= 1.0 if before[3:] @ knot[3:] >= 0 else -1.0
        return CubicSpline(self.times_s, np.array(knots), bc_type="natural")

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        return pose @ (self._smooth(t_s) if self.path == "spline" else self._straight(t_s))

    def _smooth(self, t_s: float) -> Pose:
        inside = min(max(t_s, self.times_s[0]), self.times_s[-1])
        value = self._spline(inside)
        if t_s != inside:
            value = value + (t_s - inside) * self._spline(inside, 1)
        return Pose(_rotation(value[3:]), value[:3])

    def _straight(self, t_s: float) -> Pose:
        k = int(np.clip(np.searchsorted(self.times_s, t_s, side="right") - 1, 0, len(self.times_s) - 2))
        begin, end = self.times_s[k], self.times_s[k + 1]
        return self._poses[k].between(self._poses[k + 1], min(max((t_s - begin) / (end - begin), 0.0), 1.0))


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    """The rotation of a quaternion x, y, z, w of any length but 0."""
    length = float(np.linalg.norm(quaternion))
    if length < 1e-9:  # (between opposite turns there may be no way that is shorter)
        return np.eye(3)
    x, y, z, w = (float(part) for part in quaternion / length)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
