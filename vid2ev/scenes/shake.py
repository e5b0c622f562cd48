"""Shake: the tremor of a hand that holds a camera, smooth and without an end.

Each of the three axes of place and of turn follows a sum of N = 16 sines

    x(t) = rms sqrt(2 / N) sum_n sin(2 pi (f_n t + phase_n)),    f_n = low (high / low)**((n + u_n) / N)

with phases and u_n even in [0, 1), drawn from `seed`: the root mean square over time is `rms`, and nothing lies outside
the band.  Small turns about the three axes are one rotation vector.

Source: hand tremor of a held camera has most of its power from 1 to 10 Hz, F. Xiao et al., "Camera-motion and
effective spatial resolution", ICIS 2006; the sum of sines is S. O. Rice's, "Mathematical analysis of random noise",
1944.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from vid2ev.rig.pose import Pose, rotation_of
from vid2ev.scenes.part import Part
from vid2ev.scenes.ranges import chance_of

SINES = 16


class Shake(Part):
    """The tremor of a hand."""

    kind: Literal["shake"]
    rms_mm: float = Field(default=1.0, ge=0, le=1e5, description="root mean square of each axis of the place [mm]")
    rms_deg: float = Field(default=0.2, ge=0, le=90, description="root mean square of each axis of the turn [deg]")
    low_hz: float = Field(default=1.0, ge=1e-3, le=1e4, description="the slowest of it [Hz]")
    high_hz: float = Field(default=10.0, ge=1e-3, le=1e4, description="the fastest of it [Hz]")
    seed: int = Field(default=0, ge=0, lt=1 << 63, description="which of all such tremors")

    @model_validator(mode="after")
    def _fits(self) -> Shake:
        if self.low_hz > self.high_hz:
            raise ValueError(f"low_hz = {self.low_hz:g} is above high_hz = {self.high_hz:g}")
        return self

    @cached_property
    def _sines(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [Hz] and phases [6, SINES]."""
        chance = chance_of(self.seed)
        draws = np.array([[[chance(f"{what}.{a}.{n}") for n in range(SINES)] for a in range(6)] for what in ("f", "p")])
        shares = (np.arange(SINES) + draws[0]) / SINES
        return self.low_hz * (self.high_hz / self.low_hz) ** shares, draws[1]

    def after(self, pose: Pose, t_s: float) -> Pose:
        """The pose at t, given that of the motions before."""
        frequencies, phases = self._sines
        swings = np.sqrt(2 / SINES) * np.sin(2 * np.pi * (frequencies * t_s + phases)).sum(axis=1)
        return pose @ Pose(rotation_of(np.radians(self.rms_deg) * swings[3:]), 1e-3 * self.rms_mm * swings[:3])
