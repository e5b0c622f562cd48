"""Measuring what a sensor sees, frame by frame: extremes and sums of a scene (`vid2ev.stream.scene`).

A tile's pixels go through two loops: one without branches, for what every pixel has (light, level, slope, bend), and
one for the play of pixels that are pushed or were until now.
"""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_compiler import compiled
from vid2ev.kernels.layout import BLOCK
from vid2ev.physics.log_curve import log_level_32

F = np.float32
LIGHT, LEVEL, SLOPE, PLAY, WAY, BENDS, TURNS, TURNED_BENDS, TRAVEL = range(9)  # planes of the state
PLANES = 9
LEAST, MOST, STEEPEST, TRAVELLED, PUSHED_S, TURNED, BEND, TURN_BEND, ECHO, BEND_ECHO = range(10)  # of a tile
FIGURES = 10


@compiled
def settle_measure(light, shade, curve, half, state, tiles):
    """Begin with a frame of light [float32, n]: the play of every pixel is pushed from below."""
    for i in range(light.size):
        seen = min(max(light[i], F(0.0)), F(1e30)) * (shade[i] if shade.size else F(1.0))
        tile = tiles[i // BLOCK]
        tile[LEAST], tile[MOST] = min(tile[LEAST], seen), max(tile[MOST], seen)
        level = log_level_32(seen, curve)
        state[LIGHT, i], state[LEVEL, i], state[PLAY, i] = seen, level, level - half
        state[SLOPE, i] = state[WAY, i] = state[BENDS, i] = F(0.0)


@compiled
def measure_frame(light, shade, curve, half, before_log, dt_s, back_s, ahead_s, keep, state, tiles, scratch):
    """Go on to a frame `dt_s` later.

    half         of the threshold [nat]
    before_log   light is straight between frames, else its level; bends are relative to the light near them: that from
                 back_s before the bend to ahead_s after it
    keep         what is left of the effect of the bend before, when this one comes
    scratch      float32 [2, BLOCK]
    """
    rate, n = F(1.0) / F(dt_s), light.size
    back, ahead, keep = F(back_s), F(ahead_s), F(keep)
    was, level0, slope0, bends = state[LIGHT], state[LEVEL], state[SLOPE], state[BENDS]
    for first in range(0, n, BLOCK):
        last = min(first + BLOCK, n)
        tile = tiles[first // BLOCK]
        least, most, steepest = F(1e30), F(0.0), F(0.0)
        for i in range(first, last):
            seen = min(max(light[i], F(0.0)), F(1e30)) * (shade[i] if shade.size else F(1.0))
            least, most = min(least, seen), max(most, seen)
            level = log_level_32(seen, curve)
            risen, old = seen - was[i], was[i]
            share = abs(risen) / (min(seen, old) + F(curve.floor))
            slope = risen * rate if before_log else (level - level0[i]) * rate
            steepest = max(steepest, share * rate if before_log else abs(slope))
            near = min(old, min(old - slope0[i] * back, old + slope * ahead))
            bend = abs(slope - slope0[i])
            bend = bend / (max(near, F(0.0)) + F(curve.floor)) if before_log else bend
            bends[i] = bends[i] * keep + bend
            slope0[i], was[i], scratch[0, i - first], scratch[1, i - first] = slope, seen, level, bend
        tile[LEAST], tile[MOST] = min(tile[LEAST], least), max(tile[MOST], most)
        tile[STEEPEST] = max(tile[STEEPEST], steepest)
        follow(first, last, half, dt_s, state, tile, scratch)


@compiled
def follow(first, last, half, dt_s, state, tile, scratch):
    """The play of the pixels of a tile, from the levels in state to those in scratch, in whose second row bends are."""
    level0, play, way, bends = state[LEVEL], state[PLAY], state[WAY], state[BENDS]
    half = F(half)
    for i in range(first, last):
        level = scratch[0, i - first]
        pushed = F(level - half > play[i]) - F(level + half < play[i])
        if (pushed != F(0.0)) | (way[i] != F(0.0)):
            if (way[i] != F(0.0)) & (pushed != way[i]):
                tile[TURNED] += 1.0
                tile[TURN_BEND] += bends[i]
                state[TURNS, i] += F(1.0)
                state[TURNED_BENDS, i] += bends[i]
            tile[BEND] += bends[i] if way[i] == F(0.0) else scratch[1, i - first]
            if pushed != F(0.0):
                moved = abs(level - pushed * half - play[i])
                play[i] = level - pushed * half
                state[TRAVEL, i] += moved
                tile[TRAVELLED] += moved
                tile[PUSHED_S] += dt_s * min(moved / max(abs(level - level0[i]), F(1e-30)), F(1.0))
                tile[ECHO] += moved * state[TURNS, i]
                tile[BEND_ECHO] += moved * state[TURNED_BENDS, i]
            way[i] = pushed
        level0[i] = level
