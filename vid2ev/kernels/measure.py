"""Measuring what a sensor sees, frame by frame: extremes and sums of a scene (`vid2ev.stream.scene`).

A tile's pixels go through two loops: one without branches, for what every pixel has (light, level, slope, bend), and
one for the play of pixels that are pushed or were until now.
The state is one array, tile by tile and in it plane by plane, and extremes are taken of the bits of numbers >= 0, whose
order is theirs: so the first loop is vector code.
"""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_compiler import compiled, inner
from vid2ev.kernels.cpu import hits_of
from vid2ev.kernels.layout import BLOCK, PITCH
from vid2ev.physics.elementary import bits_32, exponent_32, float_32
from vid2ev.physics.log_curve import log_level_32

F = np.float32
# Planes of the state of a tile, in units of PITCH.
LIGHT, LEVEL, SLOPE, PLAY, WAY, BENDS, TURNS, TURNED_BENDS, TRAVEL, STEEP, MOVED = range(11)
PLANES = 11
# Planes of the scratch: the level before, bend, the greatest slope around, the bend as it counts at a turn.
BEFORE, BENT, AROUND, IF_TURNED = range(4)
SCRATCH = 4 * PITCH
LEAST, MOST, STEEPEST, TRAVELLED, PUSHED_S, TURNED, BEND, TURN_BEND = range(8)  # of a tile
FIGURES = 8
# A turn from slope r to -r' falls short by tau r' ln(1 + r/r') <= tau sqrt(r r'), where the reach is tau/e.
ROUNDED = F(2.7182818)
BY_SLOPE, BY_TURNS, BY_BENDS = range(3)  # how travel is spread: sums by octave, of travel and of travel x number
OCTAVES, LOWEST = 64, -24  # the first octave has all below 2**-23, none among them


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
        for plane in (SLOPE, WAY, BENDS, STEEP):
            state[at + plane * PITCH] = F(0.0)


@compiled
def measure_frame(
    light, shade, curve, half, before_log, dt_s, back_s, ahead_s, keep, recent, state, tiles, spread, work
):
    """Go on to a frame `dt_s` later.

    half         of the threshold [nat]
    before_log   light is straight between frames, else its level; bends are relative to the light near them: that from
                 back_s before the bend to ahead_s after it
    keep         what is left of the effect of the bend before, when this one comes
    recent       the same of a slope's, 1 in a refractory period
    spread       float64 [3, 2, OCTAVES]
    """
    for first in range(0, light.size, BLOCK):
        last = min(first + BLOCK, light.size)
        k = first // BLOCK
        tile, own = tiles[k], state[k * PLANES * PITCH : (k + 1) * PLANES * PITCH]
        extremes = look(
            light[first:last], shade[first : min(last, shade.size)], curve, before_log, F(1.0) / F(dt_s), F(back_s),
            F(ahead_s), F(keep), F(recent), own, work[0],
        )  # fmt: skip
        tile[LEAST], tile[MOST] = min(tile[LEAST], extremes[0]), max(tile[MOST], extremes[1])
        tile[STEEPEST] = max(tile[STEEPEST], extremes[2])
        follow(last - first, half, dt_s, own, tile, spread, work)


@compiled
def look(light, shade, curve, before_log, rate, back, ahead, keep, recent, own, scratch):
    """What every pixel of a tile has, into state and scratch; returns least and most light and the greatest slope."""
    least, most, steepest = bits_32(F(1e30)), np.int32(0), np.int32(0)
    shaded = shade.size > 0
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
        steep = own[STEEP * PITCH + i]
        own[LIGHT * PITCH + i], own[SLOPE * PITCH + i], own[BENDS * PITCH + i] = seen, slope, bends + bend
        own[STEEP * PITCH + i] = max(speed, steep * recent)
        own[LEVEL * PITCH + i], scratch[BEFORE * PITCH + i], scratch[BENT * PITCH + i] = level, level0, bend
        scratch[AROUND * PITCH + i], scratch[IF_TURNED * PITCH + i] = max(speed, steep), bends + turned
        least, most = np.int32(min(least, bits_32(seen))), np.int32(max(most, bits_32(seen)))
        steepest = np.int32(max(steepest, bits_32(speed)))
    return float_32(least), float_32(most), float_32(steepest)


@compiled
def follow(n, half, dt_s, own, tile, spread, work):
    """The play of the n pixels of a tile, from the levels in scratch to those in `own`."""
    half, (scratch, flagged, hits) = F(half), work
    for i in range(n):
        level, play = own[LEVEL * PITCH + i], own[PLAY * PITCH + i]
        flagged[i] = (level - half > play) | (level + half < play) | (own[WAY * PITCH + i] != F(0.0))
    flagged[n:] = 0
    for k in range(hits_of(flagged, hits)):
        i = hits[k]
        level, play, way = own[LEVEL * PITCH + i], own[PLAY * PITCH + i], own[WAY * PITCH + i]
        pushed = F(level - half > play) - F(level + half < play)
        turn(i, way, pushed, own, tile, spread, scratch)
        if pushed != F(0.0):
            moved = abs(level - pushed * half - play)
            share = min(moved / max(abs(level - scratch[BEFORE * PITCH + i]), F(1e-30)), F(1.0))
            own[PLAY * PITCH + i], own[MOVED * PITCH + i] = level - pushed * half, moved
            own[TRAVEL * PITCH + i] += moved
            tile[TRAVELLED] += moved
            tile[PUSHED_S] += dt_s * share
            note(spread[BY_TURNS], own[TURNS * PITCH + i], moved)
            note(spread[BY_BENDS], own[TURNED_BENDS * PITCH + i], moved)
        own[WAY * PITCH + i] = pushed


@compiled
def turn(i, way, pushed, own, tile, spread, scratch):
    """Where a pixel that was pushed goes another way, or one begins to be."""
    bend = own[BENDS * PITCH + i]
    if way != F(0.0):
        note(spread[BY_SLOPE], scratch[AROUND * PITCH + i], own[MOVED * PITCH + i])
        bend = scratch[BENT * PITCH + i]
        if pushed != way:
            turned = scratch[IF_TURNED * PITCH + i]
            tile[TURNED] += 1.0
            tile[TURN_BEND] += turned
            own[TURNS * PITCH + i] += F(1.0)
            own[TURNED_BENDS * PITCH + i] += turned
    tile[BEND] += bend


@compiled
def note(spread, number, moved):
    """Add a travel to the octave of a number >= 0 that it has, spread [2, OCTAVES]."""
    octave = min(max(exponent_32(number) - LOWEST, 0), OCTAVES - 1)
    spread[0, octave] += moved
    spread[1, octave] += moved * number
