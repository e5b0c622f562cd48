"""The scan: new lags and levels compared, one flag per pixel; vector code in float32.

The scan only has to be *safe*: it may flag a pixel that does not cross, and the slow path, in float64, then finds
nothing.  So the levels it compares with are drawn in by `MARGIN`, above its own rounding.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import HIGH, INPUT, LAG1, LAG2, LOW, PITCH, last_light, last_seen
from vid2ev.kernels.scratch import CLOCK, LIGHT, NEW, NEW1, NEW2, NOISE0, NOISE1, SEEN
from vid2ev.kernels.steep import gets_steep, refine, was_steep
from vid2ev.physics.elementary import exp64, expm1_32
from vid2ev.physics.log_curve import light_at, log_level_32
from vid2ev.physics.photoreceptor import light_weights_32
from vid2ev.physics.photoreceptor_noise import noise_draw, rice_expected, rice_gap

F = np.float32
HIGHEST = 3e38  # a level in light, for what float32 has no number for: that is for pixels that have no levels
MARGIN = 1.5e-6  # [nat]: 4 units in the last place of a level near 7 nat


@inner
def scan(block, rest, scratch, flagged, p0, n, flags, num, iv):
    """Find the state of n pixels after one interval, and flag those that may cross a level in it; returns how many are
    too steep for float32.

    `block` is the float32 state of their block, planes of PITCH, from the first of them on, as are `rest`, `scratch`
    and `flagged`.  It stays as it is: the new input and lags go to `scratch`, and into the block with `commit` when the
    slow path no longer needs the old ones.
    """
    poles = len(flags.poles)
    if len(flags.noise):
        advance_noise(block, scratch, p0, n, poles, num, iv)
    steep = advance(block, scratch, flagged, n, flags, num, iv)
    if (poles > 0) & (len(flags.log_input) == 0) and steep > 0:
        refine(block, rest, scratch, flagged, n, flags, num, iv)
    if len(flags.noise) and not iv.noise_resolved:
        flag_rice(block, scratch, flagged, p0, n, flags, num, iv)
    return steep


@inner
def advance(block, scratch, flagged, n, flags, num, iv):
    """One step of the poles and the flags that follow; returns how many pixels are too steep for float32."""
    poles, steep = len(flags.poles), np.int32(0)
    x1, w1, x2, g, w2 = F(iv.x1), F(iv.w1), F(iv.x2), F(iv.g), F(iv.w2)
    before, dark = last_light(flags), F(num.bandwidth_dark)
    per_light = F(iv.a) / (F(1.0) + dark)
    gain0 = F(exp64(iv.leak0)) if len(flags.leak) else F(1.0)
    for i in range(n):
        if len(flags.light_bandwidth):
            # dt / tau1 at the mean light of the interval, which for a ramp of light is its exact integral.
            light = scratch[NEW + i]
            mean = F(0.5) * (block[before + i] + light)
            scratch[LIGHT + i], scratch[CLOCK + i] = light, max(per_light * (mean + dark), F(1e-9))
            x1, w1, x2, g, w2 = light_weights(scratch[CLOCK + i], F(iv.b), flags)
        if len(flags.log_input):
            scratch[NEW + i] = log_level_32(scratch[NEW + i], num.curve)
        if poles > 0:
            du, e1 = scratch[NEW + i] - block[INPUT * PITCH + i], block[LAG1 * PITCH + i]
            scratch[NEW1 + i] = (e1 - x1 * e1) + w1 * du
            if poles > 1:
                e2 = block[LAG2 * PITCH + i]
                scratch[NEW2 + i] = (e2 - x2 * e2) + (g * e1 + w2 * du)
            if len(flags.log_input) == 0:
                here = was_steep(block, i, flags, num) | gets_steep(block, scratch, i, flags, num)
                steep = np.int32(steep + np.int32(here))
        flagged[i] = np.uint8(reaches(block, scratch, i, gain0, flags, num, iv))
    return steep


@inner
def light_weights(clock, b, flags):
    """Weights of a step for one pixel's dt / tau1."""
    if len(flags.poles) > 1:
        return light_weights_32(clock, b)
    x1 = -expm1_32(-clock)
    return x1, x1 / clock, x1, x1, x1


@inner
def reaches(block, scratch, i, gain0, flags, num, iv):
    """Whether pixel i may cross a level in the interval; `gain0` is that of the leak at its start."""
    poles = len(flags.poles)
    y = scratch[NEW + i]
    if poles > 0:
        y = y - scratch[(NEW1 if poles == 1 else NEW2) + i]
    end = y
    if len(flags.log_compare):
        if not len(flags.log_input):
            y = end = log_level_32(max(y, F(0.0)), num.curve)
        y = y + F(iv.leak1)
        if len(flags.noise):
            scratch[SEEN + i] = y
            y = y + scratch[NOISE1 + i]
    elif len(flags.leak):
        y = y * iv.gain + iv.shift
    if (len(flags.leak) + len(flags.noise) > 0) & (len(flags.straight) == 0):
        start = start_of(block, i, flags, num, iv)
        # (between its ends, and yet leak or noise may make it turn: it goes on rising before the light begins to fall)
        flag = hull_reaches(max(start, end), min(start, end), block, scratch, i, gain0, flags, num, iv)
    else:
        flag = (y >= block[HIGH * PITCH + i]) | (y <= block[LOW * PITCH + i])
    if (poles > 0) & (len(flags.straight) == 0):
        flag = flag | turns_at(block, scratch, i, flags) & may_reach(block, scratch, i, gain0, flags, num, iv)
    return flag


