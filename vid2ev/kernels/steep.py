"""Lags of light that are too large against the signal for float32: after a flash of decades, what is left of them is
below the rounding of what they were.

The lags of such pixels are stepped in float64, and what they have beyond float32 is kept in planes of its own.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import HIGH, INPUT, LAG1, LAG2, PITCH
from vid2ev.kernels.scratch import CLOCK, NEW, NEW1, NEW2, OLD_REST1, OLD_REST2, REFINED, REST1, REST2, SEEN
from vid2ev.physics.elementary import expm1_64
from vid2ev.physics.log_curve import log_level_32
from vid2ev.physics.photoreceptor import light_weights_64

F = np.float32
STEEP = 2.0
FALLEN = 8.0  # times 9e-8, the rounding of a step, is 7e-7 nat


@inner
def forget_rests(scratch):
    """Of another block no lag has anything beyond its float32 yet."""
    if scratch[REFINED] > F(0.0):
        for i in range(OLD_REST1, REFINED):
            scratch[i] = F(0.0)


@inner
def note_rests(scratch, steep):
    """Some lags have, if any are `steep`."""
    scratch[REFINED] = F(steep)


@inner
def was_steep(block, i, flags, num):
    """Whether pixel i's lags are too large against its signal for float32, before the interval."""
    e1 = block[LAG1 * PITCH + i]
    e2 = block[LAG2 * PITCH + i] if len(flags.poles) > 1 else e1
    return is_steep(block[INPUT * PITCH + i], e1, e2, num)


@inner
def gets_steep(block, scratch, i, flags, num):
    """The same after it, or whether what is left of them in float32 has the rounding of far larger ones before it."""
    e1, old1 = scratch[NEW1 + i], block[LAG1 * PITCH + i]
    e2, old2 = (scratch[NEW2 + i], block[LAG2 * PITCH + i]) if len(flags.poles) > 1 else (e1, old1)
    fallen = max(abs(old1), abs(old2)) > F(FALLEN) * ((scratch[NEW + i] - e2) + F(num.curve.floor))
    return is_steep(scratch[NEW + i], e1, e2, num) | fallen


@inner
def is_steep(light, e1, e2, num):
    """Whether half a unit in the last place of the lags is more than 1.2e-7 of what the logarithm sees."""
    return max(abs(e1), abs(e2)) > F(STEEP) * ((light - e2) + F(num.curve.floor))


@inner
def refine(block, rest, scratch, flagged, n, flags, num, iv):
    """Where lags are steep, step them in float64: `rest` holds what they have beyond float32.

    It counts for the pixels that are steep, and a pixel that is not is left as it is, whatever its neighbours are.
    Whether a steep pixel reaches a level float32 cannot tell: it is flagged, unless it is bad.
    """
    x1, w1, x2, g, w2 = iv.x1, iv.w1, iv.x2, iv.g, iv.w2
    for i in range(n):
        was, gets = was_steep(block, i, flags, num), gets_steep(block, scratch, i, flags, num)
        if not (was or gets):
            continue
        if len(flags.light_bandwidth):
            x1, w1, x2, g, w2 = exact_light_weights(np.float64(scratch[CLOCK + i]), iv.b, flags)
        du = np.float64(scratch[NEW + i]) - np.float64(block[INPUT * PITCH + i])
        if was:
            scratch[OLD_REST1 + i], scratch[OLD_REST2 + i] = rest[i], rest[PITCH + i]
        e1 = old_lag(block, scratch, 1, i, flags)
        new1 = (e1 - x1 * e1) + w1 * du
        scratch[NEW1 + i] = new1
        scratch[REST1 + i] = new1 - np.float64(scratch[NEW1 + i])
        if len(flags.poles) > 1:
            e2 = old_lag(block, scratch, 2, i, flags)
            new2 = (e2 - x2 * e2) + (g * e1 + w2 * du)
            scratch[NEW2 + i] = new2
            scratch[REST2 + i] = new2 - np.float64(scratch[NEW2 + i])
        rest[i], rest[PITCH + i] = scratch[REST1 + i], scratch[REST2 + i]
        flagged[i] = np.uint8(block[HIGH * PITCH + i] < F(np.inf))
        if len(flags.noise):
            y = F(np.float64(scratch[NEW + i]) - new_lag(scratch, len(flags.poles), i, flags))
            scratch[SEEN + i] = log_level_32(max(y, F(0.0)), num.curve) + F(iv.leak1)


@inner
def exact_light_weights(clock, b, flags):
    """The weights of a step for one pixel's dt / tau1, in float64."""
    if len(flags.poles) > 1:
        return light_weights_64(clock, b)
    x1 = -expm1_64(-clock)
    return x1, x1 / clock, x1, x1, x1


@inner
def old_lag(block, scratch, pole, i, flags):
    """Pixel i's lag of a pole (1 or 2) before the interval, in float64."""
    lag = np.float64(block[(LAG1 if pole == 1 else LAG2) * PITCH + i])
    if len(flags.log_input) == 0:
        lag += scratch[(OLD_REST1 if pole == 1 else OLD_REST2) + i]
    return lag


@inner
def new_lag(scratch, pole, i, flags):
    """Pixel i's lag of a pole (1 or 2) after the interval, in float64."""
    lag = np.float64(scratch[(NEW1 if pole == 1 else NEW2) + i])
    if len(flags.log_input) == 0:
        lag += scratch[(REST1 if pole == 1 else REST2) + i]
    return lag
