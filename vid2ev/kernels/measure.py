"""Measuring what a sensor sees, frame by frame: extremes and sums of a scene (`vid2ev.stream.scene`).

A tile's pixels go through two loops: one without branches, for what every pixel has (light, level, slope, bend), and
one for the play of pixels that are pushed or were until now.
The state is one array, tile by tile and in it plane by plane, and extremes are taken of the bits of numbers >= 0, whose
order is theirs: so the first loop is vector code.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.kernel_compiler import compiled, inner
from vid2ev.kernels.cpu import hits_of
from vid2ev.kernels.layout import BLOCK, PITCH
from vid2ev.physics.elementary import bits_32, float_32
from vid2ev.physics.log_curve import log_level_32

F = np.float32
# Planes of the state of a tile, in units of PITCH.
LIGHT, LEVEL, SLOPE, PLAY, WAY, BENDS, TURNS, TURNED_BENDS, TRAVEL, SMOOTH = range(10)
PLANES = 10
# Planes of the scratch: the level and the smoothed slope before, bend, the bend as it counts at a turn.
BEFORE, SMOOTHED, BENT, IF_TURNED = range(4)
SCRATCH = 4 * PITCH
LEAST, MOST, STEEPEST, TRAVELLED, PUSHED_S, TURNED, BEND, TURN_BEND, DENSE = range(9)  # of a tile
FIGURES = 9
# A turn from slope r to -r' falls short by tau r' ln(1 + r/r') <= tau sqrt(r r'), where the reach is tau/e.
ROUNDED = F(2.7182818)
# How travel is spread: sums of travel and of travel x number, by the number's quarter of an octave.
BY_SLOPE, BY_TURNS, BY_BENDS, BY_LIGHT = range(4)
QUARTERS, LOWEST = 160, (127 - 24) << 2  # from 2**-24, and all below, to 2**16, and all above; four to an octave
STEPS = 6  # of an interval, whose slopes differ
SMALL_NAT = 0.1  # what goes no further than this is taken at its greatest slope


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


@inner
def arriving(light, gain):
    """Light as the sensor takes it: what is no number or negative is none."""
    light = light if light > F(0.0) else F(0.0)
    return (light if light < F(1e30) else F(1e30)) * gain


@compiled
def settle_measure(light, shade, curve, half, state, tiles):
    """Begin with a frame of light [float32, n]: the play of every pixel is pushed from below."""
    for i in range(light.size):
        seen = arriving(light[i], shade[i] if shade.size else F(1.0))
        tile = tiles[i // BLOCK]
        tile[LEAST], tile[MOST] = min(tile[LEAST], seen), max(tile[MOST], seen)
        level = log_level_32(seen, curve)
        at = (i // BLOCK) * PLANES * PITCH + i % BLOCK
        state[at + LIGHT * PITCH], state[at + LEVEL * PITCH], state[at + PLAY * PITCH] = seen, level, level - F(half)
        for plane in (SLOPE, WAY, BENDS, SMOOTH):
            state[at + plane * PITCH] = F(0.0)


@compiled
def measure_frame(light, shade, curve, num, state, tiles, spread, work):
    """Go on to the next frame; num is `Pace`, spread float64 [4, 2, QUARTERS]."""
    for first in range(0, light.size, BLOCK):
        last = min(first + BLOCK, light.size)
        k = first // BLOCK
        tile, own = tiles[k], state[k * PLANES * PITCH : (k + 1) * PLANES * PITCH]
        extremes = look(light[first:last], shade[first : min(last, shade.size)], curve, num, own, work[0])
        tile[LEAST], tile[MOST] = min(tile[LEAST], extremes[0]), max(tile[MOST], extremes[1])
        tile[STEEPEST] = max(tile[STEEPEST], extremes[2])
        follow(last - first, curve.floor, num, own, tile, spread, work)


@compiled
def look(light, shade, curve, num, own, scratch):
    """What every pixel of a tile has, into state and scratch; returns least and most light and the greatest slope."""
    least, most, steepest = bits_32(F(1e30)), np.int32(0), np.int32(0)
    shaded, before_log, rate = shade.size > 0, num.before_log, F(1.0) / F(num.dt_s)
    back, ahead, keep, kept = F(num.back_s), F(num.ahead_s), F(num.keep), F(num.decays[STEPS])
    for i in range(light.size):
        seen = arriving(light[i], shade[i] if shaded else F(1.0))
        old, slope0 = own[LIGHT * PITCH + i], own[SLOPE * PITCH + i]
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
        smooth = own[SMOOTH * PITCH + i]
        own[LIGHT * PITCH + i], own[SLOPE * PITCH + i], own[BENDS * PITCH + i] = seen, slope, bends + bend
        own[SMOOTH * PITCH + i] = slope + (smooth - slope) * kept
        own[LEVEL * PITCH + i], scratch[BEFORE * PITCH + i], scratch[BENT * PITCH + i] = level, level0, bend
        scratch[SMOOTHED * PITCH + i], scratch[IF_TURNED * PITCH + i] = smooth, bends + turned
        least, most = np.int32(min(least, bits_32(seen))), np.int32(max(most, bits_32(seen)))
        steepest = np.int32(max(steepest, bits_32(speed)))
    return float_32(least), float_32(most), float_32(steepest)


@compiled
def follow(n, floor, num, own, tile, spread, work):
    """The play of the n pixels of a tile, from the levels in scratch to those in `own`."""
    half, (scratch, flagged, hits) = F(num.half), work
    for i in range(n):
        level, play = own[LEVEL * PITCH + i], own[PLAY * PITCH + i]
        flagged[i] = (level - half > play) | (level + half < play) | (own[WAY * PITCH + i] != F(0.0))
    flagged[n:] = 0
    for k in range(hits_of(flagged, hits)):
        i = hits[k]
        level, play, way = own[LEVEL * PITCH + i], own[PLAY * PITCH + i], own[WAY * PITCH + i]
        pushed = F(level - half > play) - F(level + half < play)
        turn(i, way, pushed, own, tile, scratch)
        if pushed != F(0.0):
            moved, gone = abs(level - pushed * half - play), abs(level - scratch[BEFORE * PITCH + i])
            share = min(moved / max(gone, F(1e-30)), F(1.0))
            own[PLAY * PITCH + i] = level - pushed * half
            own[TRAVEL * PITCH + i] += moved
            tile[TRAVELLED] += moved
            tile[PUSHED_S] += num.dt_s * share
            lost = moved * apart(gone, num)
            note(spread[BY_TURNS], own[TURNS * PITCH + i], lost)
            note(spread[BY_BENDS], own[TURNED_BENDS * PITCH + i], lost)
            pace(i, moved, gone, floor, num, own, tile, spread, scratch)
        own[WAY * PITCH + i] = pushed


@compiled
def apart(gone, num):
    """What two events that should be one cost, if one is anywhere up to a threshold after the other: the mean of
    1 - exp(-x / (slope tau)), x from 0 to theta, at the least slope of an interval that goes so many nats."""
    reach = (1.0 - np.exp(-gone)) / num.dt_s * num.tau_s / (2.0 * num.half)
    return 1.0 - reach * (1.0 - np.exp(-1.0 / max(reach, 1e-3)))


@compiled
def pace(i, moved, gone, floor, num, own, tile, spread, scratch):
    """Spread a travel over the slopes of the smoothed signal in the interval, each as much as it goes at them."""
    slope, smooth0 = own[SLOPE * PITCH + i], scratch[SMOOTHED * PITCH + i]
    steps = STEPS if gone > F(SMALL_NAT) else 1
    old, width = own[LIGHT * PITCH + i] - slope * F(num.dt_s), F(num.dt_s) / F(steps)
    whole = F(1e-30)
    for turn in range(2):
        before, light0 = F(0.0), old
        for step in range(steps + 1):
            smooth = slope + (smooth0 - slope) * num.decays[step * (STEPS // steps)]
            light = old + slope * width * F(step) if num.before_log else own[LIGHT * PITCH + i]
            near = max(light - F(num.smooth_s) * smooth, F(0.0)) + F(floor) if num.before_log else F(1.0)
            here = abs(smooth) / near
            if step > 0 and turn == 0:
                whole += before + here
            elif step > 0:
                part, steep = moved * (before + here) / whole, max(before, here)
                note(spread[BY_SLOPE], steep, part)
                note(spread[BY_LIGHT], max(min(light, light0), F(0.0)), part)
                within = gone * F(1.0 + 2.0 * num.tau_s / num.dt_s)
                tile[DENSE] += part * min(F(2.0 * num.tau_s) * steep, within)
            before, light0 = here, light


@compiled
def turn(i, way, pushed, own, tile, scratch):
    """Where a pixel that was pushed goes another way, or one begins to be."""
    bend = own[BENDS * PITCH + i]
    if way != F(0.0):
        bend = scratch[BENT * PITCH + i]
        if pushed != way:
            turned = scratch[IF_TURNED * PITCH + i]
            tile[TURNED] += 1.0
            tile[TURN_BEND] += turned
            own[TURNS * PITCH + i] += F(1.0)
            own[TURNED_BENDS * PITCH + i] += turned
    tile[BEND] += bend


@compiled
def note(spread, number, counted):
    """Add a travel to the quarter of an octave that a number >= 0 has, spread [2, QUARTERS]: what is counted of it,
    and that times the number."""
    quarter = min(max(np.int64(bits_32(F(number)) >> np.int32(21)) - LOWEST, 0), QUARTERS - 1)
    spread[0, quarter] += counted
    spread[1, quarter] += counted * number
