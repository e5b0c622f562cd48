"""Measuring what a sensor sees, frame by frame: extremes and sums of a scene (`vid2ev.bounds.scene`).

A block's pixels go through two loops: one without branches, for what every pixel has (light, level, slope, bend), and
the play of those that are pushed or were until now (`play`).  Extremes are taken of the bits of numbers >= 0, whose
order is theirs: so the first loop is vector code.  All sums are kept block by block, so it does not matter which thread
has which.
Strips whose light does not change are left alone (`calm`); behind a lens shading the bare light is measured beside it
(`measure_bare`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled
from vid2ev.compiling.intrinsics import bits_32, float_32
from vid2ev.kernels.calm import CALM, arriving, next_run, rest
from vid2ev.kernels.cpu import hits_of
from vid2ev.kernels.layout import BLOCK, PITCH, STRIP
from vid2ev.kernels.measure_bare import Bare, beside, settle_bare
from vid2ev.kernels.measured import (
    BEFORE,
    BEHIND,
    BENDS,
    BENT,
    FELT,
    IF_TURNED,
    LEVEL,
    LIGHT,
    LIT,
    PHASE,
    PLANES,
    PLAY,
    SEEN,
    SLOPE,
    SMOOTH,
    SMOOTHED,
    STEEPER,
    TRACE,
    TRACED,
    UNBENT,
    WAY,
    WIDE,
    first_tau,
    gone_of,
    left_of,
)
from vid2ev.kernels.play import follow
from vid2ev.physics.log_curve import light_per_nat_32, log_level_32

F = np.float32
LEAST, MOST, STEEPEST = range(3)  # of a block; the rest are sums of `play`
# A turn from slope r to -r' falls short by tau r' ln(1 + r/r') <= tau sqrt(r r'), where the reach is tau/e; and signals
# are tau r exp(-t / tau) apart a time t after a bend.
ROUNDED = F(2.7182818)
GOLDEN = 0.6180339887498949  # multiples of it are spread evenly over 0 ... 1


class Pace(NamedTuple):
    """Numbers of an interval.

    halves       float32 [BLOCK], half of the threshold of each pixel of a block [nat]
    half         of the threshold that all sums are taken in [nat]
    wide         half of the width that what is sent at least is counted with [nat]; per_on, per_off: for a nat of it
    before_log   light is straight between frames, else its level; bends are relative to the light near them: that from
                 a delay of the poles before the bend to four delays after it
    dt_s         how long it is, before_s the one before it
    tau1_s, tau2_s   of the poles; of a bend as much is left when the next one comes as the slower of them keeps
    by_light     (0,) if the first pole's time constant is tau1_s (1 + dark) / (light + dark), else (): compiled for one
    tracks       (0,) if pixels are blind for blind_s, and then their memories jump to the signal, else (): likewise
    smooth_s     time constant that slopes are smoothed with
    kept         what is left of a smoothed slope after the interval
    tau_s        of the distance, and of the traces of events
    at_once      whether all events of an interval come at its end
    """

    halves: np.ndarray
    half: float
    wide: float
    per_on: float
    per_off: float
    before_log: bool
    dt_s: float
    before_s: float
    tau1_s: float
    tau2_s: float
    by_light: tuple
    dark: float
    tracks: tuple
    blind_s: float
    smooth_s: float
    kept: float
    tau_s: float
    at_once: bool


class Seen(NamedTuple):
    """What is kept of the pixels, and what was found so far.

    state   float32, block by block and in it plane by plane
    calm    uint8 [blocks, STRIPS]
    owed    float32 [blocks, STRIPS, 2], a time for bends [s], and a factor on smoothed slopes
    tiles   float64 [blocks, FIGURES]
    spread  float64 [blocks, BY_ALL or with memories that jump BY_JUMPS, QUARTERS, 2] (`measured`)
    bare    (Bare,) with a lens shading, else ()
    """

    state: np.ndarray
    calm: np.ndarray
    owed: np.ndarray
    tiles: np.ndarray
    spread: np.ndarray
    bare: tuple[Bare, ...]


@compiled
def settle_measure(light, shade, curve, halves, below, before_log, found):
    """Begin with a frame of light [float32, n]: the play of every pixel is pushed from below, and the wide one is so
    far below the signal [nat]."""
    state, tiles = found.state, found.tiles
    for i in range(light.size):
        seen = arriving(light[i]) * (shade[i] if shade.size else F(1.0))
        tile = tiles[i // BLOCK]
        tile[LEAST], tile[MOST] = min(tile[LEAST], seen), max(tile[MOST], seen)
        level = log_level_32(seen, curve)
        at = (i // BLOCK) * PLANES * PITCH + i % BLOCK
        state[at + LIGHT * PITCH], state[at + LEVEL * PITCH] = seen, level
        state[at + PLAY * PITCH], state[at + WIDE * PITCH] = level - halves[i % BLOCK], level - F(below)
        for plane in (SLOPE, WAY, BENDS, SMOOTH, TRACE):
            state[at + plane * PITCH] = F(0.0)
        state[at + BEHIND * PITCH] = seen if before_log else level
        state[at + PHASE * PITCH] = F(i * GOLDEN % 1.0)
    if len(found.bare):
        settle_bare(light, curve, halves, state, found.bare[0].state)
    found.calm[:] = CALM
    found.owed[:, :, 0], found.owed[:, :, 1] = F(0.0), F(1.0)


@compiled
def measure_blocks(first, last, light, told, shade, curve, num, found, work):
    """Take blocks first ... last - 1 on to the next frame of light [float32, n]; told [uint8, strips or none] are the
    strips known to be still, num is `Pace`, found `Seen`, work the scratch of one thread: float32 planes, flags, hits,
    lanes."""
    scratch, flagged, hits, lanes = work
    strips = BLOCK // STRIP
    for k in range(first, last):
        p0 = k * BLOCK
        n = min(BLOCK, light.size - p0)
        lit, gain = light[p0 : p0 + n], shade[min(p0, shade.size) : min(p0 + n, shade.size)]
        known = told[min(k * strips, told.size) : min(k * strips + strips, told.size)]
        own, tile, calm = found.state[k * PLANES * PITCH : (k + 1) * PLANES * PITCH], found.tiles[k], found.calm[k]
        if rest(lit, known, gain, num, own, scratch, calm, found.owed[k]) or n < BLOCK:
            flagged[:] = 0
        start, stop = 0, 0
        while stop < n:
            start, stop = next_run(stop, n, calm)
            if stop > start:
                part = look(own[start:], scratch[start:], flagged[start:], num.halves[start:], stop - start, curve, num)
                tile[LEAST], tile[MOST] = min(tile[LEAST], part[0]), max(tile[MOST], part[1])
                tile[STEEPEST] = max(tile[STEEPEST], part[2])
        count = hits_of(flagged, hits)
        if count > 0:
            follow(count, hits, curve, num, own, scratch, lanes, tile, found.spread[k])
        if len(found.bare):
            beside(k, lit, curve, num, own, work, calm, found.bare[0])


@compiled
def look(own, scratch, flagged, halves, n, curve, num):
    """What each of n pixels has, into state and scratch, and which ones are pushed or were; returns least and most
    light and the greatest slope."""
    least, most, steepest = bits_32(F(1e30)), np.int32(0), np.int32(0)
    before_log, rate, kept = num.before_log, F(1.0) / F(num.dt_s), F(num.kept)
    tau2, longest_back, longest_ahead = F(num.tau2_s), F(num.before_s), F(num.dt_s)
    slow, traced = F(num.tau1_s), left_of(longest_ahead, F(num.tau_s))
    gone1, keep2 = gone_of(longest_ahead, slow), left_of(longest_ahead, tau2)
    for i in range(n):
        seen, old, slope0 = scratch[SEEN + i], own[LIGHT * PITCH + i], own[SLOPE * PITCH + i]
        level, level0 = log_level_32(seen, curve), own[LEVEL * PITCH + i]
        risen, dimmer = seen - old, min(seen, old)
        speed = abs(risen) * rate / light_per_nat_32(dimmer, curve)
        slope = risen * rate
        if not before_log:
            slope = (level - level0) * rate
            speed = abs(slope)
        if len(num.by_light):
            slow = first_tau(dimmer, num)
            gone1 = gone_of(longest_ahead, slow)
        back, ahead = min(slow + tau2, longest_back), min(F(4.0) * (slow + tau2), longest_ahead)
        near = max(min(old, min(old - slope0 * back, old + slope * ahead)), F(0.0))
        per = F(1.0) / light_per_nat_32(near, curve) if before_log else F(1.0)
        bend, bends = abs(slope - slope0) * per, own[BENDS * PITCH + i]
        turned = min(bend, ROUNDED * np.sqrt(abs(slope * slope0)) * per)
        smooth, play, half = own[SMOOTH * PITCH + i], own[PLAY * PITCH + i], halves[i]
        own[LIGHT * PITCH + i], own[SLOPE * PITCH + i] = seen, slope
        keep1 = F(1.0) - gone1
        own[BENDS * PITCH + i] = (bends + ROUNDED * bend) * max(keep1, keep2)
        # (by the lag: of a slow pole it is little beside its slope, and what rounding left of that would add up)
        lag = (old if before_log else level0) - own[BEHIND * PITCH + i]
        own[BEHIND * PITCH + i] = (seen if before_log else level) - (lag * keep1 + slope * (slow * gone1))
        own[SMOOTH * PITCH + i] = slope + (smooth - slope) * kept
        own[LEVEL * PITCH + i], scratch[BEFORE + i], scratch[BENT + i] = level, level0, bend
        scratch[UNBENT + i] = abs(slope0) * per
        scratch[TRACED + i] = own[TRACE * PITCH + i]
        own[TRACE * PITCH + i] = scratch[TRACED + i] * traced
        scratch[SMOOTHED + i] = smooth if num.smooth_s > 0.0 else slope
        scratch[LIT + i], scratch[IF_TURNED + i], scratch[FELT + i] = old, bends + turned, bends + bend
        if len(num.tracks):
            scratch[STEEPER + i] = max(abs(slope), abs(slope0)) * per
        flagged[i] = np.uint8((level - half > play) | (level + half < play) | (own[WAY * PITCH + i] != F(0.0)))
        least, most = np.int32(min(least, bits_32(seen))), np.int32(max(most, bits_32(seen)))
        steepest = np.int32(max(steepest, bits_32(speed)))
    return float_32(least), float_32(most), float_32(steepest)
