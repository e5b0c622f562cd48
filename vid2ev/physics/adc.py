"""ADC: light to codes, within the range that the sensor operates in.

    I16   = 65535 light exposure_gain
    level = clip((I16 - min_illuminance) / slope, 0, top)           top = 2^bits - 1
    code  = clip(floor(level + noise_lsb z + 1/2), 0, top)          z standard normal

Noise is added after the signal is clipped, as in the paper's model, so black and white are noisy, too; the second clip
keeps the codes within their bits.  Away from both ends the variance is noise_lsb^2 + 1/12, the second part from
rounding.  `slope` is I16 per LSB: with fewer bits the range shrinks unless the slope grows with it.

What leaving it out changes: light beyond the range of codes is clipped, and what is within is rounded by up to half a
code; both make what a camera sends, and stay.  The noise changes no level of a clip of N values by more than
noise_lsb sqrt(2 ln(2000 N)), with 99.9 % certainty.

Pictures in 8 bits are codes of code / top by the curve `gamma`; black is min_illuminance, not darkness.

Sources: the paper, section II.A ("minimum detectable difference and intensity slope", noise in LSB of a 10-bit ADC) and
section IV for the numbers: 4096, 55, 5.2.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from vid2ev.bounds.exposed import Change, Exposed, LevelChange, level_change, normal_most, surely_square
from vid2ev.compiling.compiler import compiled
from vid2ev.compiling.intrinsics import floor

WHITE = 65535.0  # I16 of light 1.0


class Adc(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the ADC."""

    exposure_gain: float = Field(1.0, gt=0, le=1e9, description="how bright: aperture and time in one factor of light")
    min_illuminance: float = Field(4096.0, ge=0, le=1e9, description="I16 of code 0; white is 65535")
    slope: float = Field(55.0, gt=0, le=1e9, description="I16 per code")
    noise_lsb: float = Field(5.2, ge=0, le=1e5, description="standard deviation of the noise of the ADC [LSB]")
    bits: int = Field(10, ge=1, le=16, description="bits of a code")
    gamma: Annotated[float, Field(ge=0.1, le=10)] | Literal["srgb"] = Field(
        "srgb", description="curve of the pictures in 8 bits: srgb, or the exponent of a power"
    )


@compiled
def code_of(i16, least, slope, top, noise):
    """The code (as float64) of I16 with a noise [LSB]; a NaN cannot come here."""
    level = min(max((i16 - least) / slope, 0.0), top)
    return min(max(floor(level + noise + 0.5), 0.0), top)


def lsb_per_electron(spec: Any) -> float:
    """K, the codes of an electron."""
    return WHITE / (spec.white_e * spec.slope)


def lsb_per_light(spec: Any) -> float:
    """How many codes light 1.0 is, black aside."""
    return WHITE * spec.exposure_gain / spec.slope


def omission_of_noise(seen: Exposed, spec: Any) -> LevelChange:
    """The noise of the ADC."""
    most = spec.noise_lsb * normal_most(seen.draws)
    levels = surely_square(spec.noise_lsb**2, most, seen.draws)
    return level_change(levels, "99.9 % bound", f"{spec.noise_lsb:g} LSB, whatever the light")


def clipped(seen: Exposed, spec: Any) -> LevelChange:
    """The ends of the range of codes; `changes` of the light has what lies beyond them."""
    levels = seen.changes["clip"].times(lsb_per_light(spec))
    why = "all light is within the range of codes" if levels.most == 0 else "light beyond the range of codes"
    return level_change(levels, "exact", why)


def rounding(seen: Exposed, spec: Any) -> LevelChange:
    """The rounding to codes."""
    return level_change(Change(0.5, 0.25), "bound", "codes are whole numbers; rms 0.29 where levels are spread evenly")
