"""Log curve: what the comparator sees of the light.

    offset   y = ln(light + dark)                            dark: the dark current as an equivalent light
    toe      y = ln(light)           at or above the knee,   light / knee - 1 + ln(knee)       below (slope continuous)
    v2e      y = ln(light)           at or above the knee,   light / knee * ln(20) + ln(1/255) below (v2e's lin-log)

Sources: `offset` is the photocurrent plus dark current of Lichtsteiner, Posch, Delbruck (IEEE JSSC 2008); `v2e` is
the published model of Hu, Liu, Delbruck (*v2e*, CVPRW 2021), linear to the knee of 20 of 255 codes, in nats shifted so
that white is 0: its slope jumps by a factor ln 20 = 3.0 at the knee, which `toe` mends.
Light is relative to diffuse white (1.0); y is in nats.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numba import njit
from pydantic import BaseModel, Field

from vid2ev.physics.elementary import exp64, log32, log64

F = np.float32
KNEE = 20.0 / 255.0
_LN_KNEE = float(np.log(KNEE))
_V2E_BLACK = float(np.log(1.0 / 255.0))
_V2E_SLOPE = float(np.log(20.0)) / KNEE
OFFSET, TOE, V2E = range(3)
CURVES = {"offset": OFFSET, "toe": TOE, "v2e": V2E}


class LogCurve(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the log curve."""

    log_curve: Literal["offset", "toe", "v2e"] = Field(
        "offset",
        description="what the comparator sees of the light: ln(light + dark_level), or a lin-log with a knee at 20/255",
    )
    dark_level: float = Field(
        1e-3,
        ge=1e-12,
        le=1.0,
        description="dark current as an equivalent light, diffuse white = 1 (log_curve offset)",
    )


@njit(cache=True, nogil=True, error_model="numpy")
def log_level(light, curve, dark):
    """Comparator level [nat] of a light (float64, >= 0)."""
    if curve == OFFSET:
        return log64(light + dark)
    below = light / KNEE - 1.0 + _LN_KNEE if curve == TOE else light * _V2E_SLOPE + _V2E_BLACK
    return below if light < KNEE else log64(max(light, KNEE))


@njit(cache=True, nogil=True, error_model="numpy")
def light_at(level, curve, dark):
    """The light whose level this is: the inverse of `log_level`; below the curve's range it goes on below zero."""
    if curve == OFFSET:
        return exp64(level) - dark
    below = (level + 1.0 - _LN_KNEE) * KNEE if curve == TOE else (level - _V2E_BLACK) / _V2E_SLOPE
    return below if level < _LN_KNEE else exp64(level)


@njit(cache=True, nogil=True, error_model="numpy")
def log_slope(light, curve, dark):
    """Derivative of `log_level` [nat per unit of light]."""
    if curve == OFFSET:
        return 1.0 / (light + dark)
    below = 1.0 / KNEE if curve == TOE else _V2E_SLOPE
    return below if light < KNEE else 1.0 / light


@njit(cache=True, nogil=True, error_model="numpy")
def log_level_32(light, curve, dark):
    """`log_level` in float32, for the scan."""
    if curve == OFFSET:
        return log32(light + dark)
    below = light * F(1.0 / KNEE) + F(_LN_KNEE - 1.0) if curve == TOE else light * F(_V2E_SLOPE) + F(_V2E_BLACK)
    return below if light < F(KNEE) else log32(max(light, F(KNEE)))
