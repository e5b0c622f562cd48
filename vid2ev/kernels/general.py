"""Slow path for everything at once: one pixel, one interval, scalar code.

Used where the fast slow paths do not go: forced events, photoreceptor noise that the interval does not resolve, and the
refractory kind `track` of signals that are straight lines.  The comparator's input F(s) (`path`) is followed from knot
to knot: turning points, forced events, the end of a refractory period.  With `timing = "frame"` it stays at its start
until the frame is there.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.blind import blind_until, note_jump, stay_blind
from vid2ev.kernels.crossing import (
    AT,
    HOT,
    LABEL,
    LEVEL_OFF,
    LEVEL_ON,
    SHOT,
    SIGNAL,
    UP,
    WHEN,
    cross,
    fresh_thresholds,
    key_of,
    leave_levels,
    load_thresholds,
)
from vid2ev.kernels.forced import place_of_candidate
from vid2ev.kernels.layout import CAPPED, HIGH, LOW, PITCH
from vid2ev.kernels.path import knots_of, path_of, reach, value
from vid2ev.kernels.sink import put, room
from vid2ev.physics.photoreceptor_noise import fresh_share, rice_expected, rice_gap, rice_words
from vid2ev.physics.random import unit


@inner
def next_rice(path, knots, s, k, on, off, sees_from, pixel, num, iv):
    """Candidate k of the unresolved noise after s: (its s, the expected number it stands for); none of a blind pixel,
    whose levels are others when it sees."""
    if sees_from > s:
        return 2.0, 0.0
    top = bottom = value(path, 0.0)
    for knot in knots:
        here = value(path, knot)
        top, bottom = max(top, here), min(bottom, here)
        if knot >= 1.0:
            break
    expected = rice_expected(on - top, bottom - off, num, iv)
    return s + rice_gap(pixel, k, num, iv) / max(expected, 1e-300), expected


@inner
def accept_rice(path, s, k, expected, on, off, pixel, num, iv):
    """Does candidate k happen at s? 1 as ON, -1 as OFF, 0 not at all."""
    here = value(path, s)
    chance = unit(rice_words(pixel, k, num, iv)[1]) * expected
    upward = rice_expected(on - here, np.inf, num, iv) * fresh_share(on - here, num)
    if chance < upward:
        return 1
    downward = rice_expected(np.inf, here - off, num, iv) * fresh_share(here - off, num)
    return -1 if chance < upward + downward else 0


@inner
def cross_one(lanes, pixels, pixel, up, at, s, label, planes, flags, num, iv, out, n, tally):
    """`cross` for one pixel: (c_on, c_off, out, n).  The second of `pixels` is 0, the number of the only lane."""
    pixels[0] = pixel
    lanes[AT], lanes[WHEN], lanes[UP], lanes[LABEL] = at, s, 1.0 if up else 0.0, label
    out, n = cross(lanes, pixels, pixels[1:], 1, planes, flags, num, iv, out, n, tally)
    return lanes[LEVEL_ON], lanes[LEVEL_OFF], out, n


@inner
def walk_pixel(
    block, scratch, i, p0, lanes, pixels, keys, chance, forced, knots, j, planes, flags, num, iv, out, n, tally
):
    """Events of pixel i of the block, whose forced candidates start at entry j: (out, n)."""
    pixel = p0 + i
    path = path_of(block, scratch, i, flags, num, iv)
    knots_of(path, knots)
    good = block[HIGH * PITCH + i] < np.inf or block[LOW * PITCH + i] > -np.inf  # a bad pixel has no levels
    pixels[0] = pixel
    load_thresholds(lanes, pixels, 1, planes, flags, num)
    on = lanes[AT] + lanes[LEVEL_ON] if good else np.inf
    off = lanes[AT] - lanes[LEVEL_OFF] if good else -np.inf
    rice = len(flags.noise) > 0 and not iv.noise_resolved
    piece, s, begin, solved, candidate = 0, 0.0, value(path, 0.0), 0, -1
    sees_from = -1.0  # end of a refractory period of the kind `track`; a hot pixel has no memory to set then
    if len(flags.track) and good:
        sees_from = blind_until(pixel, planes, num, iv)
    rice_s, expected, stale = 2.0, 0.0, True  # the next candidate of unresolved noise, and whether levels are others
    while True:
        if rice and stale:
            candidate, stale = candidate + 1, False
            rice_s, expected = next_rice(path, knots, s, candidate, on, off, sees_from, pixel, num, iv)
        forced_s = 2.0
        if j < forced:
            whose, when = place_of_candidate(keys[j], iv)
            forced_s = when if whose == i else 2.0
        blind = sees_from > s
        blind_s = sees_from if blind else 2.0
        stop = min(min(knots[piece], forced_s), min(rice_s, blind_s))
        end = value(path, stop)
        crosses, up, at, label = not blind and (end >= on or end <= off), end >= on, end, SIGNAL
        if crosses:
            at, solved = on if up else off, solved + 1
            s = stop if num.frame_time else reach(path, at, s, stop, begin, end, up)
            if solved > num.max_crossings:
                tally[CAPPED] += 1
                s, at, rice, rice_s = stop, end, False, 2.0
            begin = at
        else:
            s, begin = stop, end
            if stop == blind_s:
                pixels[0], lanes[AT] = pixel, end
                note_jump(pixel, planes, flags, num)
                fresh_thresholds(lanes, pixels, pixels[1:], 1, planes, flags, num)
                leave_levels(lanes, pixels, 1, planes, flags, num)
                on, off = lanes[LEVEL_ON], lanes[LEVEL_OFF]
                sees_from, stale = -1.0, True
            elif stop == forced_s:
                if chance[j] == 0.0:
                    out, n = fire_hot(pixel, s, planes, num, iv, out, n)
                else:
                    crosses, up, label = good and takes_shot(pixel, s, planes, flags, num, iv), chance[j] > 0.0, SHOT
                j += 1
            elif stop == rice_s:
                polarity, stale = accept_rice(path, s, candidate, expected, on, off, pixel, num, iv), True
                crosses, up = polarity != 0 and not blind, polarity > 0
                at, solved = on if up else off, solved + crosses
                if solved > num.max_crossings:
                    tally[CAPPED] += 1
                    rice, rice_s = False, 2.0
            elif knots[piece] >= 1.0:
                break
            else:
                piece, solved = piece + 1, 0
        if crosses:
            stale = True
            on, off, out, n = cross_one(lanes, pixels, pixel, up, at, s, label, planes, flags, num, iv, out, n, tally)
            if len(flags.track):
                sees_from = blind_until(pixel, planes, num, iv)
    if sees_from > 1.0:
        stay_blind(pixel, planes, flags)
    return out, n


@inner
def fire_hot(pixel, s, planes, num, iv, out, n):
    """The event at s of a hot pixel, unless that is blind: (out, n)."""
    if is_blind(pixel, s, planes, num, iv):
        return out, n
    planes.t_last[pixel % planes.t_last.size] = t_of(s, iv)
    out = room(out, n, 1)
    return out, put(out, n, key_of(s * iv.dt_ns, pixel, np.int64(1), HOT, iv), True)


@inner
def takes_shot(pixel, s, planes, flags, num, iv):
    """Whether shot noise at s resets the memory of a good pixel: not while one is blind whose memory will jump."""
    return len(flags.track) == 0 or not is_blind(pixel, s, planes, num, iv)


@inner
def is_blind(pixel, s, planes, num, iv):
    """Whether s is within the refractory period of the last event of a pixel."""
    return num.refractory_ns > 0 and t_of(s, iv) - planes.t_last[pixel] < num.refractory_ns


@inner
def t_of(s, iv):
    """The instant [ns]."""
    return iv.t0_ns + np.int64(s * iv.dt_ns)
