"""Lanes of pixels whose signal is a filter's response: the job (`roots`) of each, its piece, and the next."""

from __future__ import annotations

from vid2ev.compiling.compiler import inner
from vid2ev.kernels import roots as R
from vid2ev.kernels.ladder import AFTER_LADDER
from vid2ev.kernels.layout import LANE_PITCH
from vid2ev.physics.log_curve import log_level
from vid2ev.physics.photoreceptor import response

# Planes: those of a job; the end of the next piece and of the interval, the levels that the scan compares; slopes and
# curvatures at both ends; 1.0 where the way is the same all the time by bounds of the slope; when a blind time ends.
Y0, RISE, C1, C2, A, S0, F0, S1, F1, BASE, DRIFT = (
    AFTER_LADDER + plane
    for plane in (R.Y0, R.RISE, R.C1, R.C2, R.A, R.FROM_S, R.FROM_Y, R.TO_S, R.TO_Y, R.BASE, R.DRIFT)
)
NEXT, LAST, UPPER, LOWER, SLOPE0, SLOPE1, BEND0, BEND1, STEADY, BLIND = (
    AFTER_LADDER + R.JOBS + k * LANE_PITCH for k in range(10)
)
LANES = BLIND + LANE_PITCH


@inner
def response_at(lanes, j, s, b):
    """Lane j's response at s; at the end of the interval from the state that the next one starts with."""
    inside = response(s, lanes[Y0 + j], lanes[RISE + j], lanes[C1 + j], lanes[C2 + j], lanes[A + j], b)
    return inside if s < 1.0 else lanes[LAST + j]


@inner
def seen_at(lanes, j, y, s, flags, num):
    """What the comparator sees [nat] of lane j, the response of which is y at s."""
    # (light has a floor of 0: after a flash of many decades the arithmetic may leave less than nothing of it)
    nats = y if len(flags.log_input) else log_level(max(y, 0.0), num.curve)
    if len(flags.drift):
        nats += lanes[BASE + j] + lanes[DRIFT + j] * s
    return nats


@inner
def end_in_nats(lanes, j, flags, num):
    """Where lane j's piece leads [nat]."""
    return seen_at(lanes, j, lanes[F1 + j], lanes[S1 + j], flags, num)


@inner
def enter(lanes, j, start, begin, stop, b):
    """Let the piece of lane j be from `start`, where its response is at `begin`, to `stop`."""
    lanes[S0 + j], lanes[F0 + j], lanes[S1 + j], lanes[F1 + j] = start, begin, stop, response_at(lanes, j, stop, b)
