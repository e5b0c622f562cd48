"""Sleep: strips of pixels in which nothing can happen are not walked, and nothing shows it.

A strip is 256 pixels of a row, or what follows them in the next.  If it sees light of the same bits as in the frame
before, by what its frame says or by looking, it

    sleeps   if its lags are 0: then an interval changes nothing in it, whatever its length;
    naps     if the hull of its inputs and lags lies between the levels of every pixel: then an interval does no more
             than step the lags, which is made up for, step by step with each interval's weights, before they are used
             (`naps`).

Events that are forced in such a strip go the usual way, their pixels alone: a shot takes the signal as the new memory,
and a threshold is never so small that what is left of the hull or some leak would reach it (`stir`).

To ask takes time where everything changes, and so do events in strips that sleep: where many shots are expected in an
interval, all strips are awake.  A strip that was asked in vain, as its light had changed or it was not at
rest, is not asked in the next interval; after that not in the next three, and from then on only in every eighth.  What
frames say costs nothing.

The light of the frame before is in the state, as the walk takes it: mended, with shading, or as a level.

The hull contains the signal at all times (`physics.photoreceptor`: the weights of a step are positive and their sum is
at most 1).  In float32 a lag of the first pole never grows in steady light, rounding included, and one of the second by
less than 2e-7 of the larger lag in a step, of which a nap has LONGEST at most: that is what SLACK is for.

A pixel at, or within rounding of, a level is flagged by every scan, and the slow path finds nothing, because the end of
the interval before was at the same signal: such a pixel does not keep its strip awake once its lags are too small for
the signal to have them in float64.

Leak lifts all signals alike; a strip sleeps until it would lift the first one to its level.  Photoreceptor noise moves
every pixel in every interval: with it nothing sleeps.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import inner
from vid2ev.compiling.intrinsics import bits_32
from vid2ev.kernels.crossing import least_threshold
from vid2ev.kernels.forced import place_of_candidate
from vid2ev.kernels.layout import BLOCK, HIGH, INPUT, LAG1, LAG2, LOW, PITCH, STRIP, last_light
from vid2ev.kernels.naps import AWAKE, LONGEST, NAPS, SLEEPS, borrow, catch_up
from vid2ev.kernels.scan import HIGHEST
from vid2ev.kernels.scratch import NEW, NOISE0
from vid2ev.kernels.steep import STEEP
from vid2ev.physics.elementary import exp64, log64
from vid2ev.physics.log_curve import log_level_32

F = np.float32
SLACK, ROUNDING = F(1e-4), F(3e-7)  # of the larger lag, and of the input
NATS = F(4e-6)  # what rounding may be in a level of some nats
ROOM = NOISE0  # a plane of the scratch: where pixels sleep there is no noise
FEW = 32  # pixels
STIRRED = 3.0  # shots expected in a strip: with more, to walk it takes less than to stir what sleeps
PATIENCE = np.uint8(7)  # intervals
TINY, LEAST = F(1e-30), F(1e-12)  # lags that a signal of at least LEAST does not have in float64


@inner
def doze(block, scratch, p0, size, theta, naps, flags, num, iv):
    """Let those strips of a block sleep in which nothing but what is forced happens in this interval; returns how many
    of them do.  The lags of the others are made up for.  Unless they are told which strips keep their light, it is in
    the scratch, mended, and stays there.
    """
    asleep, at = 0, last_light(flags) if len(flags.light_bandwidth) else np.int64(INPUT * PITCH)
    stirred = len(flags.forced) > 0 and num.shot_rate_hz * iv.dt_ns * 1e-9 * STRIP > STIRRED
    for first in range(0, size, STRIP):
        strip, n = (p0 + first) // STRIP, min(STRIP, size - first)
        if stirred:
            rouse(block[first:], scratch[first:], strip, n, naps, flags, num)
            continue
        if naps.unasked[strip] > 0:  # (awake, and up to date)
            naps.unasked[strip] -= np.uint8(1)
            continue
        told = naps.told.size > 0
        same = naps.told[strip] > 0 if told else is_seen(block, at + first, scratch, NEW + first, n, flags, num)
        if same:
            if not sleeps_on(naps.state[strip], naps.until[strip], naps.since[strip], naps.tick, iv.leak1):
                settle_down(block[first:], scratch[first:], strip, n, theta, naps, flags, num, iv)
        else:
            rouse(block[first:], scratch[first:], strip, n, naps, flags, num)
        wakes = naps.state[strip] == AWAKE
        asleep += np.int64(not wakes)
        leave_alone(naps.unasked, naps.patience, strip, wakes and (same or not told))
    naps.slept[p0 // BLOCK] += asleep
    return asleep


@inner
def rouse(block, scratch, strip, n, naps, flags, num):
    """Let a strip be awake; `block` and `scratch` begin at it."""
    naps.state[strip] = AWAKE
    if naps.since[strip] >= 0:
        catch_up(block, scratch, strip, n, naps, flags, num)


@inner
def leave_alone(unasked, patience, strip, in_vain):
    """For how many intervals a strip is not asked again, the longer the more often it was in vain."""
    unasked[strip] = patience[strip] if in_vain else np.uint8(0)
    patience[strip] = min(np.uint8(2 * patience[strip] + 1), PATIENCE) if in_vain else np.uint8(0)


@inner
def next_run(first, p0, size, wanted, state):
    """The next pixels of a block that are awake, from `first` on: (the first of them, the one after the last)."""
    if not wanted:
        return first, size
    while first < size and state[(p0 + first) // STRIP] != AWAKE:
        first += STRIP
    last = first
    while last < size and state[(p0 + last) // STRIP] == AWAKE:
        last += STRIP
    return first, min(last, size)


@inner
def sleeps_on(state, until, since, tick, leak):
    """Whether a strip that keeps its light sleeps, and may go on."""
    # (of numbers: a call with a whole record takes longer than what it asks)
    return (state != AWAKE) & (until > leak) & ((since < 0) | (tick - since < LONGEST))


@inner
def settle_down(block, scratch, strip, n, theta, naps, flags, num, iv):
    """Whether a strip that keeps its light falls asleep; `block` and `scratch` begin at it."""
    if naps.since[strip] >= 0:
        catch_up(block, scratch, strip, n, naps, flags, num)
    pixel = strip * STRIP
    naps.state[strip], naps.until[strip], wide = sleep_of(block, scratch, pixel, n, theta, flags, num, iv)
    naps.calm[strip] = np.uint8(wide == 0)
    naps.since[strip] = naps.tick if naps.state[strip] == NAPS else -1


@inner
def is_seen(seen, at, light, begin, n, flags, num):
    """Whether n pixels of light from `begin` on are those that were seen, from `at` on."""
    few = min(n, FEW)  # (where anything changes, it mostly shows in a few)
    if not are_seen(seen, at, light, begin, few, flags, num):
        return False
    return are_seen(seen, at + few, light, begin + few, n - few, flags, num)


@inner
def are_seen(seen, at, light, begin, n, flags, num):
    """The same, looking at all of them."""
    # (offsets in place of slices: each slice is counted, which takes longer than to look at a strip)
    differ = np.uint32(0)
    for i in range(n):
        value = light[np.uintp(begin) + np.uintp(i)]  # (unsigned: otherwise it may be negative, and does not vectorise)
        if (len(flags.log_input) > 0) & (len(flags.light_bandwidth) == 0):
            value = log_level_32(value, num.curve)
        differ = np.uint32(differ | np.uint32(value != seen[np.uintp(at) + np.uintp(i)]))
    return differ == 0


@inner
def sleep_of(block, scratch, pixel, n, theta, flags, num, iv):
    """(NAPS, SLEEPS or AWAKE; the leak up to which it holds; pixels that are not calm) of a strip in its light."""
    poles = len(flags.poles)
    if poles + len(flags.leak) + len(flags.track) == 0:
        return SLEEPS, np.inf, 0
    restless, moving = np.int32(0), np.int32(0)
    gain, floor = F(exp64(iv.leak0)), F(num.curve.floor)
    for i in range(n):
        lag, top, bottom = hull_of(block, i, flags)
        quiet = is_quiet(block, scratch, i, lag, top, bottom, gain, flags, num, iv)
        if (poles > 0) & (len(flags.log_input) == 0):  # nor will it ever have to be refined
            quiet = quiet & (lag + SLACK * lag <= F(STEEP) * (bottom + floor))
        restless = np.int32(restless + np.int32(quiet == False))  # noqa: E712 (vectorises, `not` does not)
        moving = np.int32(moving + np.int32(is_moving(block, i, flags)))
    if restless > 0:
        return AWAKE, -np.inf, 0
    until = np.inf
    if len(flags.leak):
        until = least_room(scratch, n, flags)
    if until <= iv.leak1:
        return AWAKE, until, 0
    wide = pixels_not_calm(block, pixel, n, theta, flags, num) if len(flags.forced) else 0
    return (NAPS if moving > 0 else SLEEPS), until, wide


@inner
def is_moving(block, i, flags):
    """Whether a lag of pixel i is not 0 to the bit: of -0, as what is below all float32 is left, a step makes 0."""
    if len(flags.poles) == 0:
        return False
    first = bits_32(block[LAG1 * PITCH + i])
    return (first | bits_32(block[LAG2 * PITCH + i]) if len(flags.poles) > 1 else first) != 0


@inner
def hull_of(block, i, flags):
    """(larger lag, top, bottom) of what the signal of pixel i may be in steady light."""
    u = block[INPUT * PITCH + i]
    lag, top, bottom = F(0.0), u, u
    if len(flags.poles) > 0:
        e1 = block[LAG1 * PITCH + i]
        e2 = block[LAG2 * PITCH + i] if len(flags.poles) > 1 else e1
        lag = max(abs(e1), abs(e2))
        top, bottom = max(u, max(u - e1, u - e2)), min(u, min(u - e1, u - e2))
    slack = SLACK * lag + ROUNDING * abs(u)
    return lag, top + slack, bottom - slack


@inner
def pixels_not_calm(block, pixel, n, theta, flags, num):
    """How many signals of a strip have further to go than a share of their least threshold."""
    wide, floor = np.int32(0), F(num.curve.floor)
    for i in range(n):
        _, top, bottom = hull_of(block, i, flags)
        scale = F(1.0) if len(flags.log_input) else bottom + floor
        near = F(0.125 * least_threshold(pixel + i, theta, flags, num))  # (no curve is steeper than 4 / scale)
        wide = np.int32(wide + np.int32((top - bottom <= near * scale) == False))  # noqa: E712
    return wide


@inner
def is_quiet(block, scratch, i, lag, top, bottom, gain, flags, num, iv):
    """Whether a pixel's signal, between bottom and top, is between its levels; with leak, how far it may rise goes to
    ROOM.  `gain`: of the leak so far."""
    high, low = block[HIGH * PITCH + i], block[LOW * PITCH + i]
    if len(flags.log_compare) and not len(flags.log_input):
        top = log_level_32(max(top, F(0.0)), num.curve)
        bottom = log_level_32(max(bottom, F(0.0)), num.curve)
    if len(flags.leak) == 0:
        at_rest = (lag == F(0.0)) | (lag <= TINY) & (abs(block[INPUT * PITCH + i]) >= LEAST)
        return (top < high) & (bottom > low) | at_rest & (high > F(-np.inf))
    if len(flags.log_compare):
        scratch[ROOM + i] = (high - top) - NATS
        return bottom + F(iv.leak0) - NATS > low
    dark = F(num.curve.dark)
    # (what float32 has no number for would be no level, and yet thresholds of 90 nat are reached in time)
    scratch[ROOM + i] = min(high / (top + dark), F(HIGHEST))
    return (bottom > -dark) & ((bottom + dark) * (gain - NATS * gain) > low)


@inner
def least_room(scratch, n, flags):
    """The leak that lifts the first pixel to its level [nat], from what `is_quiet` has left."""
    least = np.inf
    for i in range(n):
        least = min(least, np.float64(scratch[ROOM + i]))
    if len(flags.log_compare):
        return least
    return log64(least) - NATS if 0.0 < least < np.inf else (least if least > 0.0 else -np.inf)


@inner
def stir(block, scratch, lent, p0, keys, forced, theta, naps, flags, num, iv):
    """What a scan would leave of the sleeping pixels in which events are forced; returns how many lags are borrowed.

    What is forced leaves a signal no farther than half its pixel's least threshold from where its memory then is.
    """
    count, last = 0, np.int64(-1)
    for j in range(forced):
        i = place_of_candidate(keys[j], iv)[0]
        strip = (p0 + i) // STRIP
        if naps.state[strip] == AWAKE or i == last:
            continue
        scratch[NEW + i] = block[INPUT * PITCH + i]
        if len(flags.poles) > 0:
            borrow(block, scratch, i, strip, naps, flags, num)
            lent[count] = i
            count += 1
        last = i
        room = 0.5 * least_threshold(p0 + i, theta, flags, num) - 4.0 * NATS
        naps.until[strip] = min(naps.until[strip], iv.leak0 + room)
        if len(flags.track) > 0 or naps.calm[strip] == 0 or room < 4.0 * NATS:
            naps.until[strip] = -np.inf
    return count
