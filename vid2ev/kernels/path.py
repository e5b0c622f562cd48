"""The comparator's input of one pixel in one interval, and where it turns and reaches levels: scalar code.

    F(s) = curve(y(s)) + leak + noise,     y the response in the filter's domain, leak and noise linear in s

Where the log is still to come and there is a drift d, F turns where y' + d (y + dark) is 0, or y' + d / slope below a
knee of the curve.  Both are a straight line and two exponentials, as y is: responses whose levels are reached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.kernels.layout import INPUT, PITCH
from vid2ev.kernels.scratch import CLOCK, NEW, NOISE0, NOISE1
from vid2ev.kernels.steep import new_lag, old_lag
from vid2ev.physics.elementary import expm1_64
from vid2ev.physics.log_curve import Curve, light_at, log_level
from vid2ev.physics.photoreceptor import (
    bracketed,
    response,
    response_slope,
    response_terms,
    separate_rates,
    turning_points,
)

ENOUGH = 1e-4  # last step, in units of the faster time constant or of how the slope changes: what is left is its cube
BLINDING = 300.0  # [nat]: beyond all light, and products of three such lights are still numbers
KNOTS = 12  # room for the ends of pieces: each of three responses reaches a level three times at most


class Path(NamedTuple):
    """The comparator's input of one pixel in one interval."""

    y0: float
    end: float  # y(1) from the state that the next interval starts with
    rise: float
    c1: float
    c2: float
    a: float
    b: float
    light: bool  # y is light, and the log is still to come
    base: float  # leak and noise at the start [nat]
    drift: float  # and their rise over the interval
    curve: Curve


@inner
def path_of(block, scratch, i, flags, num, iv):
    """The path of pixel i of the block."""
    poles, two = len(flags.poles), len(flags.poles) == 2
    u0, du = np.float64(block[INPUT * PITCH + i]), np.float64(scratch[NEW + i]) - np.float64(block[INPUT * PITCH + i])
    base, drift = iv.leak0, iv.leak1 - iv.leak0
    if len(flags.noise):
        base += scratch[NOISE0 + i]
        drift += np.float64(scratch[NOISE1 + i]) - np.float64(scratch[NOISE0 + i])
    e1 = old_lag(block, scratch, 1, i, flags) if poles > 0 else 0.0
    e2 = old_lag(block, scratch, 2, i, flags) if two else 0.0
    lag = e2 if two else e1
    after = np.float64(scratch[NEW + i])
    if poles > 0:
        after -= new_lag(scratch, poles, i, flags)
    if len(flags.straight):
        start = u0 - lag
        if len(flags.log_input) == 0:
            start = log_level(max(start, 0.0), num.curve)
            after = log_level(max(after, 0.0), num.curve)
        if num.frame_time:  # it stays as it is until the frame
            return Path(start, after + drift, 0.0, 0.0, 0.0, 0.0, 0.0, False, base, 0.0, num.curve)
        rise = after - start
        return Path(start, after, rise, 0.0, 0.0, 0.0, 0.0, False, base, drift, num.curve)
    b = iv.b if two else 0.0
    a = separate_rates(np.float64(scratch[CLOCK + i]), b) if len(flags.light_bandwidth) else iv.a
    c1, c2 = response_terms(du, e1, e2, a, b, two) if poles > 0 else (0.0, 0.0)
    light = len(flags.log_input) == 0
    return Path(u0 - lag, after, du, c1, c2, a, b, light, base, drift, num.curve)


@inner
def value(path, s):
    """F(s) [nat]."""
    return seen(path, path.end, 1.0) if s >= 1.0 else value_inside(path, s)


@inner
def value_inside(path, s):
    """F(s) [nat] by the response, at the end of the interval, too."""
    return seen(path, response(s, path.y0, path.rise, path.c1, path.c2, path.a, path.b), s)


@inner
def seen(path, y, s):
    """What the comparator sees [nat] of a response that is y at s."""
    if path.light:
        y = log_level(max(y, 0.0), path.curve)
    return y + path.base + path.drift * s


@inner
def response_and_bend(path, s):
    """y(s) and its first two derivatives."""
    m1, m2 = expm1_64(-path.a * s), expm1_64(-path.b * s)
    k1, k2 = path.a * path.c1 * (1.0 + m1), path.b * path.c2 * (1.0 + m2)
    y = path.y0 + (path.rise * s + (path.c1 * m1 + path.c2 * m2))
    return y, path.rise - k1 - k2, path.a * k1 + path.b * k2


