"""Shot noise in pixels where nothing else happens in the interval: a batch of resets instead of a walk for each.

Almost all shots are of this kind.  The memory goes to the signal at the shot's instant; as the signal hardly moves from
there to the end of the interval, no level is reached again, whatever thresholds are drawn.  Shots of one pixel are sent
in the order of their time.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.crossing import AT, LABEL, SHOT, UP, WHEN, least_threshold
from vid2ev.kernels.forced import place_of_candidate
from vid2ev.kernels.layout import HIGH, LAG1, LANE_COUNT, PITCH
from vid2ev.kernels.path import path_of, value
from vid2ev.kernels.scan import turns_at
from vid2ev.kernels.scratch import CLOCK, NEW1
from vid2ev.physics.thresholds import FLOOR


@inner
def end_of_pixel(keys, forced, j, iv):
    """The candidate after those of candidate j's pixel."""
    i = place_of_candidate(keys[j], iv)[0]
    j += 1
    while j < forced and place_of_candidate(keys[j], iv)[0] == i:
        j += 1
    return j


@inner
def farthest(block, scratch, i, change, flags, iv):
    """How far the signal of pixel i may go in the rest of an interval, at whose end it has changed by `change`."""
    if len(flags.poles) == 0 or not turns_at(block, scratch, i, flags):
        return abs(change)
    if len(flags.poles) == 2 or len(flags.log_input) == 0 or len(flags.noise):
        return np.inf
    # The slope of a pole is its rate times its lag, and within the interval a lag stays between its values at the ends.
    rate = np.float64(scratch[CLOCK + i]) if len(flags.light_bandwidth) else iv.a
    return abs(change) + rate * max(abs(block[LAG1 * PITCH + i]), abs(scratch[NEW1 + i]))


@inner
def is_below_thresholds(far, pixel, theta, flags, num):
    """Whether a signal that goes no farther than `far` from its memory reaches no level, whatever is drawn."""
    if far < FLOOR * FLOOR * min(num.threshold_on, num.threshold_off):  # below all: this pixel's need not be fetched
        return True
    return far < least_threshold(pixel, theta, flags, num)


@inner
def load_quiet(block, scratch, flagged, keys, chance, first, last, p0, lanes, pixels, shots, planes, flags, num, iv):
    """Load candidates first ... last - 1, those of a pixel, if they are shots of a good one that reaches no level, and
    there is room for all: returns how many, all or none."""
    i = place_of_candidate(keys[first], iv)[0]
    if shots + (last - first) > LANE_COUNT or flagged[i] != 0 or not block[HIGH * PITCH + i] < np.inf:
        return 0
    path = path_of(block, scratch, i, flags, num, iv)
    end = value(path, 1.0)
    for j in range(first, last):
        s, lane = place_of_candidate(keys[j], iv)[1], shots + (j - first)
        here = value(path, s)
        far = farthest(block, scratch, i, end - here, flags, iv) + (iv.leak1 - iv.leak0)
        if chance[j] == 0.0 or not is_below_thresholds(far, p0 + i, planes.theta, flags, num):
            return 0
        lanes[AT + lane], lanes[WHEN + lane], pixels[lane] = here, s, p0 + i
        lanes[UP + lane], lanes[LABEL + lane] = 1.0 if chance[j] > 0.0 else 0.0, SHOT
    return last - first


@inner
def aim(block, scratch, flagged, keys, chance, forced, p0, lanes, pixels, shots, planes, flags, num, iv):
    """Load the shots of a block's quiet pixels and flag the pixels of the other candidates: (candidates left, shots
    loaded)."""
    left, first = 0, 0
    while first < forced:
        last = end_of_pixel(keys, forced, first, iv)
        loaded = load_quiet(
            block, scratch, flagged, keys, chance, first, last, p0, lanes, pixels, shots, planes, flags, num, iv
        )
        shots += loaded
        if loaded == 0:
            flagged[place_of_candidate(keys[first], iv)[0]] = 1
            for j in range(first, last):
                keys[left], chance[left] = keys[j], chance[j]
                left += 1
        first = last
    return left, shots
