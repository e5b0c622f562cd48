"""Which levels a pixel reaches: from its memory, rung by rung, to where its signal goes.

Along a monotone piece of the signal the crossings are known from the signal's end alone, before any crossing time is.
Thresholds that stay make the rungs an equal step apart, and their number a quotient; thresholds that are drawn anew at
each crossing are climbed in rounds, all lanes together.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.compiling.intrinsics import floor
from vid2ev.kernels.crossing import AT, FREE, LEVEL_OFF, LEVEL_ON, UP
from vid2ev.kernels.layout import CAPPED, LANE_COUNT, LANE_PITCH, lane

# Where the signal goes [nat]; crossings so far; the first level and the step to the next; whether there is one.
END, RUNGS, FIRST, STEP, REACHED = (FREE + k * LANE_PITCH for k in range(5))
AFTER_LADDER = FREE + 5 * LANE_PITCH


@inner
def count_rungs(lanes, count, num, tally):
    """RUNGS, FIRST, STEP and UP of lanes whose thresholds stay; AT moves to the last rung.  Returns the number in all.

    Beyond the work cap the memory goes to the signal, in one crossing.
    """
    cap, crossings, over = np.float64(num.max_crossings), np.int32(0), np.int32(0)
    for j in range(count):
        end, at = lanes[END + j], lanes[AT + j]
        up = end >= at + lanes[LEVEL_ON + j]
        step = lanes[LEVEL_ON + j] if up else -lanes[LEVEL_OFF + j]
        first = at + step
        rungs = max(floor((end - first) / step) + 1.0, 0.0)
        last = first + (rungs - 1.0) * step
        # The quotient may round a rung away that the levels left behind would find at the next interval's start.
        further = last + step
        more = (rungs > 0.0) & ((end >= further) if up else (end <= further))
        rungs, last = rungs + 1.0 if more else rungs, further if more else last
        capped = rungs > cap
        last = end if capped else last
        rungs = cap + 1.0 if capped else rungs
        crossings = np.int32(crossings + np.int32(rungs))
        over = np.int32(over + np.int32(capped))
        lanes[AT + j] = last if rungs > 0.0 else at
        lanes[RUNGS + j], lanes[UP + j] = rungs, 1.0 if up else 0.0
        lanes[FIRST + j], lanes[STEP + j] = first, step
    tally[CAPPED] += over
    return crossings


@inner
def next_rungs(lanes, count, live, num, tally):
    """One more crossing of each lane that has one: AT moves to it.  Their lanes into `live`; returns their number."""
    cap, over = np.float64(num.max_crossings), np.int32(0)
    for j in range(count):
        end, at, rungs = lanes[END + j], lanes[AT + j], lanes[RUNGS + j]
        up = end >= at + lanes[LEVEL_ON + j]
        reached = up | (end <= at - lanes[LEVEL_OFF + j])
        level = at + lanes[LEVEL_ON + j] if up else at - lanes[LEVEL_OFF + j]
        capped = reached & (rungs >= cap)
        lanes[AT + j] = end if capped else (level if reached else at)
        lanes[REACHED + j], lanes[RUNGS + j] = 1.0 if reached else 0.0, rungs + 1.0
        # (whoever has crossed goes on the same way: what waits to be sent reads it)
        lanes[UP + j] = (1.0 if up else 0.0) if reached else lanes[UP + j]
        over = np.int32(over + np.int32(capped))
    tally[CAPPED] += over
    return reached_lanes(lanes, count, live)


@inner
def lanes_with_more(lanes, count, live, rungs):
    """The lanes with more than so many RUNGS into `live`; returns their number."""
    for j in range(count):
        lanes[REACHED + j] = 1.0 if lanes[RUNGS + j] > rungs else 0.0
    return reached_lanes(lanes, count, live)


@inner
def reached_lanes(lanes, count, live):
    """Indices of the lanes that are REACHED into `live`; returns their number."""
    left = 0
    for j in range(count):
        live[left] = j
        left += np.int64(lanes[REACHED + j])
    return few(left)


@inner
def few(count):
    """A number of lanes, of which there are no more than LANE_COUNT: a compiler for lanes of one pixel then knows that
    loops over them are none, which makes a quarter of the code."""
    return np.int64(count > 0) if LANE_COUNT == 1 else min(count, np.int64(LANE_COUNT))


@inner
def keep_lanes(lanes, first, last, pixels, live, alive):
    """Move the lanes live[:alive] (ascending) to the front, in the planes from `first` to `last`."""
    for start in range(first, last, LANE_PITCH):
        plane = lanes[start : start + LANE_PITCH]
        for k in range(alive):
            plane[k] = plane[lane(live[k])]
    for k in range(alive):
        pixels[k] = pixels[lane(live[k])]
