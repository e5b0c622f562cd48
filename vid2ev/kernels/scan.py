"""The scan: light in, new lags and levels compared, one flag per pixel; vector code in float32.

The scan only has to be *safe*: it may flag a pixel that does not cross, and the slow path, in float64, then finds
nothing.  So the levels it compares with are drawn in by `MARGIN`, above its own rounding.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numba.core.extending import overload

from vid2ev.compiling.compiler import INNER_OPTIONS, inner
from vid2ev.kernels.layout import HIGH, INPUT, LAG1, LAG2, LOW, NOT_FINITE, PITCH, last_light
from vid2ev.physics.elementary import exp64, expm1_32, expm1_64
from vid2ev.physics.log_curve import light_at, log_level_32
from vid2ev.physics.photoreceptor import light_weights_32, light_weights_64
from vid2ev.physics.photoreceptor_noise import noise_draw, rice_expected, rice_gap
from vid2ev.stream.still import BRIGHTEST as MOST

F = np.float32
BRIGHTEST = F(MOST)
MARGIN = 1.5e-6  # [nat]: 4 units in the last place of a level near 7 nat
STEEP = 2.0
FALLEN = 8.0  # times 9e-8, the rounding of a step, is 7e-7 nat

# Planes of the scratch of one block: the new light, input of the filter and lags; the clock of the first pole
# (dt/tau1); the noise before and after, the comparator's input without it; what the lags before and after have beyond
# their float32 (`refine`).
LIGHT, NEW, NEW1, NEW2, CLOCK, NOISE0, NOISE1, SEEN, OLD_REST1, OLD_REST2, REST1, REST2 = (k * PITCH for k in range(12))
REFINED = 12 * PITCH  # more than 0 where one of the last four is not
SCRATCH = 12 * PITCH + 1


@inner
def read_light(scratch, light, lut, shade, p0, n, tally):
    """Light of a block into scratch, shading applied."""
    # (slices: an index with an offset may be negative for all the compiler knows, and then it does not vectorise)
    take_light(scratch, light[p0 : p0 + n], lut, tally)
    if shade.size == light.size:
        gain = shade[p0 : p0 + n]
        for i in range(n):
            scratch[NEW + i] = scratch[NEW + i] * gain[i]


def take_light(scratch, light, lut, tally):
    """Codes through their table, or linear light with what is not a finite light >= 0 mended."""


@overload(take_light, jit_options=INNER_OPTIONS)
def _take_light(scratch, light, lut, tally):
    if isinstance(light.dtype, types.Integer):

        def codes(scratch, light, lut, tally):
            if lut.size == 1:  # linear codes: the light of code 1
                unit = lut[0]
                for i in range(light.size):
                    scratch[NEW + i] = F(light[i]) * unit
            else:
                for i in range(light.size):
                    scratch[NEW + i] = lut[light[i]]

        return codes

    def linear(scratch, light, lut, tally):
        bad = np.int32(0)
        for i in range(light.size):
            value = F(light[i])
            bad += np.int32(0) if (value >= F(0.0)) & (value <= BRIGHTEST) else np.int32(1)
            value = value if value > F(0.0) else F(0.0)  # a NaN fails the comparison and becomes 0
            scratch[NEW + i] = value if value < BRIGHTEST else BRIGHTEST
        tally[NOT_FINITE] += bad

    return linear


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
def forget_rests(scratch):
    """Of another block no lag has anything beyond its float32 yet."""
    if scratch[REFINED] > F(0.0):
        for i in range(OLD_REST1, REFINED + 1):
            scratch[i] = F(0.0)


@inner
def note_rests(scratch, steep):
    """Some lags have, if any are `steep`."""
    scratch[REFINED] = F(steep)


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
def exact_light_weights(clock, b, flags):
    """The same in float64."""
    if len(flags.poles) > 1:
        return light_weights_64(clock, b)
    x1 = -expm1_64(-clock)
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
    flag = (y >= block[HIGH * PITCH + i]) | (y <= block[LOW * PITCH + i])
    if (poles > 0) & (len(flags.straight) == 0):
        flag = flag | turns_at(block, scratch, i, flags) & may_reach(block, scratch, i, gain0, flags, num, iv)
    if (len(flags.leak) > 0) & (len(flags.straight) == 0):
        start = block[INPUT * PITCH + i]
        if poles > 0:
            start = start - block[(LAG1 if poles == 1 else LAG2) * PITCH + i]
        if len(flags.log_compare) and not len(flags.log_input):
            start = log_level_32(max(start, F(0.0)), num.curve)
        # (between its ends, and yet the leak may make it turn: it goes on rising before the light has begun to fall)
        flag = flag | hull_reaches(max(start, end), min(start, end), block, scratch, i, gain0, flags, num, iv)
    return flag


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
        return True  # the hull in nats would cost another logarithm
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
            swing = max(abs(scratch[NOISE0 + i]), abs(scratch[NOISE1 + i]))
            top, bottom = top + swing, bottom - swing
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
            block[(LAG1 + poles + 2) * PITCH + i] = scratch[SEEN + i]
        if len(flags.light_bandwidth):
            block[before + i] = scratch[LIGHT + i]


@inner
def advance_noise(block, scratch, p0, n, poles, num, iv):
    """One step of the photoreceptor noise; the noise seen by the comparator before and after goes to scratch."""
    first, second = (LAG1 + poles) * PITCH, (LAG1 + poles + 1) * PITCH
    for i in range(n):
        scratch[NOISE0 + i] = block[second + i]
    if iv.noise_resolved:
        for i in range(n):
            block[first + i], block[second + i] = noise_draw(block[first + i], block[second + i], p0 + i, num, iv)
    else:
        for i in range(n):
            block[first + i] = F(0.0)
            block[second + i] = F(0.0)
            scratch[NOISE0 + i] = F(0.0)
    for i in range(n):
        scratch[NOISE1 + i] = block[second + i]


@inner
def flag_rice(block, scratch, flagged, p0, n, flags, num, iv):
    """Flag the pixels in which unresolved photoreceptor noise may reach a level in this interval."""
    before, drift = (LAG1 + len(flags.poles) + 2) * PITCH, F(iv.leak1 - iv.leak0)
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
            into[j] = light_at(levels[j] + inward, num.curve) + raised


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
