"""Shot noise in pixels where nothing else happens in the interval: a batch of resets instead of a walk for each.

Almost all shots are of this kind.  The memory goes to the signal at the shot's instant; a pixel that reaches one of its
new levels before the interval ends is walked from there on.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.kernels.crossing import AT, FREE, LABEL, LEVEL_OFF, LEVEL_ON, SHOT, UP, WHEN, cross_all, room
from vid2ev.kernels.forced import place_of_candidate
from vid2ev.kernels.general import path_of, value, walk_pixel
from vid2ev.kernels.layout import HIGH, PITCH
from vid2ev.kernels.scan import TURN

END = FREE
SHOTS = FREE + PITCH


@njit(cache=True, nogil=True, error_model="numpy")
def is_lonely(block, scratch, flagged, keys, chance, forced, j, flags, iv):
    """Whether candidate j is a shot, the only one of a good pixel that reaches no level and does not turn."""
    i = place_of_candidate(keys[j], iv)[0]
    if chance[j] == 0.0 or flagged[i] != 0 or not block[HIGH * PITCH + i] < np.inf:
        return False
    if j > 0 and place_of_candidate(keys[j - 1], iv)[0] == i:
        return False
    if j + 1 < forced and place_of_candidate(keys[j + 1], iv)[0] == i:
        return False
    return len(flags.poles) == 0 or scratch[TURN + i] >= 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def fire(
    block, scratch, flagged, keys, chance, forced, p0, lanes, pixels, knots, planes, flags, num, iv, out, n, tally
):
    """Send the lonely shots and flag the pixels of the other candidates: (how many candidates are left, out, n)."""
    left, shots = 0, 0
    live, others = np.empty(forced, np.int64), np.empty(forced, np.int64)
    for j in range(forced):
        i, s = place_of_candidate(keys[j], iv)
        if is_lonely(block, scratch, flagged, keys, chance, forced, j, flags, iv):
            path = path_of(block, scratch, i, flags, num, iv)
            lanes[AT + shots], lanes[END + shots], lanes[WHEN + shots] = value(path, s), value(path, 1.0), s
            lanes[UP + shots], lanes[LABEL + shots] = 1.0 if chance[j] > 0.0 else 0.0, SHOT
            pixels[shots], live[shots] = p0 + i, shots
            shots += 1
        else:
            others[left] = j
            left += 1
    out = room(out, n, shots)
    n = cross_all(lanes, pixels, shots, live, shots, planes, flags, num, iv, out, n, tally)
    for k in range(shots):
        if lanes[END + k] >= lanes[LEVEL_ON + k] or lanes[END + k] <= lanes[LEVEL_OFF + k]:
            i, s = pixels[k] - p0, lanes[WHEN + k]
            one_lane, one_pixel = np.empty(FREE, np.float64), np.empty(1, np.int64)
            out, n = walk_pixel(
                block, scratch, i, s, p0, one_lane, one_pixel, keys, chance, 0, knots, 0, planes, flags, num, iv, out, n,
                tally,
            )  # fmt: skip
    for k in range(left):
        j = others[k]
        keys[k], chance[k] = keys[j], chance[j]
        flagged[place_of_candidate(keys[k], iv)[0]] = 1
    return left, out, n
