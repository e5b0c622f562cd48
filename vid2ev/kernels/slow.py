"""The slow path: events of the pixels that the scan flagged, some blocks' worth at a time.

Monotone piece by monotone piece (`response`): which levels are reached (`ladder`), when (`straight` or `roots`), and
what that leaves behind and sends (`crossing`).  Memories that jump to the signal go by rounds of their own (`blind`).
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.blind import climb_seeing
from vid2ev.kernels.company import anyone
from vid2ev.kernels.crossing import AT, LABEL, WHEN, fresh_thresholds, leave_levels, load_thresholds, send
from vid2ev.kernels.ladder import FIRST, RUNGS, STEP, count_rungs, few, lanes_with_more, next_rungs
from vid2ev.kernels.layout import LANE_COUNT, lane
from vid2ev.kernels.response import load_responses, next_pieces, prepare_responses
from vid2ev.kernels.roots import batch_times, lane_times
from vid2ev.kernels.straight import line_times, load_lines, prepare_lines, send_lines

IN_PLACE = LANE_COUNT > 1  # of one lane a batch is its crossing, whatever it holds: one solver is enough


@inner
def load(block, scratch, lanes, pixels, hits, count, p0, flags):
    """Load the flagged pixels of a block into lanes."""
    if len(flags.straight):
        load_lines(block, scratch, lanes, pixels, hits, count, p0, flags)
    else:
        load_responses(block, scratch, lanes, pixels, hits, count, p0, flags)


@inner
def climb(work, count, planes, flags, num, iv, out, n, tally):
    """All events of `count` loaded lanes: (out, n)."""
    if len(flags.straight):
        prepare_lines(work.lanes, count, flags, num, iv)
    else:
        prepare_responses(work, count, slower_rate(flags, iv), flags, num, iv)
        if len(flags.track):
            return climb_seeing(work, count, slower_rate(flags, iv), planes, flags, num, iv, out, n, tally)
    while anyone(count > 0):
        count = few(count)
        load_thresholds(work.lanes, work.pixels, count, planes, flags, num)
        if len(flags.labels):
            for j in range(LABEL, LABEL + count):
                work.lanes[j] = 0.0
        out, n = take_piece(work, count, planes, flags, num, iv, out, n, tally)
        leave_levels(work.lanes, work.pixels, count, planes, flags, num)
        if len(flags.straight):
            break
        count = next_pieces(work, count, slower_rate(flags, iv), flags, num)
    return out, n


@inner
def slower_rate(flags, iv):
    """The rate of the second pole."""
    return iv.b if len(flags.poles) == 2 else 0.0


@inner
def take_piece(work, count, planes, flags, num, iv, out, n, tally):
    """Events of each lane's piece, the memories in AT: (out, n)."""
    if len(flags.straight) == 0:
        for j in range(WHEN, WHEN + count):
            work.lanes[j] = 0.0
    if len(flags.crossing_noise):
        return drawn_levels(work, count, planes, flags, num, iv, out, n, tally)
    if len(flags.uncounted):
        return steady_levels(work, count, planes, flags, num, iv, out, n, tally)
    crossings = count_rungs(work.lanes, count, num, tally)
    return send_lines(work.lanes, work.pixels, work.stamps, count, crossings, num, iv, out, n)


@inner
def steady_levels(work, count, planes, flags, num, iv, out, n, tally):
    """Events of each lane's piece if its thresholds stay."""
    count_rungs(work.lanes, count, num, tally)
    first = 0
    if len(flags.straight) == 0 and IN_PLACE:
        alive = lanes_with_more(work.lanes, count, work.live, 0.0)
        out, n = send_in_place(work, FIRST, alive, count, planes, flags, num, iv, out, n, tally)
        first = 1
    alive = lanes_with_more(work.lanes, count, work.live, np.float64(first))
    i, rung = 0, first
    while i < alive:
        i, rung, waiting = fill_batch(work.lanes, work.live, alive, work.who, work.levels, i, rung, first, num)
        out, n = send_batch(work, few(waiting), planes, flags, num, iv, out, n, tally)
    return out, n


