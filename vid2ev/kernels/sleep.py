"""Sleep: blocks in which nothing can happen are not walked, and nothing shows it.

A block whose light has the same bits as in the frame before

    sleeps   if its lags are 0: then an interval changes nothing in it, whatever its length;
    naps     if the hull of its inputs and lags lies between the levels of every pixel: then an interval does no more
             than step the lags, which is made up for, step by step with each interval's weights, before they are used;

Events that are forced in such a block go the usual way, their pixels alone: a shot takes the signal as the new memory,
and a threshold is never so small that what is left of the hull or some leak would reach it (`stir`).

The hull contains the signal at all times (`physics.photoreceptor`: the weights of a step are positive and their sum is
at most 1).  In float32 a lag of the first pole never grows in steady light, rounding included, and one of the second by
less than 2e-7 of the larger lag in a step, of which a nap has HISTORY at most: that is what SLACK is for.

A pixel at, or within rounding of, a level is flagged by every scan, and the slow path finds nothing, because the end of
the interval before was at the same signal: such a pixel does not keep its block awake once its lags are too small for
the signal to have them in float64.

Leak lifts all signals alike; a block sleeps until it would lift the first one to its level.  Photoreceptor noise moves
every pixel in every interval: with it nothing sleeps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.kernel_compiler import compiled, inner
from vid2ev.kernels.forced import place_of_candidate
from vid2ev.kernels.layout import BLOCK, HIGH, INPUT, LAG1, LAG2, LOW, PITCH, last_light, stride_of
from vid2ev.kernels.scan import (
    CLOCK,
    NEW,
    NEW1,
    NEW2,
    NOISE0,
    NOISE1,
    OLD_REST1,
    REFINED,
    SEEN,
    STEEP,
    light_weights,
)
from vid2ev.physics.elementary import exp64, log64
from vid2ev.physics.log_curve import log_level_32
from vid2ev.physics.mismatch import FLOOR as MISMATCH_FLOOR

F = np.float32
AWAKE, NAPS, SLEEPS = range(3)
HISTORY = 64  # intervals that can be made up for
WEIGHTS = 5  # of an interval: x1, x2, g, a, b
GLANCE = 67  # every so many pixels are compared first: light that changes mostly does so there
PATIENCE = 3  # light that keeps changing is noted now, in the next frame, and then in every fourth
SLACK, ROUNDING = F(1e-4), F(3e-7)  # of the larger lag, and of the input
NATS = F(4e-6)  # what rounding may be in a level of some nats
TINY, LEAST = F(1e-30), F(1e-12)  # lags that a signal of at least LEAST does not have in float64
X1, X2, G = NOISE0, NOISE1, SEEN  # planes of the scratch that nothing else uses where there is no noise


class Naps(NamedTuple):
    """What is known of the sleep of the blocks; arrays of blocks, but for the light and the history."""

    wanted: bool
    now: np.ndarray  # unsigned integers: the bits of the light [n]
    before: np.ndarray  # the bits of the light that each block saw last
    known: np.ndarray  # uint8: whether `before` has them
    changes: np.ndarray  # uint8: how many times in a row the light was another
    wait: np.ndarray  # uint8: frames until it is noted
    mended: np.ndarray  # uint8: whether there is something in them to be mended, and counted, each time
    state: np.ndarray  # uint8: AWAKE, NAPS or SLEEPS
    behind: np.ndarray  # int64: intervals that the lags have still to be stepped
    until: np.ndarray  # float64: leak since its reference [nat] up to which the block may sleep
    calm: np.ndarray  # uint8: whether no signal has further to go than a share of the smallest threshold
    slept: np.ndarray  # int64: intervals slept so far
    history: np.ndarray  # float64 [HISTORY, WEIGHTS]: interval k is in row k % HISTORY
    tick: int  # number of this interval


@inner
def sleeps_on(naps, index, iv):
    """Whether a block that keeps its light sleeps, and may go on."""
    return naps.state[index] != AWAKE and naps.until[index] > iv.leak1 and naps.behind[index] < HISTORY - 1


@inner
def may_sleep(block, scratch, index, n, same, naps, flags, num, iv):
    """Whether nothing but what is forced happens in a block in this interval; if not, its lags are made up for.

    `same`: it keeps its light.
    """
    if same and sleeps_on(naps, index, iv):
        return True
    naps.state[index] = AWAKE
    catch_up(block, scratch, index, n, naps, flags, num)
    if same and naps.mended[index] == 0:
        naps.state[index], naps.until[index], wide = sleep_of(block, scratch, n, flags, num, iv)
        naps.calm[index] = np.uint8(wide == 0)
    return naps.state[index] != AWAKE


@inner
def sleep(naps, index):
    """A block sleeps through this interval."""
    naps.slept[index] += 1
    naps.behind[index] += np.int64(naps.state[index] == NAPS)


@inner
def keeps_light(naps, index, p0, n):
    """Whether a block sees the bits that it is known to have seen last; if not, they are noted now or some time later.

    Where light changes again and again it is looked at less and less often.
    """
    now, before = naps.now[p0 : p0 + n], naps.before[p0 : p0 + n]
    same = naps.known[index] != 0
    if same:
        for i in range(0, n, GLANCE):
            same = same and now[i] == before[i]
        same = same and are_equal(now, before)
        naps.changes[index] = np.uint8(0 if same else min(naps.changes[index] + 1, PATIENCE))
        naps.wait[index] = np.uint8((1 << naps.changes[index]) >> 1)
    if not same:
        naps.wait[index] -= np.uint8(naps.wait[index] > 0)
        naps.known[index] = np.uint8(naps.wait[index] == 0)
        if naps.wait[index] == 0:
            for i in range(n):
                before[i] = now[i]
    return same


@inner
def are_equal(some, others):
    """Whether all integers are the same."""
    differ = np.uint8(0)
    for i in range(some.size):
        differ = np.uint8(differ | np.uint8(some[i] != others[i]))
    return differ == 0


@inner
def sleep_of(block, scratch, n, flags, num, iv):
    """(NAPS, SLEEPS or AWAKE; the leak up to which it holds; pixels that are not calm) of a block in its light."""
    poles = len(flags.poles)
    if poles + len(flags.leak) + len(flags.track) == 0:
        return SLEEPS, np.inf, 0
    restless, moving, wide = np.int32(0), np.int32(0), np.int32(0)
    gain, floor = F(exp64(iv.leak0)), F(num.curve.floor)
    near = F(0.125 * smallest_threshold(num))  # (no curve is steeper than 4 / (light + floor))
    for i in range(n):
        u = block[INPUT * PITCH + i]
        lag, top, bottom = F(0.0), u, u
        if poles > 0:
            e1 = block[LAG1 * PITCH + i]
            e2 = block[LAG2 * PITCH + i] if poles > 1 else e1
            lag = max(abs(e1), abs(e2))
            top, bottom = max(u, max(u - e1, u - e2)), min(u, min(u - e1, u - e2))
        slack = SLACK * lag + ROUNDING * abs(u)
        top, bottom = top + slack, bottom - slack
        quiet = is_quiet(block, scratch, i, lag, top, bottom, gain, flags, num, iv)
        if (poles > 0) & (len(flags.log_input) == 0):  # nor will it ever have to be refined
            quiet = quiet & (lag + SLACK * lag <= F(STEEP) * (bottom + floor))
        restless = np.int32(restless + np.int32(quiet == False))  # noqa: E712 (vectorises, `not` does not)
        moving = np.int32(moving + np.int32(lag != F(0.0)))
        if len(flags.forced):
            scale = F(1.0) if len(flags.log_input) else bottom + floor
            wide = np.int32(wide + np.int32((top - bottom <= near * scale) == False))  # noqa: E712
    if restless > 0:
        return AWAKE, -np.inf, wide
    until = np.inf
    if len(flags.leak):
        until = least_room(scratch, n, flags)
    if until <= iv.leak1:
        return AWAKE, until, wide
    return (NAPS if moving > 0 else SLEEPS), until, wide


@inner
def smallest_threshold(num):
    """What no threshold is below, whatever is drawn [nat]."""
    return MISMATCH_FLOOR * MISMATCH_FLOOR * min(num.threshold_on, num.threshold_off)


@inner
def is_quiet(block, scratch, i, lag, top, bottom, gain, flags, num, iv):
    """Whether a pixel's signal, between bottom and top, is between its levels; with leak, how far it may rise goes to
    scratch.  `gain`: of the leak so far."""
    high, low = block[HIGH * PITCH + i], block[LOW * PITCH + i]
    if len(flags.log_compare) and not len(flags.log_input):
        top = log_level_32(max(top, F(0.0)), num.curve)
        bottom = log_level_32(max(bottom, F(0.0)), num.curve)
    if len(flags.leak) == 0:
        at_rest = (lag == F(0.0)) | (lag <= TINY) & (abs(block[INPUT * PITCH + i]) >= LEAST)
        return (top < high) & (bottom > low) | at_rest & (high > F(-np.inf))
    if len(flags.log_compare):
        scratch[NEW + i] = (high - top) - NATS
        return bottom + F(iv.leak0) - NATS > low
    dark = F(num.curve.dark)
    scratch[NEW + i] = high / (top + dark)
    return (bottom > -dark) & ((bottom + dark) * (gain - NATS * gain) > low)


@inner
def least_room(scratch, n, flags):
    """The leak that lifts the first pixel to its level [nat], from what `is_quiet` has left."""
    least = np.inf
    for i in range(n):
        least = min(least, np.float64(scratch[NEW + i]))
    if len(flags.log_compare):
        return least
    return log64(least) - NATS if 0.0 < least < np.inf else (least if least > 0.0 else -np.inf)


@inner
def catch_up(block, scratch, index, n, naps, flags, num):
    """Make up for the intervals that a block is behind: its lags, to the bit that each step would have left."""
    behind = naps.behind[index]
    naps.behind[index] = 0
    if len(flags.poles) > 0:
        moved = True
        for tick in range(naps.tick - behind, naps.tick):
            weights = naps.history[tick % HISTORY]
            again = tick > naps.tick - behind and have_same(weights, naps.history[(tick - 1) % HISTORY])
            if moved or not again:
                moved = step_lags(block, scratch, n, weights, again, flags, num) > 0
                for i in range(n):
                    block[LAG1 * PITCH + i] = scratch[NEW1 + i]
                    if len(flags.poles) > 1:
                        block[LAG2 * PITCH + i] = scratch[NEW2 + i]


@inner
def have_same(weights, others):
    """Whether two intervals have the same weights."""
    differ = 0
    for k in range(WEIGHTS):
        differ += np.int64(weights[k] != others[k])
    return differ == 0


@inner
def step_lags(block, scratch, n, weights, again, flags, num):
    """The lags of a block after an interval of steady light into scratch; returns how many are others than before.

    `again`: it is the same block as last time, and these are the same weights.
    """
    moved = np.int32(0)
    if len(flags.light_bandwidth) and not again:
        for i in range(n):
            weigh(block, scratch, i, F(weights[3]), F(weights[4]), flags, num)
    x1, x2, g = F(weights[0]), F(weights[1]), F(weights[2])
    for i in range(n):
        moved = np.int32(moved + np.int32(step(block, scratch, i, x1, x2, g, flags)))
    return moved


@inner
def weigh(block, scratch, i, a, b, flags, num):
    """Weights of pixel i's step, and its clock, where the first pole depends on the light (`scan.advance`)."""
    light, dark = block[last_light(flags) + i], F(num.bandwidth_dark)
    mean = F(0.5) * (light + light)
    scratch[CLOCK + i] = max((a / (F(1.0) + dark)) * (mean + dark), F(1e-9))
    x1, _, x2, g, _ = light_weights(scratch[CLOCK + i], b, flags)
    scratch[X1 + i], scratch[X2 + i], scratch[G + i] = x1, x2, g


