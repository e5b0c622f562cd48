"""`Expose`: what a frame camera sees of a clip, one frame at a time.

The exposures themselves are what is measured: those of the same camera without noise, without blur, and with all rows
open together, side by side.  So what the shutter and the lens change is known of every value, and what noise can change
follows from the light that there is.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from vid2ev.bounds.exposed import Change, Exposed
from vid2ev.physics.adc import lsb_per_light
from vid2ev.physics.electrons import always_clipped, near_full_well
from vid2ev.physics.fixed_pattern import greatest_gain
from vid2ev.physics.shading import shading_map
from vid2ev.plan.exposure_sums import (
    CLIPPED,
    LEAST,
    LIT_MOST,
    LIT_SQUARE,
    LIT_SUM,
    MOST,
    NEAR,
    OVERFULL,
    SHADED,
    SUM,
    SUMS,
    add_change,
    add_light,
)
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.stream.frames import Frame

WITHOUT: dict[str, dict[str, Any]] = {"exposure": {"blur": False}, "rolling_shutter": {"line_us": 0.0}}


class Expose:
    """What a frame camera of `size` (width, height) sees: `see` each frame of light, then ask for `exposed`."""

    def __init__(self, spec: CisSpec, size: tuple[int, int]):
        self.spec, self._window_s = spec, spec.exposure_us * 1e-6
        used, (width, height) = spec.effects(), size
        plain = spec.noiseless().model_copy(update={"shading": (), "full_well_e": 0.0})
        ways = {"": plain} | {name: plain.model_copy(update=WITHOUT[name]) for name in WITHOUT if name in used}
        self._cameras = {name: Cis(way, size, linear=True) for name, way in ways.items()}
        self._waiting: dict[str, deque[np.ndarray]] = {name: deque() for name in ways}
        channels = 3 if spec.colour else 1
        self._rows = (height, width * channels)
        self._shade = np.repeat(shading_map(spec.shading, width, height), channels, axis=1)
        self._ends = always_clipped(spec)
        self._limits = (*self._ends, *_range(spec), greatest_gain(spec), *_well(spec))
        self._sums = np.zeros((SUMS, self._rows[1]))
        self._sums[LEAST] = np.inf
        self._changes = {name: np.zeros((2, self._rows[1])) for name in ways if name}
        self._exposures = self._frames = 0
        self._ends_ns: list[int] = []  # the first frame, and the last

    def see(self, frame: Frame) -> None:
        """The next frame of light; raises UsageError as `Cis.step` does."""
        for name, camera in self._cameras.items():
            for made in camera.exposures(frame):
                assert made.light is not None
                self._waiting[name].append(made.light.reshape(self._rows))
        self._frames, self._ends_ns = self._frames + 1, [*self._ends_ns[:1], frame.t_ns]
        while all(self._waiting.values()):
            lights = {name: waiting.popleft() for name, waiting in self._waiting.items()}
            add_light(lights[""], self._shade, *self._limits, self._sums)
            for name, sums in self._changes.items():
                add_change(lights[""], lights[name], self._shade, *self._ends, sums)
            self._exposures += 1

    def exposed(self, speed_px_per_s: float | None = None) -> Exposed:
        """What was seen so far; the speed of what moves in the source, where that is known."""
        values = self._rows[0] * self._rows[1]
        draws = max(self._exposures * values, 1)
        seconds = (self._ends_ns[-1] - self._ends_ns[0]) * 1e-9 if self._frames else 0.0
        sums, changes = self._sums, {name: _change(each, draws) for name, each in self._changes.items()}
        for name, place in (("shading", SHADED), ("clip", CLIPPED), ("full_well", OVERFULL)):
            changes[name] = _change(sums[place : place + 2], draws)
        near = float(sums[NEAR].sum()) / draws
        return Exposed(
            values=values,
            rows=self._rows[0],
            exposures=self._exposures,
            frames=self._frames,
            frames_each=(self._frames - 1) * self._window_s / seconds if seconds else 1.0,
            light_min=float(sums[LEAST].min()) if self._exposures else 0.0,
            light_max=float(sums[MOST].max()),
            light_mean=float(sums[SUM].sum()) / draws,
            lit_max=float(sums[LIT_MOST].max()),
            lit_mean=float(sums[LIT_SUM].sum()) / draws,
            lit_square=float(sums[LIT_SQUARE].sum()) / draws,
            changes=changes | {"full_well": changes["full_well"]._replace(near=near)},
            speed_px_per_s=speed_px_per_s,
        )


def _change(sums: np.ndarray, draws: int) -> Change:
    return Change(float(sums[0].max()), float(sums[1].sum()) / draws)


def _range(spec: CisSpec) -> tuple[float, float]:
    """The light of the first code and of the last."""
    black = spec.min_illuminance / spec.slope
    return black / lsb_per_light(spec), (black + spec.top) / lsb_per_light(spec)


def _well(spec: CisSpec) -> tuple[float, float]:
    """The light that fills the well of a pixel, and that from which shot noise may fill it."""
    if spec.full_well_e == 0:
        return math.inf, math.inf
    return spec.full_well_e / (spec.white_e * spec.exposure_gain), near_full_well(spec)