@inner
def knots_of(path, knots):
    """Ends of the monotone pieces of F into `knots`, ascending, the last one 1.0; some may not be turning points."""
    n = 0
    if path.light and path.drift != 0.0:
        n = add_reached(slope_of(path, path.drift, path.drift * path.curve.dark), 0.0, knots, n)
        if path.curve.knee > 0.0:
            n = add_reached(slope_of(path, 0.0, path.drift / path.curve.slope), 0.0, knots, n)
            n = add_reached(plain(path.y0, path.end, path.rise, path.c1, path.c2, path), path.curve.knee, knots, n)
            put_in_order(knots, n)
    else:
        for turn in turns_of(path):
            knots[n] = turn
            n += 1
    knots[n] = 1.0


@inner
def put_in_order(numbers, n):
    """Sort the first n numbers, of which there are few."""
    for k in range(1, n):
        number, at = numbers[k], k
        while at > 0 and numbers[at - 1] > number:
            numbers[at] = numbers[at - 1]
            at -= 1
        numbers[at] = number


@inner
def turns_of(path):
    """Turning points of the response, 1.0 where there are none; where F is no log of it, with the drift."""
    rise = path.rise if path.light else path.rise + path.drift
    if path.c1 == 0.0 and path.c2 == 0.0:
        return 1.0, 1.0
    at_0 = response_slope(0.0, rise, path.c1, path.c2, path.a, path.b)
    at_1 = response_slope(1.0, rise, path.c1, path.c2, path.a, path.b)
    return turning_points(at_0, at_1, rise, path.c1, path.c2, path.a, path.b)


@inner
def slope_of(path, share, more):
    """y' + share y + more, which is a response."""
    start, rise, c1, c2 = slope_terms(path.y0, path.rise, path.c1, path.c2, path.a, path.b, share, more)
    return plain(start, response(1.0, start, rise, c1, c2, path.a, path.b), rise, c1, c2, path)


@inner
def slope_terms(y0, rise, c1, c2, a, b, share, more):
    """(y0, rise, c1, c2) of the same."""
    start = rise - a * c1 - b * c2 + share * y0 + more
    return start, share * rise, (share - a) * c1, (share - b) * c2


@inner
def plain(start, end, rise, c1, c2, path):
    """A response that is its own level, with the rates of a path."""
    return Path(start, end, rise, c1, c2, path.a, path.b, False, 0.0, 0.0, path.curve)


@inner
def add_reached(path, level, knots, n):
    """Where a `plain` path reaches a level, ascending, into `knots` from n on; returns how many there are then."""
    first, second = turns_of(path)
    start, begin = 0.0, value(path, 0.0)
    for end in (first, second, 1.0):
        finish = value(path, end)
        if (begin > level) != (finish > level):
            knots[n] = reach(path, level, start, end, begin, finish, finish > level)
            n += 1
        start, begin = end, finish
    return n


@inner
def reach(path, level, lo, hi, begin, end, up):
    """Where F reaches a level between lo and hi, a monotone piece: from `begin` to `end`, which is at or beyond it.

    Bracketed steps of Halley's method from the chord's root, in the filter's domain: light is nearer to a straight
    line and an exponential there than its log.
    """
    if begin == level or (begin > level) == up:  # (where it stays there is no chord)
        return lo
    s, step, fastest = lo + (hi - lo) * ((level - begin) / (end - begin)), hi - lo, max(path.a, path.b)
    for _ in range(80):
        ahead, rate, bend = ahead_of(path, level, s)
        dim = dim_at(path, level, s)
        if (ahead < 0.0) == up:
            lo = s
        else:
            hi = s
        newton = ahead / rate  # (infinite where the slope is 0, which is no reason to stay)
        there = s - newton / (1.0 - 0.5 * newton * (bend / rate))
        here = bracketed(there, s, lo, hi, step)
        step, s = abs(here - s), here
        near = (here == there) & (step * max(max(1.0, abs(bend / rate)), fastest) < ENOUGH)
        if near & (dim_at(path, level, here) == dim) | (step < 1e-13):
            return here
    return s


@inner
def ahead_of(path, level, s):
    """How far y(s) is above what makes a level [nat] of F there, and the first two derivatives of that."""
    y, rate, bend = response_and_bend(path, s)
    there, fall, less = level - path.base - path.drift * s, path.drift, 0.0
    if path.light:
        there, fall, less = moved_light(there, path.drift, path.curve)
    return y - there, rate + fall, bend - less


@inner
def dim_at(path, level, s):
    """Whether a level [nat] of F is below a knee of the curve at s, beyond which its light moves another way."""
    return path.light & (level - path.base - path.drift * s < path.curve.log_knee)


@inner
def moved_light(level, drift, curve):
    """The light of a level [nat], how fast it falls while what is added to the log rises by a drift, and how fast it
    falls less and less."""
    light, dim = light_at(min(level, BLINDING), curve), level < curve.log_knee
    fall = drift / curve.slope if dim else drift * (light + curve.dark)
    return light, fall, 0.0 if dim else drift * fall
