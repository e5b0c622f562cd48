"""Shutter: each row of a frame sensor takes the mean of the light over a window of its own.

    row y of exposure k is open from   a = t_0 + k / frame_rate_hz + y line_us   to   a + exposure_us

    it sees   1/T integral of light(t) dt over [a, a + T],   T = exposure_us,
              light(t) = L_0 + (L_1 - L_0)(t - t_0)/(t_1 - t_0) between two frames

Windows may overlap: the exposure may be longer than the frame interval, and so may the readout of all rows.  With
`line_us` = 0 all rows are open together (global shutter); with an exposure of 0 a row samples the light at instant a.

The integral is exact.  Over the part of a window that lies between two frames a straight line's mean is its value in
the middle of that part, so the part gives to the frames before and after it

    W_0 = s (1 - m),   W_1 = s m       s = length of the part / T,   m = its middle, from 0 at t_0 to 1 at t_1

and a row is the sum of W L over the frames; nothing is a difference of long sums.  At a cut light does not ramp: it
stays at L_0 and steps to L_1 at t_1, so m = 0, and an instant at t_1 itself sees L_1.

It is the *mean* of the light, so a longer exposure blurs more but is no brighter: `exposure_gain` says how bright, as a
photographer who halves the time opens the aperture.

With `blur` off a row sees the light in the middle of its window instead of the mean, a_y + T/2: what is left of an
exposure where nothing changes in it, or changes along a straight line.  A window with a bend of r per second at the
distance d from its middle differs by r (T/2 - |d|)^2 / (2 T).

What leaving it out changes, exposure and rows apart, is looked at in every value of every exposure, as it takes no more
than the exposures themselves; without the rows apart all open with the first one.

Sources: the paper, section II.A (exposure and line readout time apart); windows of rolling shutters as in Liang, Chang,
Chen, "Analysis and compensation of rolling shutter effect", IEEE Trans. Image Processing 17(8), 2008.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from vid2ev.bounds.exposed import Exposed, LevelChange, level_change
from vid2ev.physics.adc import lsb_per_light
from vid2ev.physics.fixed_pattern import greatest_gain
from vid2ev.stream.ticks import Ticks

PARTS = 512  # of a nanosecond


class Shutter(BaseModel, frozen=True, extra="forbid"):
    """Parameters of the shutter."""

    frame_rate_hz: float = Field(30.0, gt=0, le=1e6, description="exposures per second [Hz]")
    exposure_us: float = Field(5000.0, ge=0, le=1e8, description="how long each row is open; 0: an instant [us]")
    blur: bool = Field(True, description="true: the mean of the light while a row is open; false: that in the middle")
    line_us: float = Field(0.0, ge=0, le=1e6, description="how much later each row opens than the one above it [us]")
    burst: int = Field(0, ge=0, le=10**9, description="exposures in all; 0: as many as the light lasts for")


def opening_ns(k: int, frame_rate_hz: float) -> int:
    """When exposure k opens [ns after the first]; the rate as it is written in decimals, halves upwards."""
    return Ticks.of(frame_rate_hz, 10**9).at(k)


def whole_parts_ns(times_us: np.ndarray | float) -> np.ndarray:
    """Times [ns, float64], each the nearest of 512 parts of a nanosecond.

    Sums and halves of such numbers are exact up to 2^43 ns, so that a row that is read at a frame is so on either side
    of that frame: 16.1 us are 16100 ns, and not 2e-12 ns more, which a long interval before the frame swallows and a
    short one behind it does not.
    """
    return np.rint(np.asarray(times_us, np.float64) * (1e3 * PARTS)) / PARTS


def interval_weights(
    open_ns: np.ndarray, exposure_ns: float, length_ns: int, cut: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What rows that open at `open_ns` [float64, ns after the earlier frame] get of an interval of `length_ns` > 0.

    Returns the weight of the frame before and of the one after [float64, 1 in all for a whole window], and whether the
    row has closed by the end of the interval.  An instant belongs to the interval that it ends.
    """
    close_ns = open_ns + exposure_ns
    if exposure_ns > 0:
        early, late = np.clip(-open_ns, 0, exposure_ns), np.clip(close_ns - length_ns, 0, exposure_ns)
        share = np.maximum(exposure_ns - early - late, 0) / exposure_ns
    else:
        share = ((open_ns > 0) & (open_ns <= length_ns)).astype(np.float64)
    if cut:
        middle = (open_ns >= length_ns).astype(np.float64)
    else:
        middle = (np.maximum(open_ns, 0) + np.minimum(close_ns, length_ns)) / (2 * length_ns)
    return share * (1 - middle), share * middle, close_ns <= length_ns


def omission_of_exposure(seen: Exposed, spec: Any) -> LevelChange:
    """The mean over the time that a row is open; the light in its middle takes its place."""
    levels = seen.changes["exposure"].times(lsb_per_light(spec) * greatest_gain(spec))
    why = f"the light in the middle of {spec.exposure_us:g} us instead{seen.moved(spec.exposure_us)}"
    return level_change(levels, "bound", why, (("blur", False),))


def omission_of_rolling_shutter(seen: Exposed, spec: Any) -> LevelChange:
    """The rows' own times; without them all are open with the first."""
    levels = seen.changes["rolling_shutter"].times(lsb_per_light(spec) * greatest_gain(spec))
    readout_us = spec.line_us * (seen.rows - 1)
    return level_change(
        levels, "bound", f"rows open {spec.line_us:g} us apart, all {readout_us:g} us{seen.moved(readout_us)}"
    )
