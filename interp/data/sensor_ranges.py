"""Sensors to train with, drawn from ranges.

Each combination of effects is compiled apart, which takes seconds, so there are three kinds of event sensor, and what
differs within a kind are numbers:

    clean   mismatch, noise of crossings, refractory period
    slow    the same behind two poles
    noisy   the same as slow, with leak, shot noise and hot pixels

Sources of the numbers: thresholds and mismatch of published sensors lie in these ranges (`vid2ev sensors` has them with
their sources); the paper's are 0.15, 0.015, 0.035 nat, 100 us.  Ranges of frame sensors: the paper, section III.A.4,
for the darkest and the noise.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from interp.data.chance import Range, Share, has_some, log_uniform, one_of, uniform, within
from vid2ev import CisSpec, DvsSpec

KINDS = ("clean", "slow", "noisy")
CODES = 1023  # the highest of 10 bits
WHITE = 65535.0  # I16 of diffuse white


class SensorRanges(BaseModel):
    """Ranges that sensors are drawn from; a range of no width is a number.

    Beside each stand its least and most: whatever is drawn from there is a sensor (`DvsSpec`, `CisSpec`), thresholds
    times `off_to_on` and `mismatch`, too.  Raises `pydantic.ValidationError` for what is not.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    kinds: tuple[Share, Share, Share] = Field(
        default=(0.4, 0.3, 0.3), description="shares of clean, slow and noisy sensors"
    )
    threshold: Annotated[Range, within(1e-3, 10)] = Field(default=(0.1, 0.4), description="of ON events [nat]")
    off_to_on: Annotated[Range, within(0.01, 10)] = Field(
        default=(0.8, 1.25), description="threshold OFF / threshold ON"
    )
    mismatch: Annotated[Range, within(0, 10)] = Field(
        default=(0.03, 0.13), description="standard deviation over pixels, as a share of the threshold"
    )
    crossing_noise: Annotated[Range, within(0, 100)] = Field(
        default=(0.005, 0.04), description="standard deviation from crossing to crossing [nat]"
    )
    refractory_us: Annotated[Range, within(1e-9, 1e9)] = Field(
        default=(1.0, 1000.0), description="refractory period, even in the logarithm [us]"
    )
    tau_us: Annotated[Range, within(1e-3, 1e9)] = Field(
        default=(30.0, 1000.0), description="first pole, even in the logarithm [us]; the second is a third"
    )
    leak_rate_hz: Annotated[Range, within(0, 1e6)] = Field(
        default=(0.01, 0.3), description="leak events per pixel [Hz]"
    )
    shot_rate_hz: Annotated[Range, within(1e-6, 5e4)] = Field(
        default=(0.1, 5.0), description="shot-noise events per pixel, even in the logarithm [Hz]"
    )
    hot_probability: Annotated[Range, within(1e-9, 1)] = Field(
        default=(1e-4, 1e-3), description="share of pixels that are hot, even in the logarithm"
    )
    hot_rate_hz: Annotated[Range, within(1e-6, 1e5)] = Field(
        default=(10.0, 200.0), description="events of a hot pixel, even in the logarithm [Hz]"
    )
    exposed: float = Field(
        default=0.5, ge=0, le=1, description="share of frames with an exposure; the others see an instant"
    )
    exposure: Annotated[Range, within(0, 1)] = Field(
        default=(0.0, 0.5), description="exposure as a share of the time between frames"
    )
    clipping: float = Field(
        default=0.3, ge=0, le=1, description="share of frame sensors whose range is not from black to white"
    )
    min_illuminance: Annotated[Range, within(0, 1e6)] = Field(
        default=(0.0, 4096.0), description="I16 of code 0 of those; white is 65535"
    )
    top_illuminance: Annotated[Range, within(1, 1e6)] = Field(
        default=(45000.0, 65535.0), description="I16 of the highest code of those"
    )
    noise_lsb: Annotated[Range, within(0, 1e5)] = Field(
        default=(0.0, 5.2), description="noise of the ADC [LSB of 10 bits]"
    )
    white: Annotated[Range, within(1e-3, 1e3)] = Field(
        default=(0.4, 1.2), description="light of the brightest twentieth of a picture, by the aperture"
    )

    @model_validator(mode="after")
    def _fits(self) -> SensorRanges:
        if not has_some(self.kinds):
            raise ValueError(f"kinds {self.kinds}: expected a share above 0")
        if self.min_illuminance[1] >= self.top_illuminance[0]:
            raise ValueError(
                f"min_illuminance {self.min_illuminance}: expected less than top_illuminance {self.top_illuminance}"
            )
        return self

    def dvs(self, draw: np.random.Generator) -> DvsSpec:
        """An event sensor."""
        kind = KINDS[one_of(draw, self.kinds)]
        on = uniform(draw, self.threshold)
        off = on * uniform(draw, self.off_to_on)
        plain: dict[str, Any] = {
            "threshold_on": on,
            "threshold_off": off,
            "mismatch": on * uniform(draw, self.mismatch),
            "crossing_noise": uniform(draw, self.crossing_noise),
            "refractory_us": log_uniform(draw, self.refractory_us),
        }
        tau_us = 0.0 if kind == "clean" else log_uniform(draw, self.tau_us)
        noise = {} if kind != "noisy" else self._noise(draw)
        return DvsSpec(**plain, photoreceptor_tau_us=tau_us, follower_tau_us=tau_us / 3, **noise)

    def cis(self, draw: np.random.Generator, gap_us: int, exposure_us: float) -> CisSpec:
        """A frame sensor that takes a frame every `gap_us`."""
        clips = draw.random() < self.clipping
        least = uniform(draw, self.min_illuminance) if clips else 0.0
        top = uniform(draw, self.top_illuminance) if clips else WHITE
        return frame_sensor(gap_us, exposure_us, least, (top - least) / CODES, uniform(draw, self.noise_lsb))

    def _noise(self, draw: np.random.Generator) -> dict[str, Any]:
        return {
            "leak_rate_hz": uniform(draw, self.leak_rate_hz),
            "shot_rate_hz": log_uniform(draw, self.shot_rate_hz),
            "hot_probability": log_uniform(draw, self.hot_probability),
            "hot_rate_hz": log_uniform(draw, self.hot_rate_hz),
        }


