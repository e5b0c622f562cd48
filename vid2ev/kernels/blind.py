"""Slow path of pixels that are blind after an event, and whose memories then jump to the signal (`track`).

Which levels such a pixel reaches is not known from where its signal goes.  So lanes go on in rounds: those that become
able to see in their piece do, then those that cross a level there, once, and are blind from then on.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.company import anyone
from vid2ev.kernels.crossing import (
    AT,
    LABEL,
    LEVEL_OFF,
    LEVEL_ON,
    UP,
    fresh_thresholds,
    leave_levels,
    load_thresholds,
    send,
)
from vid2ev.kernels.ladder import END, REACHED, RUNGS, few
from vid2ev.kernels.lanes import BLIND, F0, S0, S1, response_at, seen_at
from vid2ev.kernels.layout import CAPPED, HIGH, LOW, PITCH, lane, place_of, stride_of
from vid2ev.kernels.response import next_piece
from vid2ev.kernels.roots import batch_times


@inner
def blind_until(pixel, planes, num, iv):
    """When the blind time of a pixel ends, or ended, as a fraction of the interval: the same in every interval."""
    return np.float64(planes.t_last[pixel] + num.refractory_ns - iv.t0_ns) / iv.dt_ns


@inner
def note_jump(pixel, planes, flags, num):
    """The leak begins anew where the memory of a pixel jumps to the signal, as its blind time ends."""
    if len(flags.labels) and len(flags.leak):
        planes.t_reset[pixel] = planes.t_last[pixel] + num.refractory_ns


@inner
def stay_blind(pixel, planes, flags):
    """Levels of a pixel that is blind at the end of an interval: it is looked at in every one until they are known."""
    at = place_of(pixel, stride_of(flags))
    planes.fast[at + HIGH * PITCH], planes.fast[at + LOW * PITCH] = -np.inf, np.inf


@inner
def climb_seeing(work, count, b, planes, flags, num, iv, out, n, tally):
    """All events of `count` lanes, each on its first piece: (out, n)."""
    lanes, pixels, live = work.lanes, work.pixels, work.live
    load_thresholds(lanes, pixels, count, planes, flags, num)
    for j in range(count):
        live[j], lanes[BLIND + j] = j, blind_until(pixels[j], planes, num, iv)
        lanes[LABEL + j] = 0.0
    left = np.int64(count)
    while anyone(left > 0):
        left = few(left)
        see(work, few(seeing(lanes, live, left, work.who)), b, planes, flags, num)
        some = few(reaching(lanes, live, left, work.who, work.levels, num, tally))
        batch_times(work.levels, work.when, work.steps, work.jobs, work.guesses, work.who, some, lanes, b, flags, num)
        out, n = turn_blind(work, some, planes, flags, num, iv, out, n, tally)
        left = with_more(work, left, b, flags, num)
    leave_levels(lanes, pixels, count, planes, flags, num)
    for j in range(count):
        if lanes[BLIND + j] > 1.0:
            stay_blind(pixels[j], planes, flags)
    return out, n


@inner
def seeing(lanes, live, left, who):
    """The lanes of live[:left] that become able to see in their piece, into `who`; returns their number."""
    some = np.int64(0)
    for k in range(left):
        j = lane(live[k])
        until = lanes[BLIND + j]
        who[some] = j
        some += np.int64((until > lanes[S0 + j]) & (until <= lanes[S1 + j]))
    return some


@inner
def see(work, some, b, planes, flags, num):
    """The memories of the lanes who[:some] jump to the signal, and their pieces begin there."""
    lanes, who = work.lanes, work.who
    for k in range(some):
        j = lane(who[k])
        s = lanes[BLIND + j]
        y = response_at(lanes, j, s, b)
        lanes[AT + j] = seen_at(lanes, j, y, s, flags, num)
        lanes[S0 + j], lanes[F0 + j] = s, y
        note_jump(work.pixels[j], planes, flags, num)
    fresh_thresholds(lanes, work.pixels, who, some, planes, flags, num)


@inner
def reaching(lanes, live, left, who, levels, num, tally):
    """The lanes of live[:left] that see and reach a level in their piece, into `who`, their memories there, these into
    `levels`, too; returns their number."""
    cap, some, over = np.float64(num.max_crossings), np.int64(0), np.int64(0)
    for k in range(left):
        j = lane(live[k])
        end, at = lanes[END + j], lanes[AT + j]
        up = end >= at + lanes[LEVEL_ON + j]
        reached = (up | (end <= at - lanes[LEVEL_OFF + j])) & (lanes[BLIND + j] <= lanes[S0 + j])
        capped = reached & (lanes[RUNGS + j] >= cap)
        level = at + lanes[LEVEL_ON + j] if up else at - lanes[LEVEL_OFF + j]
        level = end if capped else level
        lanes[AT + j] = level if reached else at
        lanes[UP + j], lanes[REACHED + j] = 1.0 if up else 0.0, 1.0 if reached else 0.0
        lanes[RUNGS + j] += 1.0
        who[some], levels[some] = j, level
        some += np.int64(reached)
        over += np.int64(capped)
    tally[CAPPED] += over
    return some


@inner
def turn_blind(work, some, planes, flags, num, iv, out, n, tally):
    """Send the crossings of the lanes who[:some], which see nothing for a while then: (out, n)."""
    lanes, who, when = work.lanes, work.who, work.when
    for k in range(some):
        j = lane(who[k])
        lanes[S0 + j] = when[k] = max(when[k], lanes[S0 + j])
    out, n = send(when, who, some, lanes, work.pixels, planes, flags, num, iv, out, n, tally)
    fresh_thresholds(lanes, work.pixels, who, some, planes, flags, num)
    for k in range(some):
        j = lane(who[k])
        lanes[BLIND + j] = blind_until(work.pixels[j], planes, num, iv)
    return out, n


@inner
def with_more(work, left, b, flags, num):
    """Keep those of live[:left] that see again in the interval, or have another piece; returns their number."""
    lanes, live, kept = work.lanes, work.live, np.int64(0)
    for k in range(left):
        j = lane(live[k])
        live[kept] = j
        if lanes[REACHED + j] > 0.0:
            kept += np.int64(lanes[BLIND + j] <= 1.0)
        elif lanes[S1 + j] < 1.0:
            next_piece(lanes, j, work.knots, b, flags, num)
            kept += 1
    return kept