@inner
def start_of(block, i, flags, num, iv):
    """What the scan compares of pixel i, before the interval, without leak and noise."""
    if len(flags.noise):
        seen = block[last_seen(flags) + i]
        return seen - F(iv.leak0) if len(flags.leak) else seen
    start, poles = block[INPUT * PITCH + i], len(flags.poles)
    if poles > 0:
        start = start - block[(LAG1 if poles == 1 else LAG2) * PITCH + i]
    if len(flags.log_compare) and not len(flags.log_input):
        start = log_level_32(max(start, F(0.0)), num.curve)
    return start


@inner
def turns_at(block, scratch, i, flags):
    """Whether the slope of either pole changes its sign: only then can y turn within the interval.

    In steady light, lags that have died away by its end are 0 there and have lost their sign: y may have turned.
    """
    e1, new1 = block[LAG1 * PITCH + i], scratch[NEW1 + i]
    if len(flags.poles) > 1:
        start, end = block[LAG2 * PITCH + i] - e1, scratch[NEW2 + i] - new1
        return (e1 * new1 < F(0.0)) | (start > F(0.0)) & (end <= F(0.0)) | (start < F(0.0)) & (end >= F(0.0))
    return e1 * new1 < F(0.0)


@inner
def may_reach(block, scratch, i, gain0, flags, num, iv):
    """Whether the hull of an interval with a turning point reaches a level: y stays among inputs and first pole."""
    if len(flags.log_compare) and not len(flags.log_input):
        return block[HIGH * PITCH + i] < F(np.inf)  # all but bad pixels: their hull would cost another logarithm
    top, bottom = hull_of_turn(block, scratch, i)
    return hull_reaches(top, bottom, block, scratch, i, gain0, flags, num, iv)


@inner
def hull_of_turn(block, scratch, i):
    """(top, bottom) of the inputs and the first pole of pixel i in the interval."""
    old, new = block[INPUT * PITCH + i], scratch[NEW + i]
    first = old - block[LAG1 * PITCH + i]
    return max(old, max(new, first)), min(old, min(new, first))


@inner
def hull_reaches(top, bottom, block, scratch, i, gain0, flags, num, iv):
    """Whether what is between bottom and top reaches a level, with leak and noise wherever they are in the interval."""
    if len(flags.log_compare):
        top, bottom = top + F(iv.leak1), bottom + F(iv.leak0)
        if len(flags.noise):
            first, last = scratch[NOISE0 + i], scratch[NOISE1 + i]
            top, bottom = top + max(first, last), bottom + min(first, last)
    elif len(flags.leak):
        top, bottom = top * iv.gain + iv.shift, (bottom + F(num.curve.dark)) * gain0
    return (top >= block[HIGH * PITCH + i]) | (bottom <= block[LOW * PITCH + i])


@inner
def commit(block, scratch, n, flags):
    """The new state takes the place of the old."""
    poles, before = len(flags.poles), last_light(flags)
    for i in range(n):
        block[INPUT * PITCH + i] = scratch[NEW + i]
        if poles > 0:
            block[LAG1 * PITCH + i] = scratch[NEW1 + i]
        if poles > 1:
            block[LAG2 * PITCH + i] = scratch[NEW2 + i]
        if len(flags.noise):
            block[last_seen(flags) + i] = scratch[SEEN + i]
        if len(flags.light_bandwidth):
            block[before + i] = scratch[LIGHT + i]


@inner
def advance_noise(block, scratch, p0, n, poles, num, iv):
    """One step of the photoreceptor noise; the noise seen by the comparator before and after goes to scratch."""
    first, second = (LAG1 + poles) * PITCH, (LAG1 + poles + 1) * PITCH
    if iv.noise_resolved:
        for i in range(n):
            scratch[NOISE0 + i] = block[second + i]
        for i in range(n):
            block[first + i], block[second + i] = noise_draw(block[first + i], block[second + i], p0 + i, num, iv)
        for i in range(n):
            scratch[NOISE1 + i] = block[second + i]
    else:
        for i in range(n):
            block[first + i] = block[second + i] = scratch[NOISE0 + i] = scratch[NOISE1 + i] = F(0.0)


@inner
def flag_rice(block, scratch, flagged, p0, n, flags, num, iv):
    """Flag the pixels in which unresolved photoreceptor noise may reach a level in this interval."""
    before, drift = last_seen(flags), F(iv.leak1 - iv.leak0)
    for i in range(n):
        was, seen = block[before + i], scratch[SEEN + i]
        top, bottom = max(was + drift, seen), min(was, seen - drift)  # (between its ends the leak may make it turn)
        if (len(flags.log_input) > 0) & (len(flags.straight) == 0) and turns_at(block, scratch, i, flags):
            upper, lower = hull_of_turn(block, scratch, i)
            top, bottom = max(top, upper + F(iv.leak1)), min(bottom, lower + F(iv.leak0))
        expected = rice_expected(block[HIGH * PITCH + i] - top, bottom - block[LOW * PITCH + i], num, iv)
        flagged[i] |= np.uint8(rice_gap(p0 + i, 0, num, iv) < 1.01 * expected)


@inner
def compared(into, levels, inward, count, flags, num):
    """Levels [nat] as the scan compares them, in nats or light, drawn in by the margin."""
    if len(flags.log_compare):
        for j in range(count):
            into[j] = levels[j] + inward
    else:
        raised = num.curve.dark if len(flags.leak) else 0.0
        for j in range(count):
            into[j] = min(light_at(levels[j] + inward, num.curve) + raised, HIGHEST)
