"""Naps: what is known of strips of pixels that sleep, and how what they have missed is made up for.

An interval in steady light steps the lags of a strip and does nothing else that lasts:

    e1 <- e1 - x1 e1        e2 <- (e2 - x2 e2) + g e1

The weights of the intervals are kept, and these steps are made later, in the order of `scan.advance` and to its bits:
of all pixels when the strip wakes, or of one pixel for an event that is forced in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.layout import BLOCK, LAG1, LAG2, PITCH, STRIP, last_light, stride_of
from vid2ev.kernels.scan import light_weights
from vid2ev.kernels.scratch import CLOCK, LIGHT, NEW1, NEW2, NOISE0, NOISE1, SEEN
from vid2ev.stream.still import NOT_SAID

F = np.float32
AWAKE, NAPS, SLEEPS = range(3)
AT_ONCE = 16  # intervals that the walk goes through at a time, at most
LONGEST = 64  # intervals that can be made up for
HISTORY = LONGEST + AT_ONCE
AGAIN, COLUMNS = 5, 6  # of the history: x1, x2, g, a, b of an interval, and 1 if those before it are the same
# Planes of the scratch that nothing else uses: where there is no noise, and of pixels that sleep.
X1, X2, G = NOISE0, NOISE1, SEEN
LENT1, LENT2 = LIGHT, NOISE0


class Naps(NamedTuple):
    """What is known of the sleep of the strips; arrays of strips, but for the history."""

    wanted: bool
    told: np.ndarray  # uint8 [frames, strips or none]: if light is that of the frame before (`stream.still.told_of`)
    state: np.ndarray  # uint8: AWAKE, NAPS or SLEEPS
    since: np.ndarray  # int64: the first interval that the lags have still to be stepped through; -1: none
    until: np.ndarray  # float64: leak since its reference [nat] up to which the strip may sleep
    calm: np.ndarray  # uint8: whether no signal has further to go than a share of the smallest threshold
    unasked: np.ndarray  # uint8: intervals for which it stays awake without being asked whether it may sleep
    patience: np.ndarray  # uint8: how many those were last time
    slept: np.ndarray  # int64, of blocks: intervals that their strips have slept so far
    history: np.ndarray  # float64 [HISTORY, COLUMNS]: interval k is in row k % HISTORY
    tick: int  # number of the first of these intervals


@inner
def of_frame(naps, k):
    """What is known in frame k of those that the walk goes through: `tick` is its own, and `told` is of its strips, or
    of none where the light has to tell."""
    told = naps.told[k]
    if told.size > 0 and told[0] == NOT_SAID:
        told = told[:0]
    return Naps(
        naps.wanted, told, naps.state, naps.since, naps.until, naps.calm, naps.unasked, naps.patience,
        naps.slept, naps.history, naps.tick + k,
    )  # fmt: skip


@inner
def catch_up(block, scratch, strip, n, naps, flags, num):
    """Make up for the intervals that a strip has missed: its lags, to the bit that each step would have left.

    `block` and `scratch` begin at the strip.
    """
    first = naps.tick - missed(naps.since[strip], naps.tick)
    naps.since[strip] = -1
    if len(flags.poles) > 0:
        moved = True
        for tick in range(first, naps.tick):
            again = tick > first and naps.history[tick % HISTORY, AGAIN] > 0.0
            if moved or not again:
                moved = step_lags(block, scratch, n, naps.history[tick % HISTORY], again, flags, num) > 0
                for i in range(n):
                    block[LAG1 * PITCH + i] = scratch[NEW1 + i]
                    if len(flags.poles) > 1:
                        block[LAG2 * PITCH + i] = scratch[NEW2 + i]


@inner
def missed(since, tick):
    """How many intervals before this one the lags of a strip have still to be stepped through."""
    return tick - since if since >= 0 else 0


@inner
def step_lags(block, scratch, n, weights, again, flags, num):
    """The lags of a strip after an interval of steady light into scratch; returns how many are others than before.

    `again`: it is the same strip as last time, and these are the same weights.
    """
    moved = np.int32(0)
    if len(flags.light_bandwidth) and not again:
        for i in range(n):
            _, scratch[X1 + i], scratch[X2 + i], scratch[G + i] = weights_of(block, i, weights, flags, num)
    x1, x2, g = F(weights[0]), F(weights[1]), F(weights[2])
    for i in range(n):
        if len(flags.light_bandwidth):
            x1, x2, g = scratch[X1 + i], scratch[X2 + i], scratch[G + i]
        e1 = block[LAG1 * PITCH + i]
        e2 = block[LAG2 * PITCH + i] if len(flags.poles) > 1 else F(0.0)
        new1, new2 = stepped(e1, e2, x1, x2, g)
        scratch[NEW1 + i] = new1
        if len(flags.poles) > 1:
            scratch[NEW2 + i] = new2
        moved = np.int32(moved + np.int32((new1 != e1) | (len(flags.poles) > 1) & (new2 != e2)))
    return moved


@inner
def stepped(e1, e2, x1, x2, g):
    """Both lags after an interval of steady light (`scan.advance`)."""
    return (e1 - x1 * e1) + F(0.0), (e2 - x2 * e2) + (g * e1 + F(0.0))


@inner
def weights_of(block, i, weights, flags, num):
    """(clock, x1, x2, g) of pixel i's step, its clock where the first pole depends on the light (`scan.advance`)."""
    if len(flags.light_bandwidth):
        light, dark = block[last_light(flags) + i], F(num.bandwidth_dark)
        mean = F(0.5) * (light + light)
        clock = max((F(weights[3]) / (F(1.0) + dark)) * (mean + dark), F(1e-9))
        x1, _, x2, g, _ = light_weights(clock, F(weights[4]), flags)
        return clock, x1, x2, g
    return F(0.0), F(weights[0]), F(weights[1]), F(weights[2])


