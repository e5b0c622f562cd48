"""The scan: light in, new lags and levels compared, one flag per pixel; vector code in float32.

The scan only has to be *safe*: it may flag a pixel that does not cross, and the slow path, in float64, then finds
nothing.  So the levels it compares with are drawn in by `MARGIN`, above its own rounding.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types
from numba.core.extending import overload

from vid2ev.kernels.layout import HIGH, INPUT, LAG1, LAG2, LOW, NOT_FINITE, PITCH
from vid2ev.physics.elementary import expm1_32
from vid2ev.physics.log_curve import light_at, log_level_32
from vid2ev.physics.photoreceptor import light_weights_32
from vid2ev.physics.photoreceptor_noise import noise_draw, rice_expected, rice_gap

F = np.float32
OPTIONS = {"nogil": True, "error_model": "numpy"}
MARGIN = 1.5e-6  # [nat]: 4 units in the last place of a level near 7 nat
BRIGHTEST = F(1e30)

# Planes of the scratch of one block: the new light, the new input of the filter and its output, the lags before, the
# sign of a turning point, the clock of the first pole (dt/tau1), the noise and the comparator's input without it,
# before and after.
LIGHT, NEW, FILTERED, OLD1, OLD2, TURN, CLOCK, NOISE0, NOISE1, SEEN0, SEEN1 = (k * PITCH for k in range(11))
SCRATCH = 11 * PITCH


@njit(cache=True, nogil=True, error_model="numpy")
def read_light(scratch, light, lut, shade, p0, n, flags, tally):
    """Light of a block into scratch, shading applied."""
    # (slices: an index with an offset may be negative for all the compiler knows, and then it does not vectorise)
    take_light(scratch, light[p0 : p0 + n], lut, tally)
    if len(flags.shading):
        gain = shade[p0 : p0 + n]
        for i in range(n):
            scratch[NEW + i] = scratch[NEW + i] * gain[i]


def take_light(scratch, light, lut, tally):
    """Codes through their table, or linear light with what is not a finite light >= 0 mended."""


@overload(take_light, jit_options=OPTIONS)
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


@njit(cache=True, nogil=True, error_model="numpy")
def scan(block, scratch, flagged, p0, n, flags, num, iv):
    """Advance the lags of a block by one interval and flag the pixels that may cross a level in it.

    `block` is the float32 state of the block, planes of BLOCK; `scratch` holds the new light and receives what the slow
    path needs of the old state.  The plane INPUT is left as it was: `remember_input` follows when that is no longer
    needed.
    """
    poles = len(flags.poles)
    if len(flags.log_input):
        log_light(scratch, n, num)
    if len(flags.noise):
        advance_noise(block, scratch, p0, n, poles, num, iv)
    if poles > 0:
        advance_lags(block, scratch, n, flags, num, iv)
    seen = (LAG1 + poles + 2) * PITCH
    for i in range(n):
        y = scratch[FILTERED + i] if poles > 0 else scratch[NEW + i]
        if len(flags.log_compare):
            if not len(flags.log_input):
                y = log_level_32(max(y, F(0.0)), num.curve)
            y = y + F(iv.leak1)
            if len(flags.noise):
                scratch[SEEN0 + i], scratch[SEEN1 + i] = block[seen + i], y
                block[seen + i] = y
                y = y + scratch[NOISE1 + i]
        elif len(flags.leak):
            y = y * iv.gain + iv.shift
        high, low = block[HIGH * PITCH + i], block[LOW * PITCH + i]
        flag = (y >= high) | (y <= low)
        if (poles > 0) & (len(flags.straight) == 0):
            flag = flag | (scratch[TURN + i] < F(0.0)) & may_reach(block, scratch, i, high, low, flags, iv)
        flagged[i] = np.uint8(flag)
    if len(flags.noise) and not iv.noise_resolved:
        flag_rice(block, scratch, flagged, p0, n, num, iv)


@njit(cache=True, nogil=True, error_model="numpy")
def may_reach(block, scratch, i, high, low, flags, iv):
    """Whether the hull of an interval with a turning point reaches a level: y stays among inputs and first pole."""
    if len(flags.log_compare) and not len(flags.log_input):
        return True  # the hull in nats would cost another logarithm
    old, new = block[INPUT * PITCH + i], scratch[NEW + i]
    first = old - scratch[OLD1 + i]
    top, bottom = max(old, max(new, first)), min(old, min(new, first))
    if len(flags.log_compare):
        top, bottom = top + F(iv.leak1), bottom + F(iv.leak0)
        if len(flags.noise):
            swing = max(abs(scratch[NOISE0 + i]), abs(scratch[NOISE1 + i]))
            top, bottom = top + swing, bottom - swing
    elif len(flags.leak):
        top, bottom = top * iv.gain + iv.shift, bottom * iv.gain + iv.shift
    return (top >= high) | (bottom <= low)


@njit(cache=True, nogil=True, error_model="numpy")
def log_light(scratch, n, num):
    """The new light to nats; the light itself stays in LIGHT."""
    for i in range(n):
        light = scratch[NEW + i]
        scratch[LIGHT + i] = light
        scratch[NEW + i] = log_level_32(light, num.curve)


@njit(cache=True, nogil=True, error_model="numpy")
def advance_lags(block, scratch, n, flags, num, iv):
    """One step of the poles: new lags into the block; old lags, output, sign of a turning point into scratch."""
    if len(flags.light_bandwidth):
        set_clock(block, scratch, n, flags, num, iv)
    x1, w1, x2, g, w2 = iv.x1, iv.w1, iv.x2, iv.g, iv.w2
    for i in range(n):
        new = scratch[NEW + i]
        du = new - block[INPUT * PITCH + i]
        e1 = block[LAG1 * PITCH + i]
        scratch[OLD1 + i] = e1
        if len(flags.light_bandwidth):
            if len(flags.poles) > 1:
                x1, w1, x2, g, w2 = light_weights_32(scratch[CLOCK + i], F(iv.b))
            else:
                x1 = -expm1_32(-scratch[CLOCK + i])
                w1 = x1 / scratch[CLOCK + i]
        new1 = (e1 - x1 * e1) + w1 * du
        block[LAG1 * PITCH + i] = new1
        if len(flags.poles) > 1:
            e2 = block[LAG2 * PITCH + i]
            scratch[OLD2 + i] = e2
            new2 = (e2 - x2 * e2) + (g * e1 + w2 * du)
            block[LAG2 * PITCH + i] = new2
            scratch[FILTERED + i] = new - new2
            # Negative where the slope of either pole changes its sign: only then can y turn within the interval.
            scratch[TURN + i] = min(e1 * new1, (e2 - e1) * (new2 - new1))
        else:
            scratch[FILTERED + i] = new - new1
            scratch[TURN + i] = e1 * new1


@njit(cache=True, nogil=True, error_model="numpy")
def set_clock(block, scratch, n, flags, num, iv):
    """dt / tau1 of each pixel at the mean light of the interval, which for a ramp of light is its exact integral."""
    last = (LAG1 + len(flags.poles) + 3 * len(flags.noise)) * PITCH
    light = LIGHT if len(flags.log_input) else NEW
    dark = F(num.bandwidth_dark)
    per_light = F(iv.a) / (F(1.0) + dark)
    for i in range(n):
        mean = F(0.5) * (block[last + i] + scratch[light + i])
        block[last + i] = scratch[light + i]
        scratch[CLOCK + i] = max(per_light * (mean + dark), F(1e-9))


@njit(cache=True, nogil=True, error_model="numpy")
def remember_input(block, scratch, n):
    """The new input becomes the old."""
    for i in range(n):
        block[INPUT * PITCH + i] = scratch[NEW + i]


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def flag_rice(block, scratch, flagged, p0, n, num, iv):
    """Flag the pixels in which unresolved photoreceptor noise may reach a level in this interval."""
    for i in range(n):
        top, bottom = max(scratch[SEEN0 + i], scratch[SEEN1 + i]), min(scratch[SEEN0 + i], scratch[SEEN1 + i])
        expected = rice_expected(block[HIGH * PITCH + i] - top, bottom - block[LOW * PITCH + i], num, iv)
        flagged[i] |= np.uint8(rice_gap(p0 + i, 0, num, iv) < 1.01 * expected)


@njit(cache=True, nogil=True, error_model="numpy")
def compared(into, levels, inward, count, flags, num):
    """Levels [nat] as the scan compares them, in nats or light, drawn in by the margin."""
    if len(flags.log_compare):
        for j in range(count):
            into[j] = levels[j] + inward
    else:
        raised = num.curve.dark if len(flags.leak) else 0.0
        for j in range(count):
            into[j] = light_at(levels[j] + inward, num.curve) + raised
