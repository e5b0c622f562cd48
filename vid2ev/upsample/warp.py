"""Carrying motion and light to an instant between two frames.

`splat` throws the velocities of what moves in a frame forward to where its pixels are at that instant; where several
land on one place, those on which both directions of flow agree outweigh the rest, so that what is in front wins.
`carry` then looks, for every pixel of the instant, back along its velocity into the frame before and forward into the
frame after.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.stream.still import STRIP
from vid2ev.upsample.cubic import look_up, places
from vid2ev.upsample.stillness import is_kept

F = np.float32
BEFORE, AFTER = 1, 2  # pixels of margin that `carry` needs around an image
_HALF, _ONE = F(0.5), F(1)
BLOCK = 16  # pixels of a row that are looked up if one of them moves
_TINY = F(1e-20)  # in place of a sum of nothing


@compiled
def miss(flow, back, missed):
    """How far `back` fails to undo `flow`: missed [h, w] = |flow + back there|**2 / (0.01 lengths + 0.5).

    It is infinite where flow leads outside;
    lengths is |flow|**2 + |back there|**2; flow and back are [h, w, 2] px.
    """
    height, width = missed.shape
    for y in range(height):
        for x in range(width):
            across, down = flow[y, x, 0], flow[y, x, 1]
            if across == F(0) and down == F(0):  # (as below, without looking around: most of many pictures is still)
                lengths = back[y, x, 0] * back[y, x, 0] + back[y, x, 1] * back[y, x, 1]
                missed[y, x] = lengths / (F(0.01) * lengths + _HALF)
                continue
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


@compiled
def doubt(flow, gain, least):
    """Let nothing move where the gain [h, w] is not more than the least; the flow [h, w, 2] changes."""
    height, width = gain.shape
    for y in range(height):
        for x in range(width):
            kept = gain[y, x] > least
            flow[y, x, 0] = flow[y, x, 0] if kept else F(0)
            flow[y, x, 1] = flow[y, x, 1] if kept else F(0)


@compiled
def moving_of(flow, sure, unsure, slot, field):
    """What of a frame moves: float32 [n, 5] place (x, y in `field`), shift and weight; the rest is added to `field`.

    flow    [h, w, 2] shift over the whole interval, px of this grid
    sure    [h, w] of `proxies.agreement`; `unsure` is added: what a pixel counts on which the flows do not agree
    slot    2 or 3: where in `field` (of `splat`) the weights go of pixels that stay where they are
    """
    height, width = sure.shape
    moving, count = np.empty((sure.size, 5), F), 0
    for y in range(height):
        for x in range(width):
            across, down, weight = flow[y, x, 0], flow[y, x, 1], sure[y, x] + unsure
            if across == F(0) and down == F(0):
                field[y + 1, x + 1, slot] += weight
                continue
            pixel = moving[count]
            pixel[0], pixel[1], pixel[2], pixel[3], pixel[4] = F(x + 1), F(y + 1), across, down, weight
            count += 1
    return moving[:count]


@compiled
def splat(moving, time, direction, share, slot, field):
    """Add the velocities of what moves in a frame to `field`, at the places its pixels reach after `time` of the
    interval.

    moving     [n, 5] of `moving_of`
    direction  1 if flow runs with time, -1 if against
    share      factor on the weight in the average of velocities
    slot       2 or 3: where the weights go
    field      [h + 2, w + 2, 4], a margin of one pixel around: sums of share weight velocity (x, y), of the weights of
               the frame before, of the weights of the frame after
    """
    height, width = field.shape[0] - 2, field.shape[1] - 2
    for i in range(moving.shape[0]):
        across, down, weight = moving[i, 2], moving[i, 3], moving[i, 4]
        to_x, to_y = moving[i, 0] + time * across, moving[i, 1] + time * down
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


@compiled
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


@compiled
def carry(before, after, motion, top, left, time, out, still):
    """Light at `time` (share of the interval gone by) into out [H, W].

    before, after   the frames [H + 3, W + 3], with margins of BEFORE and AFTER px that repeat the border
    motion          [3, h, w] of `settle`, in px of the frames, for the part of them that begins at pixel `top`, `left`;
                    outside of it nothing moves, and a frame counts by its nearness in time
    still           bool [strips of out, as of `stream.still`]: where nothing moves, and both frames are the same
    """
    height, width = out.shape
    pitch, x_last, y_last = before.shape[1], F(width - 1), F(height - 1)
    bottom, right = top + motion.shape[1], left + motion.shape[2]
    entry, weights = np.empty(width, np.int32), np.empty((8, width), F)
    seen_before, seen_after, flat_weights = np.empty(width, F), np.empty(width, F), weights.reshape(-1)
    none = np.zeros((3, width), F)
    none[2] = _ONE - time
    flat_before, flat_after, flat_motion, flat_none, flat_out = (
        before.reshape(-1), after.reshape(-1), motion.reshape(-1), none.reshape(-1), out.reshape(-1)
    )  # fmt: skip
    still[:] = True
    for y in range(height):
        row_moves, first = False, 0
        part_row = top <= y < bottom
        while first < width:
            place, margined = y * width + first, (y + BEFORE) * pitch + BEFORE + first
            in_part = part_row and left <= first < right
            edge = right if in_part else left if part_row and first < left else width
            count = min(STRIP - place % STRIP, edge - first)
            planes, plane, there = flat_none, width, first
            if in_part:
                planes, plane, there = flat_motion, motion[0].size, (y - top) * motion.shape[2] + first - left
            moves, differs = _fade(flat_before, flat_after, margined, planes, plane, there, flat_out, place, count)
            still[place // STRIP] &= not (moves or differs)
            row_moves |= moves
            first += count
        last = 0
        while row_moves and last < motion.shape[2]:
            across, down, share = motion[0, y - top], motion[1, y - top], motion[2, y - top]
            first, last = _next_moving(across, down, last)
            if first < last:
                x, across, down, share = left + first, across[first:last], down[first:last], share[first:last]
                places(x, F(y), across, down, -time, pitch, x_last, y_last, entry, weights)
                look_up(flat_before, pitch, entry, flat_weights, width, last - first, seen_before)
                places(x, F(y), across, down, _ONE - time, pitch, x_last, y_last, entry, weights)
                look_up(flat_after, pitch, entry, flat_weights, width, last - first, seen_after)
                _mix(seen_before, seen_after, share, out[y, x : x + last - first])


@inner
def _next_moving(across, down, start):
    """The next run of blocks of pixels from `start` on, a block's first, in each of which something moves: first and
    last."""
    first, count = start, across.size
    while first < count and not _any_moves(across[first : first + BLOCK], down[first : first + BLOCK]):
        first += BLOCK
    last = first
    while last < count and _any_moves(across[last : last + BLOCK], down[last : last + BLOCK]):
        last += BLOCK
    return min(first, count), min(last, count)


@inner
def _any_moves(across, down):
    """Whether any of some pixels moves."""
    moves = np.uint32(0)
    for i in range(across.size):
        moves = np.uint32(moves | np.uint32((across[i] != F(0)) | (down[i] != F(0))))
    return moves != 0


@inner
def _mix(before, after, share, out):
    """What is seen in both frames, of which that before has a share."""
    for i in range(out.size):
        out[i] = after[i] + share[i] * (before[i] - after[i])


@inner
def _fade(before, after, margined, motion, plane, there, out, place, count):
    """What stands still, of `count` pixels of a row, from `margined` on in the frames, from `there` on in the planes
    (each so long) of the motion, and from `place` on in `out`.

    Returns whether any of them moves, and whether any is not the same in both frames, or not light.
    """
    # (offsets that cannot be negative, and no branches: this runs in vectors)
    k, m, j, size = np.uintp(margined), np.uintp(there), np.uintp(place), np.uintp(plane)
    moves, differs = np.uint32(0), np.uint32(0)
    for i in range(np.uintp(count)):
        p, q = before[k + i], after[k + i]
        out[j + i] = q + motion[size + size + m + i] * (p - q)  # (in this form equal light stays the same to the bit)
        moves = np.uint32(moves | np.uint32((motion[m + i] != F(0)) | (motion[size + m + i] != F(0))))
        differs = np.uint32(differs | np.uint32(is_kept(p, q) == False))  # noqa: E712 (vectorises, `not` does not)
    return moves != 0, differs != 0