@inner
def borrow(block, scratch, i, strip, naps, flags, num):
    """Bring the lags of one pixel of a sleeping strip to the start of this interval, and what they are at its end into
    scratch; what they were is kept there, for `give_back`.
    """
    e1 = block[LAG1 * PITCH + i]
    e2 = block[LAG2 * PITCH + i] if len(flags.poles) > 1 else F(0.0)
    moving = (e1 != F(0.0)) | (e2 != F(0.0))  # if not, lags stay 0, whatever the weights
    first = naps.tick - missed(naps.since[strip], naps.tick) if moving else naps.tick
    scratch[LENT1 + i], scratch[LENT2 + i] = e1, e2
    clock, x1, x2, g = weights_of(block, i, naps.history[first % HISTORY], flags, num)
    for tick in range(first, naps.tick):
        e1, e2 = stepped(e1, e2, x1, x2, g)
        if naps.history[(tick + 1) % HISTORY, AGAIN] == 0.0:
            clock, x1, x2, g = weights_of(block, i, naps.history[(tick + 1) % HISTORY], flags, num)
    block[LAG1 * PITCH + i] = e1
    if len(flags.poles) > 1:
        block[LAG2 * PITCH + i] = e2
    if len(flags.light_bandwidth):
        scratch[CLOCK + i] = clock
    scratch[NEW1 + i], scratch[NEW2 + i] = stepped(e1, e2, x1, x2, g)


@inner
def give_back(block, scratch, lent, count, flags):
    """Leave the lags of the borrowed pixels as they were."""
    if len(flags.poles) > 0:
        for k in range(count):
            i = lent[k]
            block[LAG1 * PITCH + i] = scratch[LENT1 + i]
            if len(flags.poles) > 1:
                block[LAG2 * PITCH + i] = scratch[LENT2 + i]


@compiled
def rouse(strips, pixels, planes, naps, flags, num, work):
    """Make up for what these strips have slept; they may sleep on."""
    stride = stride_of(flags)
    for strip in strips:
        p0 = strip * STRIP
        at, size = (p0 // BLOCK) * stride + p0 % BLOCK, min(STRIP, pixels - p0)
        catch_up(planes.fast[at:], work.scratch, strip, size, naps, flags, num)
        naps.since[strip] = naps.tick