@inner
def step(block, scratch, i, x1, x2, g, flags):
    """The lags of pixel i after an interval of steady light into scratch (`scan.advance`); whether they are others."""
    if len(flags.light_bandwidth):
        x1, x2, g = scratch[X1 + i], scratch[X2 + i], scratch[G + i]
    e1 = block[LAG1 * PITCH + i]
    new1 = (e1 - x1 * e1) + F(0.0)
    scratch[NEW1 + i] = new1
    if len(flags.poles) == 1:
        return new1 != e1
    e2 = block[LAG2 * PITCH + i]
    new2 = (e2 - x2 * e2) + (g * e1 + F(0.0))
    scratch[NEW2 + i] = new2
    return (new1 != e1) | (new2 != e2)


@inner
def stir(block, scratch, flagged, index, n, keys, forced, naps, flags, num, iv):
    """What a scan would leave of the pixels of a sleeping block in which events are forced."""
    catch_up(block, scratch, index, n, naps, flags, num)
    for i in range(BLOCK):
        flagged[i] = 0
    if scratch[REFINED] > F(0.0):
        for i in range(OLD_REST1, REFINED + 1):
            scratch[i] = F(0.0)
    weights = naps.history[naps.tick % HISTORY]
    for j in range(forced):
        i = place_of_candidate(keys[j], iv)[0]
        scratch[NEW + i] = block[INPUT * PITCH + i]
        if len(flags.poles) > 0:
            if len(flags.light_bandwidth):
                weigh(block, scratch, i, F(weights[3]), F(weights[4]), flags, num)
            step(block, scratch, i, F(weights[0]), F(weights[1]), F(weights[2]), flags)
    # What is forced leaves a signal no farther than half the smallest threshold from where its memory now is.
    room = 0.5 * smallest_threshold(num) - 4.0 * NATS
    naps.until[index] = min(naps.until[index], iv.leak0 + room)
    if len(flags.track) > 0 or naps.calm[index] == 0 or room < 4.0 * NATS:
        naps.until[index] = -np.inf


@compiled
def rouse(blocks, pixels, planes, naps, flags, num, work):
    """Make up for what these blocks have slept; they may sleep on."""
    stride = stride_of(flags)
    for index in blocks:
        size = min(BLOCK, pixels - index * BLOCK)
        catch_up(planes.fast[index * stride : (index + 1) * stride], work.scratch, index, size, naps, flags, num)
