"""Where signals turn that are the log of a response of light, and something that drifts besides: leak, and noise.

The slope of such a signal has the sign of y' + share y + more, which is a response as y is (`path.slope_of`).  Most
lanes go one way by its bounds.  Most of the others turn once, where it is 0: a job for vector code.  The few that may
turn more often go one by one along their `path`.
"""

from __future__ import annotations

from vid2ev.compiling.compiler import inner
from vid2ev.kernels import roots as R
from vid2ev.kernels.ladder import REACHED, reached_lanes
from vid2ev.kernels.lanes import (
    BASE,
    BEND0,
    BEND1,
    C1,
    C2,
    DRIFT,
    LAST,
    NEXT,
    RISE,
    S1,
    SLOPE0,
    SLOPE1,
    STEADY,
    Y0,
    A,
    enter,
)
from vid2ev.kernels.layout import lane
from vid2ev.kernels.path import Path, knots_of, slope_terms
from vid2ev.physics.elementary import log64
from vid2ev.physics.log_curve import log_slope
from vid2ev.physics.photoreceptor import response

NEVER, ONCE, MORE = 0.0, 1.0, 2.0
DRIFTS = 1e-3  # [nat]; the square is below what the scan rounds


@inner
def slope_bounds(rise, k1, k2, end1, end2):
    """What the slope of a response, rise - k1 exp(-a s) - k2 exp(-b s), is between."""
    least = rise - max(k1, k1 * end1) - max(k2, k2 * end2)
    most = rise - min(k1, k1 * end1) - min(k2, k2 * end2)
    return least, most


@inner
def goes_one_way(lanes, j, least, most, curve):
    """Whether lane j's signal does, drift included, as the slope of its light is between `least` and `most`."""
    if lanes[BEND0 + j] * lanes[BEND1 + j] > 0.0:  # the slope is between its ends
        least = max(least, min(lanes[SLOPE0 + j], lanes[SLOPE1 + j]))
        most = min(most, max(lanes[SLOPE0 + j], lanes[SLOPE1 + j]))
    y0, drift = lanes[Y0 + j], lanes[DRIFT + j]
    dimmest = drift / log_slope(max(y0 + min(least, 0.0), 0.0), curve)  # in light
    brightest = drift / log_slope(max(y0 + max(most, 0.0), 0.0), curve)
    return (least + min(dimmest, brightest) > 0.0) | (most + max(dimmest, brightest) < 0.0)


@inner
def split_drifting(work, count, b, flags, num):
    """Let the first piece of lanes that may turn, drift included, end where they do."""
    lanes, live = work.lanes, work.live
    for j in range(count):
        lanes[REACHED + j] = 1.0 - lanes[STEADY + j]
    some = reached_lanes(lanes, count, live)
    slopes_to_jobs(work, some, b, num)
    left = R.approach(work.levels, work.when, work.steps, work.jobs, work.guesses, some, b, flags.poles, (), num)
    for k in range(some):
        j, turns, turn = lane(live[k]), work.jobs[R.WAY + k], work.when[k]
        if turns == ONCE:
            if not work.steps[k] < R.ENOUGH:
                turn = R.finish(work.levels, work.jobs, turn, k, b, flags.poles, (), num, left)
            enter(lanes, j, 0.0, lanes[Y0 + j], turn, b)
        elif turns != NEVER:
            knots_of_lane(lanes, j, work.knots, b, num)
            enter(lanes, j, 0.0, lanes[Y0 + j], first_after(0.0, work.knots), b)
            lanes[NEXT + j] = first_after(lanes[S1 + j], work.knots)


@inner
def slopes_to_jobs(work, some, b, num):
    """The slopes of the lanes live[:some] as jobs at a level of 0, in the part of the interval where they reach it
    once; the WAY tells how often the signal turns.

    Without a drift a slope has one turning point at most, where the response has its inflection: between it and the
    ends it goes one way.  With one of d nats it may turn again where it is nearly 0 for long, as the light falls as
    fast as the drift rises; what the signal does between such turns is d squared at most.
    """
    lanes, jobs, live = work.lanes, work.jobs, work.live
    for k in range(some):
        j = lane(live[k])
        a, drift, k1, k2 = lanes[A + j], lanes[DRIFT + j], lanes[A + j] * lanes[C1 + j], b * lanes[C2 + j]
        start, rise, c1, c2 = slope_terms(
            lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], a, b, drift, drift * num.curve.dark
        )
        ratio = -(b * k2) / (a * k1)
        usable = (ratio > 1e-300) & (ratio < 1e300)
        bend = log64(ratio if usable else 1.0) / (b - a)
        bend = bend if usable & (bend > 0.0) & (bend < 1.0) else 0.0
        middle, end = response(bend, start, rise, c1, c2, a, b), response(1.0, start, rise, c1, c2, a, b)
        opposite, before = (start > 0.0) != (end > 0.0), (middle > 0.0) != (start > 0.0)
        simple = (abs(drift) < DRIFTS) & (num.curve.knee == 0.0)
        jobs[R.Y0 + k], jobs[R.RISE + k], jobs[R.C1 + k], jobs[R.C2 + k], jobs[R.A + k] = start, rise, c1, c2, a
        jobs[R.FROM_S + k], jobs[R.FROM_Y + k] = 0.0 if before else bend, start if before else middle
        jobs[R.TO_S + k], jobs[R.TO_Y + k] = bend if before else 1.0, middle if before else end
        jobs[R.WAY + k] = (ONCE if opposite else (MORE if before else NEVER)) if simple else MORE
        work.levels[k] = 0.0


@inner
def knots_of_lane(lanes, j, knots, b, num):
    """Where the pieces of lane j end, into `knots`."""
    path = Path(
        lanes[Y0 + j], lanes[LAST + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j], b, True,
        lanes[BASE + j], lanes[DRIFT + j], num.curve,
    )  # fmt: skip
    knots_of(path, knots)


@inner
def first_after(s, knots):
    """Where the piece ends that begins at s; 1.0 if none does."""
    for knot in knots:
        if knot > s:
            return knot
    return 1.0


@inner
def look_further(lanes, j, knots, b, num):
    """Where the piece after lane j's ends, if there is one."""
    if lanes[S1 + j] < 1.0:
        knots_of_lane(lanes, j, knots, b, num)
        lanes[NEXT + j] = first_after(lanes[S1 + j], knots)