@inner
def send_in_place(work, level, alive, count, planes, flags, num, iv, out, n, tally):
    """Send one crossing of each of the REACHED lanes live[:alive], at what the plane `level` says: (out, n)."""
    for j in range(count):
        work.levels[j] = work.lanes[level + j]
    b = slower_rate(flags, iv)
    lane_times(work.levels, work.when, work.steps, work.guesses, work.live, alive, count, work.lanes, b, flags, num)
    in_order(work.when, work.live, alive, work.lanes)
    return send(work.when, work.live, alive, work.lanes, work.pixels, planes, flags, num, iv, out, n, tally)


@inner
def send_batch(work, count, planes, flags, num, iv, out, n, tally):
    """Send a batch of crossings `who` at `levels`: (out, n)."""
    if len(flags.straight):
        line_times(work.levels, work.when, work.who, count, work.lanes, num)
    else:
        b = slower_rate(flags, iv)
        batch_times(
            work.levels, work.when, work.steps, work.jobs, work.guesses, work.who, count, work.lanes, b, flags, num
        )
        in_order(work.when, work.who, count, work.lanes)
    return send(work.when, work.who, count, work.lanes, work.pixels, planes, flags, num, iv, out, n, tally)


@inner
def in_order(when, who, count, lanes):
    """No crossing of a piece is before the last one of its lane, the latest in WHEN: after a flash of many decades
    levels are nearer to each other than the signal is known, and each has a root of its own in what rounding left."""
    for k in range(count):
        j = lane(who[k])
        lanes[WHEN + j] = when[k] = max(when[k], lanes[WHEN + j])


@inner
def fill_batch(lanes, live, alive, who, levels, i, rung, first, num):
    """Crossings from a rung of lane live[i] on, as many as fit: (lane and rung that come next, how many).

    Most lanes have one or two from rung `first` on: two are always written, and counted if there are any.
    """
    waiting = 0
    while i < alive:
        j = lane(live[i])
        rungs, level, step = np.int64(lanes[RUNGS + j]), lanes[FIRST + j], lanes[STEP + j]
        some = min(rungs, rung + LANE_COUNT - waiting)
        who[waiting], levels[waiting] = j, level + rung * step
        who[waiting + 1], levels[waiting + 1] = j, level + (rung + 1) * step
        for k in range(2, some - rung):
            who[waiting + k], levels[waiting + k] = j, level + (rung + k) * step
        waiting += some - rung
        if some == num.max_crossings + 1:
            levels[waiting - 1] = lanes[AT + j]
        if some < rungs:
            return i, some, waiting
        i, rung = i + 1, first
    return i, first, waiting


@inner
def drawn_levels(work, count, planes, flags, num, iv, out, n, tally):
    """Events of each lane's piece if its thresholds are drawn anew at each crossing."""
    waiting, climbed = 0, len(flags.straight) > 0 or not IN_PLACE
    while True:
        alive = next_rungs(work.lanes, count, work.live, num, tally)
        if not climbed:
            out, n = send_in_place(work, AT, alive, count, planes, flags, num, iv, out, n, tally)
        else:
            if waiting + alive > LANE_COUNT or alive == 0:
                out, n = send_batch(work, few(waiting), planes, flags, num, iv, out, n, tally)
                waiting = 0
            add_to_batch(work.lanes, work.who, work.levels, work.live, alive, waiting)
            waiting += alive
        if not anyone(alive > 0):
            return out, n
        climbed = True
        fresh_thresholds(work.lanes, work.pixels, work.live, alive, planes, flags, num)


@inner
def add_to_batch(lanes, who, levels, live, alive, waiting):
    """The crossings that the lanes live[:alive] have just made."""
    for k in range(alive):
        j = lane(live[k])
        who[waiting + k], levels[waiting + k] = j, lanes[AT + j]
