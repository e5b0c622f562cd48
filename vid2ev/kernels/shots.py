"""Shot noise in pixels where nothing else happens in the interval: a batch of resets instead of a walk for each.

Almost all shots are of this kind.  The memory goes to the signal at the shot's instant; as the signal hardly moves from
there to the end of the interval, no level is reached again, whatever thresholds are drawn.
"""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_cache import inner
from vid2ev.kernels.crossing import AT, LABEL, SHOT, UP, WHEN
from vid2ev.kernels.forced import place_of_candidate
from vid2ev.kernels.general import path_of, value
from vid2ev.kernels.layout import HIGH, LAG1, LANE_COUNT, PITCH
from vid2ev.kernels.scan import CLOCK, NEW1, turns_at
from vid2ev.physics.mismatch import FLOOR


@inner
def is_lonely(block, scratch, flagged, keys, chance, forced, j, still, flags, iv):
    """Whether candidate j is a shot, the only one of a good pixel that reaches no level, and does not turn far away."""
    i = place_of_candidate(keys[j], iv)[0]
    if chance[j] == 0.0 or flagged[i] != 0 or not block[HIGH * PITCH + i] < np.inf:
        return False
    if j > 0 and place_of_candidate(keys[j - 1], iv)[0] == i:
        return False
    if j + 1 < forced and place_of_candidate(keys[j + 1], iv)[0] == i:
        return False
    if len(flags.poles) == 0 or not turns_at(block, scratch, i, flags):
        return True
    if len(flags.poles) == 2 or len(flags.log_input) == 0 or len(flags.noise):
        return False
    # The slope of a pole is its rate times its lag, and within the interval a lag stays between its values at the ends.
    rate = np.float64(scratch[CLOCK + i]) if len(flags.light_bandwidth) else iv.a
    return rate * max(abs(block[LAG1 * PITCH + i]), abs(scratch[NEW1 + i])) < 0.5 * still


@inner
def smallest_threshold(pixel, theta, flags, num):
    """How far the signal of a pixel must go from its memory, at least, to reach a level [nat]."""
    smallest = min(num.threshold_on, num.threshold_off)
    if len(flags.mismatch):
        smallest = np.float64(min(theta[pixel, 0], theta[pixel, 1]))
    return FLOOR * smallest if len(flags.crossing_noise) else smallest


@inner
def aim(block, scratch, flagged, keys, chance, forced, p0, lanes, pixels, shots, planes, flags, num, iv):
    """Load the lonely shots of a block and flag the pixels of the other candidates: (candidates left, shots loaded)."""
    others, left = np.empty(forced, np.int64), 0
    for j in range(forced):
        i, s = place_of_candidate(keys[j], iv)
        still = smallest_threshold(p0 + i, planes.theta, flags, num)
        lonely = shots < LANE_COUNT and is_lonely(block, scratch, flagged, keys, chance, forced, j, still, flags, iv)
        if lonely:
            path = path_of(block, scratch, i, flags, num, iv)
            here = value(path, s)
            lonely = abs(value(path, 1.0) - here) < 0.5 * still
            lanes[AT + shots], lanes[WHEN + shots], pixels[shots] = here, s, p0 + i
            lanes[UP + shots], lanes[LABEL + shots] = 1.0 if chance[j] > 0.0 else 0.0, SHOT
        if lonely:
            shots += 1
        else:
            others[left] = j
            left += 1
    for k in range(left):
        keys[k], chance[k] = keys[others[k]], chance[others[k]]
        flagged[place_of_candidate(keys[k], iv)[0]] = 1
    return left, shots
