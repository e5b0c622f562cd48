"""Measuring a second signal beside that of a scene: the light without the lens shading.

Both signals have their own play from the same random start, so how many levels lie between them is known at every
instant (`vid2ev.bounds.scene`):

    E |N_a - N_b| <= |p_a - p_b| / theta

It costs while either is pushed, once at every turn of either, and at the end.  Within an interval |p_a - p_b| is no
more than at its begin or than the signals differ by at its ends, as light goes one way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.calm import arriving, next_run
from vid2ev.kernels.cpu import hits_of
from vid2ev.kernels.layout import BLOCK, PITCH
from vid2ev.kernels.measured import BARE_BEFORE, BEFORE, GONE, LEVEL, LOST, PLANES, PLAY, WAY, note
from vid2ev.kernels.pace import apart
from vid2ev.physics.log_curve import log_level_32

F = np.float32
# Planes of the state of a block: the bare level, how much higher it was at the beginning, play and way of both, what
# changes of the difference leave in memories, and the differences at turns.
BARE, OFFSET, BARE_PLAY, BARE_WAY, SHADED_PLAY, SHADED_WAY, STIRRED, AT_TURNS = range(8)
BARE_PLANES = 8
APART_S, FROZEN, BARE_TRAVEL = range(3)  # of a block
BARE_FIGURES = 3


class Bare(NamedTuple):
    """What is kept of the pixels' bare signals, and what was found so far.

    state   float32, block by block and in it plane by plane
    tiles   float64 [blocks, BARE_FIGURES]
    spread  float64 [blocks, 1, QUARTERS, 2] (`measured.note`)
    """

    state: np.ndarray
    tiles: np.ndarray
    spread: np.ndarray


@compiled
def settle_bare(light, curve, halves, state, bare):
    """Begin with a frame of light [float32, n], when the shaded light has."""
    for i in range(light.size):
        own = state[(i // BLOCK) * PLANES * PITCH :]
        at, k = (i // BLOCK) * BARE_PLANES * PITCH + i % BLOCK, i % BLOCK
        level = own[LEVEL * PITCH + k]
        bare[at + BARE * PITCH] = log_level_32(arriving(light[i]), curve)
        bare[at + OFFSET * PITCH] = bare[at + BARE * PITCH] - level
        bare[at + BARE_PLAY * PITCH] = bare[at + BARE * PITCH] - halves[k]
        bare[at + SHADED_PLAY * PITCH] = own[PLAY * PITCH + k]
        bare[at + BARE_WAY * PITCH] = bare[at + SHADED_WAY * PITCH] = F(0.0)


@inner
def beside(k, light, curve, num, own, work, calm, bare):
    """Take block k on to the next frame of light [float32, n], after its shaded light: that is in `own`, and those that
    are pushed by it or were are flagged.

    Of strips that are left alone the bare light does not change either, and nothing is pushed by it.
    """
    scratch, flagged, hits, lanes = work
    other = bare.state[k * BARE_PLANES * PITCH : (k + 1) * BARE_PLANES * PITCH]
    start, stop = 0, 0
    while stop < light.size:
        start, stop = next_run(stop, light.size, calm)
        if stop > start:
            bare_levels(light[start:stop], curve, num.halves[start:], other[start:], scratch[start:], flagged[start:])
    count = hits_of(flagged, hits)
    for j in range(count):
        i = np.uintp(hits[j])
        lanes[GONE + j] = max(abs(own[LEVEL * PITCH + i] - scratch[BEFORE + i]), F(1e-30))
    for j in range(count):
        lanes[LOST + j] = apart(lanes[GONE + j], num.halves[np.uintp(hits[j])], num)
    if count > 0:
        compare(count, hits, num, own, other, scratch, lanes, bare.tiles[k], bare.spread[k])


@compiled
def bare_levels(light, curve, halves, other, scratch, flagged):
    """The bare levels of pixels, those before them into scratch, and flags for those that are pushed or were."""
    for i in range(light.size):
        level, play, half = log_level_32(arriving(light[i]), curve), other[BARE_PLAY * PITCH + i], halves[i]
        scratch[BARE_BEFORE + i], other[BARE * PITCH + i] = other[BARE * PITCH + i], level
        pushed = (level - half > play) | (level + half < play) | (other[BARE_WAY * PITCH + i] != F(0.0))
        flagged[i] = np.uint8(flagged[i] | np.uint8(pushed))


@compiled
def compare(count, hits, num, own, other, scratch, lanes, tile, spread):
    """The two signals of the pixels in `hits`, of each of which one is pushed or was, from where they were before to
    where the shaded one is in `own`."""
    frozen = travelled = apart_s = 0.0
    for j in range(count):
        i = np.uintp(hits[j])
        half = num.halves[i]
        weight = F(num.half) / half
        level, play, offset = other[BARE * PITCH + i], other[BARE_PLAY * PITCH + i], other[OFFSET * PITCH + i]
        pushed, way = F(level - half > play) - F(level + half < play), own[WAY * PITCH + i]
        way0, shaded_way0 = other[BARE_WAY * PITCH + i], other[SHADED_WAY * PITCH + i]
        shaded_play0, shaded_play = other[SHADED_PLAY * PITCH + i], own[PLAY * PITCH + i]
        apart0 = apart_before(i, other)
        turns = F((way0 != F(0.0)) & (pushed != way0)) + F((shaded_way0 != F(0.0)) & (way != shaded_way0))
        if turns != F(0.0):
            here = weight * turns * frozen_at(i, half, other)
            frozen += here
            other[AT_TURNS * PITCH + i] += here
        other[BARE_WAY * PITCH + i], other[SHADED_WAY * PITCH + i] = pushed, way
        level0 = scratch[BARE_BEFORE + i]
        off0 = level0 - offset - scratch[BEFORE + i]
        off = level - offset - own[LEVEL * PITCH + i]
        if len(num.tracks):
            blind = min(F(num.blind_s / num.dt_s) * lanes[GONE + j] / (half + half), F(1.0))
            other[STIRRED * PITCH + i] += abs(off - off0) * blind
        if (pushed == F(0.0)) & (way == F(0.0)):
            continue
        moved, shaded_moved = (
            abs(level - pushed * half - play) if pushed != F(0.0) else F(0.0),
            abs(shaded_play - shaded_play0),
        )
        share = min(max(moved / max(abs(level - level0), F(1e-30)), shaded_moved / lanes[GONE + j]), F(1.0))
        far = max(apart0, max(abs(off0), abs(off))) + other[STIRRED * PITCH + i]
        apart_s += weight * share * levels(far, half)
        travelled += weight * moved
        note(spread, 0, other[AT_TURNS * PITCH + i], weight * shaded_moved * lanes[LOST + j])
        if pushed != F(0.0):
            other[BARE_PLAY * PITCH + i] = level - pushed * half
        other[SHADED_PLAY * PITCH + i] = shaded_play
    tile[FROZEN] += frozen
    tile[BARE_TRAVEL] += travelled
    tile[APART_S] += num.dt_s * apart_s


@compiled
def end_bare(num, bare):
    """The end of a shot is a turn of what is pushed: one of both, as they end together."""
    for k in range(len(bare.tiles)):
        other = bare.state[k * BARE_PLANES * PITCH : (k + 1) * BARE_PLANES * PITCH]
        for i in range(BLOCK):
            if (other[BARE_WAY * PITCH + i] != F(0.0)) | (other[SHADED_WAY * PITCH + i] != F(0.0)):
                half = num.halves[i]
                bare.tiles[k, FROZEN] += F(num.half) / half * frozen_at(i, half, other)


@inner
def apart_before(i, other):
    """How far the two plays of a pixel are apart [nat]."""
    return abs(other[SHADED_PLAY * PITCH + i] - (other[BARE_PLAY * PITCH + i] - other[OFFSET * PITCH + i]))


@inner
def frozen_at(i, half, other):
    """What it costs that a pixel turns where its two signals are."""
    return levels(apart_before(i, other) + other[STIRRED * PITCH + i], half)


@inner
def levels(nat, half):
    """What it costs that two signals are so far apart [nat]: as many levels as are between them, squared."""
    return nat * (F(1.0) + np.floor(nat / (half + half)))
