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

from vid2ev.physics.adc import lsb_per_light
from vid2ev.physics.electrons import near_full_well
from vid2ev.physics.fixed_pattern import greatest_gain
from vid2ev.physics.shading import shading_map
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.stream.exposed import Change, Exposed
from vid2ev.stream.frames import Frame

WITHOUT: dict[str, dict[str, Any]] = {"exposure": {"blur": False}, "rolling_shutter": {"line_us": 0.0}}


class Expose:
    """What a frame camera of `size` (width, height) sees: `see` each frame of light, then ask for `exposed`."""

    def __init__(self, spec: CisSpec, size: tuple[int, int]):
        self.spec, self._window_s = spec, spec.exposure_us * 1e-6
        used = spec.effects()
        plain = spec.noiseless().model_copy(update={"shading": (), "full_well_e": 0.0})
        ways = {"": plain} | {name: plain.model_copy(update=WITHOUT[name]) for name in WITHOUT if name in used}
        self._cameras = {name: Cis(way, size, linear=True) for name, way in ways.items()}
        self._waiting: dict[str, deque[np.ndarray]] = {name: deque() for name in ways}
        shade = shading_map(spec.shading, *size).astype(np.float64) if spec.shading else np.ones((1, 1))
        self._shade = shade[..., None] if spec.colour else shade
        self._rows = size[1]
        self._values = size[0] * size[1] * (3 if spec.colour else 1)
        others = {"shading": "shading" in used, "full_well": "full_well" in used, "clip": True}
        self._changes = dict.fromkeys([*WITHOUT, *(name for name in others if others[name])], Change(near=0.0))
        self._exposures = self._frames = 0
        self._sum = self._square = self._most = 0.0
        self._least = math.inf
        self._ends_ns: list[int] = []  # the first frame, and the last

    def see(self, frame: Frame) -> None:
        """The next frame of light; raises UsageError as `Cis.step` does."""
        for name, camera in self._cameras.items():
            for made in camera.exposures(frame):
                assert made.light is not None
                self._waiting[name].append(made.light)
        self._frames, self._ends_ns = self._frames + 1, [*self._ends_ns[:1], frame.t_ns]
        while all(self._waiting.values()):
            self._note({name: waiting.popleft().astype(np.float64) for name, waiting in self._waiting.items()})

    def exposed(self, speed_px_per_s: float | None = None) -> Exposed:
        """What was seen so far; the speed of what moves in the source, where that is known."""
        draws = max(self._exposures * self._values, 1)
        seconds = (self._ends_ns[-1] - self._ends_ns[0]) * 1e-9 if self._frames else 0.0
        return Exposed(
            values=self._values,
            rows=self._rows,
            exposures=self._exposures,
            frames=self._frames,
            frames_each=self._frames * self._window_s / seconds if seconds else 1.0,
            light_min=self._least if self._exposures else 0.0,
            light_max=self._most,
            light_mean=self._sum / draws,
            light_square=self._square / draws,
            changes={
                name: Change(each.most, each.square / draws, each.near / draws) for name, each in self._changes.items()
            },
            speed_px_per_s=speed_px_per_s,
        )

    def _note(self, lights: dict[str, np.ndarray]) -> None:
        """The next exposure, by what it is without; squares are summed up."""
        whole = lights[""]
        light = whole * self._shade
        self._exposures += 1
        self._sum, self._square = self._sum + float(light.sum()), self._square + float(np.vdot(light, light))
        self._least, self._most = min(self._least, float(light.min())), max(self._most, float(light.max()))
        for name, without in lights.items():
            if name:  # (a bound without the shading, too)
                self._add(name, (whole - without) * np.maximum(self._shade, 1.0))
        if "shading" in self._changes:
            self._add("shading", light - whole)
        self._add("clip", light - np.clip(light, *self._range()))
        if "full_well" in self._changes:
            held = self.spec.full_well_e / (self.spec.white_e * self.spec.exposure_gain)
            near = int(np.count_nonzero(light >= near_full_well(self.spec)))
            self._add("full_well", np.maximum(light * greatest_gain(self.spec) - held, 0.0), near)

    def _add(self, name: str, change: np.ndarray, near: int | None = None) -> None:
        before = self._changes[name]
        most = max(before.most, float(change.max()), -float(change.min()))
        square = before.square + float(np.vdot(change, change))
        self._changes[name] = Change(most, square, before.near + (change.size if near is None else near))

    def _range(self) -> tuple[float, float]:
        """The light of the first code and of the last."""
        black = self.spec.min_illuminance / self.spec.slope
        return black / lsb_per_light(self.spec), (black + self.spec.top) / lsb_per_light(self.spec)
