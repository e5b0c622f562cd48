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

import math
from typing import Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.compiling.compiler import compiled
from vid2ev.physics.elementary import exp64, log32, log64

F = np.float32
KNEE = 20.0 / 255.0


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


class Curve(NamedTuple):
    """All curves in one form: slope light + black below the knee, ln(light + dark) from there on."""

    dark: float
    knee: float
    log_knee: float
    slope: float
    black: float
    floor: float  # the light that a share of light is to be seen against at black: 1 / slope there


def curve_of(name: str, dark_level: float) -> Curve:
    """The numbers of a curve; `dark_level` is used by `offset` alone."""
    if name == "offset":
        return Curve(dark_level, 0.0, -math.inf, 0.0, 0.0, dark_level)
    log_knee = math.log(KNEE)
    if name == "toe":
        return Curve(0.0, KNEE, log_knee, 1.0 / KNEE, log_knee - 1.0, KNEE)
    return Curve(0.0, KNEE, log_knee, math.log(20.0) / KNEE, math.log(1.0 / 255.0), KNEE / math.log(20.0))


@compiled
def log_level(light, curve):
    """Comparator level [nat] of a light (float64, >= 0)."""
    return light * curve.slope + curve.black if light < curve.knee else log64(max(light, curve.knee) + curve.dark)


@compiled
def light_at(level, curve):
    """The light whose level this is: the inverse of `log_level`; below the curve's range it goes on below zero."""
    return (level - curve.black) / curve.slope if level < curve.log_knee else exp64(level) - curve.dark


@compiled
def log_slope(light, curve):
    """Derivative of `log_level` [nat per unit of light]."""
    return curve.slope if light < curve.knee else 1.0 / (light + curve.dark)


@compiled
def light_per_nat_32(light, curve):
    """The light >= 0 that a change by a share of a nat is that share of (float32): 1 / slope of `log_level`, which is
    nowhere greater than in the dark."""
    return F(curve.floor) if light < F(curve.knee) else light + F(curve.dark)


@compiled
def log_level_32(light, curve):
    """`log_level` in float32, for the scan."""
    knee = F(curve.knee)
    below = light * F(curve.slope) + F(curve.black)
    return below if light < knee else log32(max(light, knee) + F(curve.dark))
