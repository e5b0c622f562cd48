"""Measuring what a sensor sees, frame by frame: extremes and sums of a scene (`vid2ev.stream.scene`).

A block's pixels go through two loops: one without branches, for what every pixel has (light, level, slope, bend), and
the play of those that are pushed or were until now (`play`).  Extremes are taken of the bits of numbers >= 0, whose
order is theirs: so the first loop is vector code.  All sums are kept block by block, so it does not matter which thread
has which.

A strip of 256 pixels is **calm** after an interval in which its light kept all its bits: its slopes are 0 and nothing
in it is pushed.  While it goes on like that it is left alone: bends and smoothed slopes only decay, by factors that are
multiplied for the strip and `owed` to its pixels until its light changes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.kernel_compiler import compiled, inner
from vid2ev.kernels.cpu import hits_of
from vid2ev.kernels.layout import BLOCK, PITCH, STRIP
from vid2ev.kernels.play import (
    BEFORE,
    BENDS,
    BENT,
    IF_TURNED,
    LEVEL,
    LIGHT,
    PLANES,
    PLAY,
    SEEN,
    SLOPE,
    SMOOTH,
    SMOOTHED,
    STEPS,
    WAY,
    follow,
)
from vid2ev.physics.elementary import bits_32, float_32
from vid2ev.physics.log_curve import log_level_32

F = np.float32
LEAST, MOST, STEEPEST = range(3)  # of a block; the rest are sums of `play`
STRIPS = BLOCK // STRIP
# A turn from slope r to -r' falls short by tau r' ln(1 + r/r') <= tau sqrt(r r'), where the reach is tau/e.
ROUNDED = F(2.7182818)
CHANGES, CALM, LEFT = range(3)  # a strip's light has changed; it has not; nor the time before, and the strip is owed


class Pace(NamedTuple):
    """Numbers of an interval.

    half         of the threshold [nat]
    before_log   light is straight between frames, else its level; bends are relative to the light near them: that from
                 back_s before the bend to ahead_s after it
    keep         what is left of the effect of the bend before, when this one comes
    smooth_s     time constant that slopes are smoothed with
    decays       float32 [STEPS + 1], what is left of a smoothed slope at each step of the interval
    tau_s        of the distance
    """

    half: float
    before_log: bool
    dt_s: float
    back_s: float
    ahead_s: float
    keep: float
    smooth_s: float
    decays: np.ndarray
    tau_s: float


class Seen(NamedTuple):
    """What is kept of the pixels, and what was found so far.

    state   float32, block by block and in it plane by plane
    calm    uint8 [blocks, STRIPS]
    owed    float32 [blocks, STRIPS, 2], factors on bends and on smoothed slopes
    tiles   float64 [blocks, FIGURES]
    spread  float64 [blocks, 4, QUARTERS, 2] (`play`)
    """

    state: np.ndarray
    calm: np.ndarray
    owed: np.ndarray
    tiles: np.ndarray
    spread: np.ndarray


@inner
def arriving(light):
    """Light as the sensor takes it: what is no number or negative is none."""
    light = light if light > F(0.0) else F(0.0)
    return light if light < F(1e30) else F(1e30)


@compiled
def settle_measure(light, shade, curve, half, found):
    """Begin with a frame of light [float32, n]: the play of every pixel is pushed from below."""
    state, tiles = found.state, found.tiles
    for i in range(light.size):
        seen = arriving(light[i]) * (shade[i] if shade.size else F(1.0))
        tile = tiles[i // BLOCK]
        tile[LEAST], tile[MOST] = min(tile[LEAST], seen), max(tile[MOST], seen)
        level = log_level_32(seen, curve)
        at = (i // BLOCK) * PLANES * PITCH + i % BLOCK
        state[at + LIGHT * PITCH], state[at + LEVEL * PITCH], state[at + PLAY * PITCH] = seen, level, level - F(half)
        for plane in (SLOPE, WAY, BENDS, SMOOTH):
            state[at + plane * PITCH] = F(0.0)
    found.calm[:] = CALM
    found.owed[:] = F(1.0)


@compiled
def measure_blocks(first, last, light, shade, curve, num, found, work):
    """Take blocks first ... last - 1 on to the next frame of light [float32, n]; num is `Pace`, found `Seen`, work the
    scratch of one thread: float32 planes, flags, hits, lanes."""
    scratch, flagged, hits, lanes = work
    for k in range(first, last):
        p0 = k * BLOCK
        n = min(BLOCK, light.size - p0)
        own, tile = found.state[k * PLANES * PITCH : (k + 1) * PLANES * PITCH], found.tiles[k]
        take(light[p0 : p0 + n], shade[p0 : min(p0 + n, shade.size)], scratch)
        if rest(own, scratch, n, found.calm[k], found.owed[k], F(num.keep), F(num.decays[STEPS])) or n < BLOCK:
            flagged[:] = 0
        start, stop = 0, 0
        while stop < n:
            start, stop = next_run(stop, n, found.calm[k])
            if stop > start:
                part = look(own[start:], scratch[start:], flagged[start:], stop - start, curve, num)
                tile[LEAST], tile[MOST] = min(tile[LEAST], part[0]), max(tile[MOST], part[1])
                tile[STEEPEST] = max(tile[STEEPEST], part[2])
        count = hits_of(flagged, hits)
        if count > 0:
            follow(count, hits, curve.floor, num, own, scratch, lanes, tile, found.spread[k])


@inner
def take(light, shade, scratch):
    """Light of a block into scratch, behind the lens shading if there is some."""
    for i in range(light.size):
        scratch[SEEN + i] = arriving(light[i])
    for i in range(shade.size):
        scratch[SEEN + i] = scratch[SEEN + i] * shade[i]


@inner
def rest(own, scratch, n, calm, owed, keep, kept):
    """Find the strips that can be left alone, and give the others what they are owed; returns whether there are any."""
    left = False
    for strip in range((n + STRIP - 1) // STRIP):
        begin = strip * STRIP
        same = is_same(own, scratch, begin, min(STRIP, n - begin))
        if same and calm[strip] != CHANGES:
            calm[strip], left = LEFT, True
            owed[strip, 0], owed[strip, 1] = owed[strip, 0] * keep, owed[strip, 1] * kept
            continue
        if calm[strip] == LEFT:
            bends, smooth = own[BENDS * PITCH + begin :], own[SMOOTH * PITCH + begin :]
            for i in range(STRIP):
                bends[i], smooth[i] = bends[i] * owed[strip, 0], smooth[i] * owed[strip, 1]
            owed[strip, 0], owed[strip, 1] = F(1.0), F(1.0)
        calm[strip] = CALM if same else CHANGES
    return left


@inner
def is_same(own, scratch, begin, n):
    """Whether n pixels have the light that they had."""
    differ = np.uint32(0)
    for i in range(n):
        at = np.uintp(begin) + np.uintp(i)  # (unsigned: otherwise it may be negative, and does not vectorise)
        differ = np.uint32(differ | np.uint32(own[np.uintp(LIGHT * PITCH) + at] != scratch[np.uintp(SEEN) + at]))
    return differ == 0


@inner
def next_run(first, n, calm):
    """The next pixels that are not left alone, from `first` on: (the first of them, the one after the last)."""
    while first < n and calm[first // STRIP] == LEFT:
        first += STRIP
    last = first
    while last < n and calm[last // STRIP] != LEFT:
        last += STRIP
    return min(first, n), min(max(last, first), n)


@compiled
def look(own, scratch, flagged, n, curve, num):
    """What each of n pixels has, into state and scratch, and which ones are pushed or were; returns least and most
    light and the greatest slope."""
    least, most, steepest = bits_32(F(1e30)), np.int32(0), np.int32(0)
    before_log, rate, half = num.before_log, F(1.0) / F(num.dt_s), F(num.half)
    back, ahead, keep, kept = F(num.back_s), F(num.ahead_s), F(num.keep), F(num.decays[STEPS])
    for i in range(n):
        seen, old, slope0 = scratch[SEEN + i], own[LIGHT * PITCH + i], own[SLOPE * PITCH + i]
        level, level0 = log_level_32(seen, curve), own[LEVEL * PITCH + i]
        risen = seen - old
        speed = abs(risen) * rate / (min(seen, old) + F(curve.floor))
        slope = risen * rate
        if not before_log:
            slope = (level - level0) * rate
            speed = abs(slope)
        near = max(min(old, min(old - slope0 * back, old + slope * ahead)), F(0.0))
        near = near + F(curve.floor) if before_log else F(1.0)
        bend, bends = abs(slope - slope0) / near, own[BENDS * PITCH + i] * keep
        turned = min(bend, ROUNDED * np.sqrt(abs(slope * slope0)) / near)
        smooth, play = own[SMOOTH * PITCH + i], own[PLAY * PITCH + i]
        own[LIGHT * PITCH + i], own[SLOPE * PITCH + i], own[BENDS * PITCH + i] = seen, slope, bends + bend
        own[SMOOTH * PITCH + i] = slope + (smooth - slope) * kept
        own[LEVEL * PITCH + i], scratch[BEFORE + i], scratch[BENT + i] = level, level0, bend
        scratch[SMOOTHED + i], scratch[IF_TURNED + i] = smooth, bends + turned
        flagged[i] = np.uint8((level - half > play) | (level + half < play) | (own[WAY * PITCH + i] != F(0.0)))
        least, most = np.int32(min(least, bits_32(seen))), np.int32(max(most, bits_32(seen)))
        steepest = np.int32(max(steepest, bits_32(speed)))
    return float_32(least), float_32(most), float_32(steepest)
