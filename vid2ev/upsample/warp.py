"""Carrying motion and light to an instant between two frames.

`splat` throws the velocities of a frame forward to where its pixels are at that instant; where several land on one
place, those on which both directions of flow agree outweigh the rest, so that what is in front wins.  `carry` then
looks, for every pixel of the instant, back along its velocity into the frame before and forward into the frame after.

Light is looked up by cubic convolution (Keys 1981, a = -1/2), the one that is exact for straight and parabolic light:
a ramp that moves evenly is seen to move evenly, at any fraction of a pixel.  It is held between the four nearest
values, so that it neither rings nor goes below zero beside a bright edge.

Source: R. G. Keys, "Cubic convolution interpolation for digital image processing", IEEE Trans. ASSP 29(6), 1981.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.stream.still import STRIP
from vid2ev.upsample.stillness import is_kept

F = np.float32
BEFORE, AFTER = 1, 2  # pixels of margin that `carry` needs around an image
_HALF, _ONE, _TWO, _THREE, _FOUR = F(0.5), F(1), F(2), F(3), F(4)
_TINY = F(1e-20)  # in place of a sum of nothing


@njit(cache=True, nogil=True, error_model="numpy")
def miss(flow, back, missed):
    """How far `back` fails to undo `flow`: missed [h, w] = |flow + back there|**2 / (0.01 lengths + 0.5).

    It is infinite where flow leads outside;
    lengths is |flow|**2 + |back there|**2; flow and back are [h, w, 2] px.
    """
    height, width = missed.shape
    for y in range(height):
        for x in range(width):
            across, down = flow[y, x, 0], flow[y, x, 1]
            to_x, to_y = F(x) + across, F(y) + down
            if not (F(0) <= to_x <= F(width - 1) and F(0) <= to_y <= F(height - 1)):
                missed[y, x] = F(np.inf)
                continue
            left, top = np.int32(to_x), np.int32(to_y)
            right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
            a, b = to_x - F(left), to_y - F(top)
            error, lengths = F(0), across * across + down * down
            for axis in range(2):
                upper = back[top, left, axis] + a * (back[top, right, axis] - back[top, left, axis])
                lower = back[bottom, left, axis] + a * (back[bottom, right, axis] - back[bottom, left, axis])
                there = upper + b * (lower - upper)
                error += (flow[y, x, axis] + there) ** 2
                lengths += there * there
            missed[y, x] = error / (F(0.01) * lengths + _HALF)


@njit(cache=True, nogil=True, error_model="numpy")
def splat(flow, sure, unsure, time, direction, share, slot, field):
    """Add a frame's velocities to `field`, at the places its pixels reach after `time` of the interval.

    flow       [h, w, 2] shift over the whole interval, px of this grid
    sure       [h, w] of `proxies.agreement`; `unsure` is added: what a pixel counts on which the flows do not agree
    direction  1 if flow runs with time, -1 if against
    share      factor on the weight in the average of velocities
    slot       2 or 3: where the weights go
    field      [h + 2, w + 2, 4], a margin of one pixel around: sums of share weight velocity (x, y), of the weights of
               the frame before, of the weights of the frame after
    """
    height, width = sure.shape
    for y in range(height):
        for x in range(width):
            across, down, weight = flow[y, x, 0], flow[y, x, 1], sure[y, x] + unsure
            if across == F(0) and down == F(0):
                field[y + 1, x + 1, slot] += weight
                continue
            to_x, to_y = F(x + 1) + time * across, F(y + 1) + time * down
            if not (F(0) <= to_x < F(width + 1) and F(0) <= to_y < F(height + 1)):
                continue
            column, row = int(to_x), int(to_y)
            right, lower = to_x - F(column), to_y - F(row)
            x_sum, y_sum = direction * share * across, direction * share * down
            for part, place in (
                ((_ONE - right) * (_ONE - lower) * weight, field[row, column]),
                (right * (_ONE - lower) * weight, field[row, column + 1]),
                ((_ONE - right) * lower * weight, field[row + 1, column]),
                (right * lower * weight, field[row + 1, column + 1]),
            ):
                place[0] += part * x_sum
                place[1] += part * y_sum
                place[slot] += part


@njit(cache=True, nogil=True, error_model="numpy")
def settle(field, time, enough, motion):
    """From the sums of `splat` to motion [3, h, w]: velocity x and y [px of this grid per interval], weight of the
    frame before.

    A frame counts by its nearness in time, and by whether anything of it was thrown here (`enough` is the sum that
    counts as half): what only one of the frames sees is taken from that one.
    """
    _, height, width = motion.shape
    four = np.uintp(4)
    for y in range(height):
        sums = field[y + 1].reshape(-1)
        across, down, share = motion[0, y], motion[1, y], motion[2, y]
        for x in range(width):  # (flat entries and no branches: this runs in vectors)
            k = four * np.uintp(x) + four
            before, after = sums[k + np.uintp(2)], sums[k + np.uintp(3)]
            inverse = _ONE / ((_ONE - time) * before + time * after + _TINY)
            across[x] = sums[k] * inverse
            down[x] = sums[k + np.uintp(1)] * inverse
            seen_before = (_ONE - time) * (before / (before + enough) + F(1e-6))
            seen_after = time * (after / (after + enough) + F(1e-6))
            share[x] = seen_before / (seen_before + seen_after)


@njit(cache=True, nogil=True, error_model="numpy")
def carry(before, after, motion, time, out, still):
    """Light at `time` (share of the interval gone by) into out [h, w].

    before, after   the frames [h + 3, w + 3], with margins of BEFORE and AFTER px that repeat the border
    motion          [3, h, w] of `settle`, for every pixel of the frames, in px of the frames
    still           bool [strips of out, as of `stream.still`]: where nothing moves, and both frames are the same
    """
    height, width = out.shape
    pitch, x_last, y_last = before.shape[1], F(width - 1), F(height - 1)
    columns, entry = np.empty(width, np.int32), np.empty(width, np.int32)
    across, down, weights = np.empty(width, F), np.empty(width, F), np.empty((8, width), F)
    seen_before, seen_after = np.empty(width, F), np.empty(width, F)
    flat_before, flat_after, flat_motion, flat_out = (
        before.reshape(-1), after.reshape(-1), motion.reshape(-1), out.reshape(-1)
    )  # fmt: skip
    still[:] = True
    for y in range(height):
        moving, first = 0, 0
        while first < width:
            place = y * width + first
            count = min(STRIP - place % STRIP, width - first)
            margined = (y + BEFORE) * pitch + BEFORE + first
            moves, differs = _fade(flat_before, flat_after, margined, flat_motion, flat_out, place, count)
            still[place // STRIP] &= not (moves or differs)
            if moves:
                for x in range(first, first + count):
                    if motion[0, y, x] != F(0) or motion[1, y, x] != F(0):
                        columns[moving], across[moving], down[moving] = x, motion[0, y, x], motion[1, y, x]
                        moving += 1
            first += count
        if moving > 0:
            _places(columns[:moving], F(y), across, down, -time, pitch, x_last, y_last, entry, weights)
            _look_up(flat_before, pitch, entry, weights, seen_before[:moving])
            _places(columns[:moving], F(y), across, down, _ONE - time, pitch, x_last, y_last, entry, weights)
            _look_up(flat_after, pitch, entry, weights, seen_after[:moving])
            for i in range(moving):
                out[y, columns[i]] = seen_after[i] + motion[2, y, columns[i]] * (seen_before[i] - seen_after[i])


@njit(cache=True, nogil=True, error_model="numpy")
def _fade(before, after, margined, motion, out, place, count):
    """What stands still, of `count` pixels of a row, from `margined` on in the frames and from `place` on elsewhere;
    returns whether any of them moves, and whether any is not the same in both frames, or not light."""
    # (offsets that cannot be negative, and no branches: this runs in vectors)
    k, j, size = np.uintp(margined), np.uintp(place), np.uintp(out.size)
    moves, differs = np.uint32(0), np.uint32(0)
    for i in range(np.uintp(count)):
        p, q = before[k + i], after[k + i]
        out[j + i] = q + motion[size + size + j + i] * (p - q)  # (in this form equal light stays the same to the bit)
        moves = np.uint32(moves | np.uint32((motion[j + i] != F(0)) | (motion[size + j + i] != F(0))))
        differs = np.uint32(differs | np.uint32(is_kept(p, q) == False))  # noqa: E712 (vectorises, `not` does not)
    return moves != 0, differs != 0


# Places first and look-ups after: the first loop runs in vectors, which a loop with a look-up in it cannot.
@njit(cache=True, nogil=True, error_model="numpy")
def _places(columns, y, across, down, time, pitch, x_last, y_last, entry, weights):
    """Where pixels of a row lie after `time` of the interval: the first of 4 x 4 entries of the flat image with
    margins, and the weights of its columns (0 to 3) and rows (4 to 7).  Places outside are moved to the border."""
    a0, a1, a2, a3 = weights[0], weights[1], weights[2], weights[3]
    b0, b1, b2, b3 = weights[4], weights[5], weights[6], weights[7]
    row_length = np.int32(pitch)
    for i in range(columns.size):
        to_x, to_y = F(columns[i]) + time * across[i], y + time * down[i]
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


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(light, pitch, entry, weights, out):
    """Light at the places of `_places`, as many as `out` holds."""
    row_length, one, two, three = np.uintp(pitch), np.uintp(1), np.uintp(2), np.uintp(3)
    for x in range(out.size):
        a0, a1, a2, a3 = weights[0, x], weights[1, x], weights[2, x], weights[3, x]
        k = np.uintp(entry[x])
        value = weights[4, x] * (light[k] * a0 + light[k + one] * a1 + light[k + two] * a2 + light[k + three] * a3)
        k += row_length
        p, q = light[k + one], light[k + two]
        value += weights[5, x] * (light[k] * a0 + p * a1 + q * a2 + light[k + three] * a3)
        k += row_length
        r, s = light[k + one], light[k + two]
        value += weights[6, x] * (light[k] * a0 + r * a1 + s * a2 + light[k + three] * a3)
        k += row_length
        value += weights[7, x] * (light[k] * a0 + light[k + one] * a1 + light[k + two] * a2 + light[k + three] * a3)
        out[x] = min(max(value, min(min(p, q), min(r, s))), max(max(p, q), max(r, s)))
