"""The specification of a frame camera: the parameters of every effect, in one flat, frozen, validated record."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from pydantic import Field

from vid2ev.light.transfer import parse_transfer
from vid2ev.physics.adc import Adc
from vid2ev.physics.electrons import Electrons
from vid2ev.physics.fixed_pattern import FixedPattern
from vid2ev.physics.shading import Shading
from vid2ev.physics.shutter import Shutter
from vid2ev.sensors.record import Record

NOISELESS = {"noise_lsb": 0.0, "shot_noise": False, "read_noise_e": 0.0, "prnu": 0.0, "dsnu": 0.0}
EFFECTS: dict[str, Callable[[CisSpec], bool]] = {  # in the order of the path of light: whether a camera has it
    "exposure": lambda spec: spec.exposure_us > 0 and spec.blur,
    "rolling_shutter": lambda spec: spec.line_us > 0,
    "shading": lambda spec: bool(spec.shading),
    "fixed_pattern": lambda spec: spec.prnu > 0 or spec.dsnu > 0,
    "shot_noise": lambda spec: spec.shot_noise,
    "full_well": lambda spec: spec.full_well_e > 0,
    "read_noise": lambda spec: spec.read_noise_e > 0,
    "noise": lambda spec: spec.noise_lsb > 0,
}
INSTANT = {"exposure_us": 0.0, "line_us": 0.0}


class CisSpec(  # the order of the bases, last to first, is the order of the fields: the path of light
    Adc, Electrons, FixedPattern, Shading, Shutter, Record, frozen=True, extra="forbid"
):
    """Parameters of a frame camera; the defaults are the paper's (section IV), where it gives a number.

    Raises `pydantic.ValidationError` for an unknown key or a value outside its limits; `vid2ev.load_cis` turns
    that into one sentence.
    """

    colour: bool = Field(True, description="true: red, green and blue in each pixel; false: luminance")

    @property
    def top(self) -> int:
        """The highest code."""
        return (1 << self.bits) - 1

    def window_us(self, height: int) -> float:
        """From the opening of the first of `height` rows to the closing of the last [us]."""
        return (height - 1) * self.line_us + self.exposure_us

    def in_flight(self, height: int) -> int:
        """How many exposures of `height` rows are open at a time, at most."""
        return 1 + math.floor(self.window_us(height) * 1e-6 * self.frame_rate_hz)

    def noiseless(self) -> CisSpec:
        """The same camera without noise and fixed pattern."""
        return self.model_copy(update=NOISELESS)

    def sampling(self, frame_rate_hz: float, burst: int = 0) -> CisSpec:
        """The same camera without noise, all rows of which see an instant, at a rate: what a network is to rebuild."""
        clock = {"frame_rate_hz": frame_rate_hz, "burst": burst}
        return CisSpec(**(self.model_dump() | NOISELESS | INSTANT | clock))

    @property
    def curve(self) -> str:
        """The transfer curve of pictures of 8 bits."""
        if self.gamma == "srgb":
            return "srgb"
        return "linear" if self.gamma == 1 else f"gamma:{self.gamma}"  # (by the name that films have a code for)

    def picture_codes(self) -> np.ndarray:
        """The code of 8 bits [uint8, 2**bits] of each code, by `gamma`."""
        return np.rint(255 * parse_transfer(self.curve).to_signal(np.arange(self.top + 1) / self.top)).astype(np.uint8)

    def effects(self) -> list[str]:
        """Names of the effects that these parameters switch on, in the order of the path of light."""
        return [name for name, used in EFFECTS.items() if used(self)]