def frame_sensor(gap_us: int, exposure_us: float, least: float, slope: float, noise_lsb: float) -> CisSpec:
    """A frame sensor of 10 bits, all rows of which are open together."""
    shutter: dict[str, Any] = {"frame_rate_hz": 1e6 / gap_us, "exposure_us": exposure_us, "line_us": 0.0}
    return CisSpec(**shutter, min_illuminance=least, slope=slope, noise_lsb=noise_lsb)


def _fixed(
    threshold: float, off_to_on: float, mismatch: float, crossing_noise: float, refractory_us: float, **rest: Any
) -> SensorRanges:
    """Sensors of one kind of event sensor each, whose frames see an instant without noise from black to white."""
    numbers: dict[str, Any] = {
        "threshold": (threshold, threshold),
        "off_to_on": (off_to_on, off_to_on),
        "mismatch": (mismatch / threshold, mismatch / threshold),
        "crossing_noise": (crossing_noise, crossing_noise),
        "refractory_us": (refractory_us, refractory_us),
    }
    plain = {"kinds": (1, 0, 0), "exposed": 0, "clipping": 0, "noise_lsb": (0, 0)}
    return SensorRanges(**(numbers | plain | rest))


NONE = 1e-9  # nat or us: as good as nothing, and the kernel is that of the other clean sensors
PAPER_SLOPE, PAPER_LEAST = 55.0, 4096.0
PAPER_CIS = {
    "clipping": 1, "min_illuminance": (PAPER_LEAST, PAPER_LEAST), "noise_lsb": (5.2, 5.2),
    "top_illuminance": (PAPER_LEAST + CODES * PAPER_SLOPE, PAPER_LEAST + CODES * PAPER_SLOPE),
}  # fmt: skip
SENSORS = {
    "default": SensorRanges(),
    "exact": _fixed(0.15, 1.0, NONE, NONE, NONE),
    # What a network is measured with: the paper's event sensor (section III.B.2) beside frames without noise ...
    "clean": _fixed(0.15, 1.0, 0.015, 0.035, 100.0),
    # ... and a hard one: 2 Hz of shot noise in each pixel, one pixel in 1000 hot.
    "noisy": _fixed(
        0.25, 0.88, 0.03, 0.04, 100.0, kinds=(0, 0, 1), tau_us=(100.0, 100.0), leak_rate_hz=(0.1, 0.1),
        shot_rate_hz=(2.0, 2.0), hot_probability=(1e-3, 1e-3), hot_rate_hz=(100.0, 100.0),
    ),
    # The presets `paper` of `vid2ev sensors`.
    "paper": _fixed(0.15, 1.0, 0.015, 0.035, 100.0, kinds=(0, 1, 0), tau_us=(300.0, 300.0), **PAPER_CIS),
}  # fmt: skip
