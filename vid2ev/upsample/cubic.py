"""Light between the pixels of a frame.

Light is looked up by cubic convolution (Keys 1981, a = -1/2), the one that is exact for straight and parabolic light:
a ramp that moves evenly is seen to move evenly, at any fraction of a pixel.  It is held between the four nearest
values, so that it neither rings nor goes below zero beside a bright edge.

Source: R. G. Keys, "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29(6), 1981.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner

F = np.float32
_HALF, _ONE, _TWO, _THREE, _FOUR = F(0.5), F(1), F(2), F(3), F(4)


# Places first and look-ups after: the first loop runs in vectors, which a loop with a look-up in it cannot.
@inner
def places(start, y, across, down, time, pitch, x_last, y_last, entry, weights):
    """Where pixels of a row, from column `start` on, lie after `time` of the interval.

    That is the first of 4 x 4 entries of the flat image with margins, and the weights of its columns (0 to 3) and rows
    (4 to 7).  Places outside are moved to the border.
    """
    a0, a1, a2, a3 = weights[0], weights[1], weights[2], weights[3]
    b0, b1, b2, b3 = weights[4], weights[5], weights[6], weights[7]
    row_length = np.int32(pitch)
    for i in range(across.size):
        to_x, to_y = F(start + i) + time * across[i], y + time * down[i]
        to_x = to_x if to_x > F(0) else F(0)  # (in this form NaN is a place inside, too)
        to_x = x_last if to_x > x_last else to_x
        to_y = to_y if to_y > F(0) else F(0)
        to_y = y_last if to_y > y_last else to_y
        column, row = np.int32(to_x), np.int32(to_y)
        a, b = to_x - F(column), to_y - F(row)
        entry[i] = row * row_length + column
        first, third = _HALF * a * ((_TWO - a) * a - _ONE), _HALF * a * ((_FOUR - _THREE * a) * a + _ONE)
        last = _HALF * a * a * (a - _ONE)
        a0[i], a1[i], a2[i], a3[i] = first, _ONE - first - third - last, third, last
        first, third = _HALF * b * ((_TWO - b) * b - _ONE), _HALF * b * ((_FOUR - _THREE * b) * b + _ONE)
        last = _HALF * b * b * (b - _ONE)
        b0[i], b1[i], b2[i], b3[i] = first, _ONE - first - third - last, third, last


@inner
def look_up(light, pitch, entry, weights, plane, count, out):
    """Light at the first `count` of the places of `places`: run by run of places side by side, as most are.

    Its weights are flat here, rows of `plane`.
    """
    first, plane = 0, np.uintp(plane)
    while first < count:
        last, ahead = first + 1, entry[first] - np.int32(first)
        while last < count and entry[last] - np.int32(last) == ahead:
            last += 1
        _look_up_run(light, pitch, entry[first], weights, plane, first, last, out)
        first = last


@inner
def _look_up_run(light, pitch, entry, weights, plane, first, last, out):
    """Light at places first ... last - 1, of which the first begins at `entry`, and each other one pixel later."""
    # (offsets that cannot be negative, and neighbours in the place of look-ups: this runs in vectors)
    k, start, row = np.uintp(entry), np.uintp(first), np.uintp(pitch)
    one, two, three = np.uintp(1), np.uintp(2), np.uintp(3)
    for i in range(np.uintp(last - first)):
        x = start + i
        a0, a1, a2, a3 = weights[x], weights[plane + x], weights[two * plane + x], weights[three * plane + x]
        w = np.uintp(4) * plane + x
        j = k + i
        value = weights[w] * (light[j] * a0 + light[j + one] * a1 + light[j + two] * a2 + light[j + three] * a3)
        j += row
        w += plane
        p, q = light[j + one], light[j + two]
        value += weights[w] * (light[j] * a0 + p * a1 + q * a2 + light[j + three] * a3)
        j += row
        w += plane
        r, s = light[j + one], light[j + two]
        value += weights[w] * (light[j] * a0 + r * a1 + s * a2 + light[j + three] * a3)
        j += row
        w += plane
        value += weights[w] * (light[j] * a0 + light[j + one] * a1 + light[j + two] * a2 + light[j + three] * a3)
        out[x] = min(max(value, min(min(p, q), min(r, s))), max(max(p, q), max(r, s)))
