"""Slow path for everything at once: one pixel, one interval, scalar code.

Used where the closed forms of the two fast slow paths do not hold: a drift or noise added after a low-pass before the
log, forced events, photoreceptor noise that the interval does not resolve, and the refractory kind `track`.  The
comparator's input is

    F(s) = curve(y(s)) + leak + noise,     y the response in the filter's domain, leak and noise linear in s

and is followed from knot to knot: turning points, forced events, the end of a refractory period.  With `timing =
"frame"` F stays at its start until the frame is there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import inner
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
from vid2ev.kernels.layout import CAPPED, HIGH, INPUT, LOW, PITCH
from vid2ev.kernels.scan import CLOCK, NEW, NOISE0, NOISE1, new_lag, old_lag
from vid2ev.kernels.sink import put, room
from vid2ev.physics.elementary import expm1_64
from vid2ev.physics.log_curve import Curve, light_at, log_level, log_slope
from vid2ev.physics.photoreceptor import (
    bracketed,
    response,
    response_slope,
    response_terms,
    separate_rates,
    turning_points,
)
from vid2ev.physics.photoreceptor_noise import fresh_share, rice_expected, rice_gap, rice_words
from vid2ev.physics.random import unit

ENOUGH = 1e-4  # last step, in units of the faster time constant or of how the slope changes: what is left is its cube
KNOTS = 8  # room for the ends of the pieces: three of the response, each cut once at most


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
    y = path.end if s >= 1.0 else response(s, path.y0, path.rise, path.c1, path.c2, path.a, path.b)
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
def slope_and_bend(path, s):
    """dF/ds [nat per interval] of light, and the derivative of that."""
    y, rate, bend = response_and_bend(path, s)
    per_light = log_slope(max(y, 0.0), path.curve)
    rate *= per_light
    return rate + path.drift, bend * per_light - (0.0 if y < path.curve.knee else rate * rate)


@inner
def knots_of(path, knots):
    """Ends of the monotone pieces of F into `knots`, ascending, the last one 1.0.

    First the turning points of the response, then, as a drift moves them, a sign change of dF/ds within each piece.
    """
    rise = path.rise if path.light else path.rise + path.drift
    c1, c2, a, b = path.c1, path.c2, path.a, path.b
    first, second = 1.0, 1.0
    if c1 != 0.0 or c2 != 0.0:
        slope_0, slope_1 = response_slope(0.0, rise, c1, c2, a, b), response_slope(1.0, rise, c1, c2, a, b)
        first, second = turning_points(slope_0, slope_1, rise, c1, c2, a, b)
    n, start = 0, 0.0
    for end in (first, second, 1.0):
        if path.light and path.drift != 0.0:
            at_start, at_end = slope_and_bend(path, start)[0], slope_and_bend(path, end)[0]
            if (at_end > 0.0) != (at_start > 0.0):
                knots[n] = level_at(path, start, end, at_start, at_end)
                n += 1
        knots[n] = end
        n += 1
        start = end
        if end >= 1.0:
            break


@inner
def level_at(path, lo, hi, at_lo, at_hi):
    """Where dF/ds, which has other signs at lo and at hi, is 0."""
    s, step, enough = lo + (hi - lo) * at_lo / (at_lo - at_hi), hi - lo, 1e-8 / max(1.0, max(path.a, path.b))
    for _ in range(60):
        rate, bend = slope_and_bend(path, s)
        if (rate > 0.0) == (at_lo > 0.0):
            lo = s
        else:
            hi = s
        here = bracketed(s - rate / bend, s, lo, hi, step)
        step, s = abs(here - s), here
        if step < enough:
            break
    return s


@inner
def reach(path, level, lo, hi, begin, end, up):
    """Where F reaches a level between lo and hi, a monotone piece: from `begin` to `end`, which is at or beyond it.

    Bracketed steps of Halley's method from the chord's root, in the filter's domain: light is nearer to a straight
    line and an exponential there than its log.
    """
    if (begin >= level) == up:
        return lo
    s, step, fastest = lo + (hi - lo) * min((level - begin) / (end - begin), 1.0), hi - lo, max(path.a, path.b)
    for _ in range(80):
        ahead, rate, bend = ahead_of(path, level, s)
        if (ahead < 0.0) == up:
            lo = s
        else:
            hi = s
        there = s - (ahead * rate) / (rate * rate - 0.5 * ahead * bend)
        here = bracketed(there, s, lo, hi, step)
        step, s = abs(here - s), here
        near = (here == there) & (step * max(max(1.0, abs(bend / rate)), fastest) < ENOUGH)
        if near | (step < 1e-13):
            return here
    return s


@inner
def ahead_of(path, level, s):
    """How far y(s) is above what makes a level [nat] of F there, and the first two derivatives of that; the drift is so
    slow that it hardly bends."""
    y, rate, bend = response_and_bend(path, s)
    there, drift = level - path.base - path.drift * s, path.drift
    if path.light:
        there = light_at(there, path.curve)
        drift /= log_slope(max(there, 0.0), path.curve)
    return y - there, rate + drift, bend


@inner
def next_rice(path, knots, s, k, on, off, pixel, num, iv):
    """Candidate k of the unresolved noise after s: (its s, the expected number it stands for)."""
    top, bottom = value(path, 0.0), value(path, 0.0)
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
    piece, s, begin, solved, candidate = 0, 0.0, value(path, 0.0), 0, 0
    blind_until = -1.0  # end of a refractory period of the kind `track`; a hot pixel has no memory to set then
    if len(flags.track) and good:
        blind_until = np.float64(planes.t_last[pixel] + num.refractory_ns - iv.t0_ns) / iv.dt_ns
    rice_s, expected = next_rice(path, knots, s, 0, on, off, pixel, num, iv) if rice else (2.0, 0.0)
    while True:
        forced_s = 2.0
        if j < forced:
            whose, when = place_of_candidate(keys[j], iv)
            forced_s = when if whose == i else 2.0
        blind = blind_until > s
        blind_s = blind_until if blind else 2.0
        stop = min(min(knots[piece], forced_s), min(rice_s, blind_s))
        end = value(path, stop)
        if not blind and (end >= on or end <= off):
            up = end >= on
            at = on if up else off
            here = stop if num.frame_time else reach(path, at, s, stop, begin, end, up)
            solved += 1
            if solved > num.max_crossings:
                tally[CAPPED] += 1
                here, at = stop, end
            s, begin = here, at
            on, off, out, n = cross_one(lanes, pixels, pixel, up, at, s, SIGNAL, planes, flags, num, iv, out, n, tally)
            if len(flags.track):
                blind_until = s + num.refractory_ns / iv.dt_ns
            if rice:
                candidate += 1
                rice_s, expected = next_rice(path, knots, s, candidate, on, off, pixel, num, iv)
            continue
        s, begin = stop, end
        if stop == blind_s:
            pixels[0], lanes[AT] = pixel, end
            fresh_thresholds(lanes, pixels, pixels[1:], 1, planes, flags, num)
            leave_levels(lanes, pixels, 1, planes, flags, num)
            on, off = lanes[LEVEL_ON], lanes[LEVEL_OFF]
            blind_until = -1.0
        elif stop == forced_s:
            on, off, out, n = force(
                lanes, pixels, pixel, s, end, chance[j], on, off, planes, flags, num, iv, out, n, tally
            )
            if len(flags.track) and good:
                blind_until = np.float64(planes.t_last[pixel] + num.refractory_ns - iv.t0_ns) / iv.dt_ns
            j += 1
        elif stop == rice_s:
            polarity = accept_rice(path, s, candidate, expected, on, off, pixel, num, iv)
            candidate += 1
            if polarity != 0 and not blind:
                at = on if polarity > 0 else off
                on, off, out, n = cross_one(
                    lanes, pixels, pixel, polarity > 0, at, s, SIGNAL, planes, flags, num, iv, out, n, tally
                )
                if len(flags.track):
                    blind_until = s + num.refractory_ns / iv.dt_ns
            rice_s, expected = next_rice(path, knots, s, candidate, on, off, pixel, num, iv)
        elif knots[piece] >= 1.0:
            break
        else:
            piece, solved = piece + 1, 0
    if blind_until > 1.0:  # the levels are not known before the blind time ends: look at every interval until then
        block[HIGH * PITCH + i], block[LOW * PITCH + i] = -np.inf, np.inf
    return out, n


@inner
def force(lanes, pixels, pixel, s, end, chance, on, off, planes, flags, num, iv, out, n, tally):
    """A forced candidate at s, where the signal is `end`: (c_on, c_off, out, n)."""
    t_ns = iv.t0_ns + np.int64(s * iv.dt_ns)
    blind = num.refractory_ns > 0 and t_ns - planes.t_last[pixel] < num.refractory_ns
    if chance == 0.0:  # a hot pixel
        if not blind:
            planes.t_last[pixel % planes.t_last.size] = t_ns
            out = room(out, n, 1)
            n = put(out, n, key_of(s * iv.dt_ns, pixel, np.int64(1), HOT, iv), True)
        return on, off, out, n
    if on == np.inf or (blind and len(flags.track)):
        return on, off, out, n
    return cross_one(lanes, pixels, pixel, chance > 0.0, end, s, SHOT, planes, flags, num, iv, out, n, tally)
