"""The play of pixels that are pushed or were until now (`vid2ev.bounds.scene`), and the sums that are taken of it.

Those of a block go to lanes: first what takes numbers alone, for all of them in vector code, then the sums, pixel after
pixel in their order.  What a pixel adds to a sum weighs as many mean thresholds as its own is part of: its travel is
that of its events at the mean threshold.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.bunched import left, sent_near
from vid2ev.kernels.layout import BLOCK, PITCH
from vid2ev.kernels.measured import (
    AT_HALF,
    AT_LEAST,
    AT_LEVEL,
    AT_LIGHT,
    AT_LIT,
    AT_PLAY,
    AT_SLOPE,
    AT_SMOOTH,
    BEFORE,
    BEHIND,
    BEND,
    BENDS,
    BENT,
    BY_BENDS,
    BY_FELT,
    BY_FELT_AT_TURNS,
    BY_LIGHT,
    BY_PEAKS,
    BY_SLOPE,
    BY_STIRS,
    BY_STIRS_AT_TURNS,
    BY_STIRS_BEFORE,
    BY_STRAYS,
    BY_STRAYS_AT_TURNS,
    BY_STRAYS_BEFORE,
    BY_TURNS,
    DIMMEST,
    FELT,
    FROM,
    GONE,
    IF_TURNED,
    LEVEL,
    LIGHT,
    LIT,
    LOST,
    MOVED,
    OFF_PEAKS,
    OFF_PEAKS_OFTEN,
    PEAKS,
    PER_MS,
    PER_MS2,
    PLANES,
    PLAY,
    PUSHED,
    PUSHED_S,
    SHARE,
    SLOPE,
    SMOOTHED,
    STEEP,
    STEEPER,
    STIRS,
    STIRS_AT_TURNS,
    STRAYS,
    STRAYS_AT_TURNS,
    TOOK,
    TRACE,
    TRACED,
    TRAVEL,
    TRAVELLED,
    TURN_BEND,
    TURNED,
    TURNED_BENDS,
    TURNS,
    UNBENT,
    WAY,
    WIDE,
    first_tau,
    note,
    note_both,
    reach_behind,
)
from vid2ev.kernels.pace import STEP_NAT, paced, push
from vid2ev.physics.log_curve import log_level_32
from vid2ev.physics.peaks import taken

F = np.float32


@inner
def follow(count, hits, curve, num, own, scratch, lanes, tile, spread):
    """The play of the pixels in `hits`, from the levels in scratch to those in `own`; sums into tile and spread."""
    gather(count, hits, num, own, scratch, lanes)
    push(count, curve, num, lanes)
    add_up(count, hits, curve, num, own, scratch, lanes, tile, spread)


@compiled
def add_up(count, hits, curve, num, own, scratch, lanes, tile, spread):
    """Move the plays of the pixels in `hits`, one after the other, and take their sums.

    A pixel that begins to be pushed brings the bends that it still feels; one that was counts each of its own, and
    where it goes another way or none, a turn.
    """
    # (sums in numbers of their own: an entry of an array would go through memory each time)
    travelled = at_least = pushed_s = turns = bends = turn_bends = off_peaks = off_peaks_often = 0.0
    mean, dt = F(num.half), num.dt_s
    for k in range(count):
        i, pushed, half = np.uintp(hits[k]), lanes[k + PUSHED], lanes[k + AT_HALF]
        weight = mean / half
        way = own[WAY * PITCH + i]
        bend = weight * (scratch[FELT + i] if way == F(0.0) else scratch[BENT + i])
        bends += bend
        reach = reach_of(i, num, own, scratch)
        felt = scratch[FELT + i] * reach / (half + half)
        if felt > F(1.0):
            note(spread, BY_FELT, felt, weight * scratch[FELT + i])
        if len(num.tracks):
            stirs = PER_MS2 * bend * scratch[STEEPER + i] / (half + half)
            own[STIRS * PITCH + i] += stirs
            own[STRAYS * PITCH + i] += PER_MS * bend * stirs
        if way != F(0.0) and pushed != way:
            turned = weight * scratch[IF_TURNED + i]
            turns += weight
            nat = lowered(i, num, own, scratch)
            lower = weight * nat
            turn_bends += turned
            off_peaks += lower
            off_peaks_often += lower * (F(1.0) + np.floor(nat / (half + half)))  # (levels between, squared)
            felt = scratch[IF_TURNED + i] * reach / (half + half)
            if felt > F(1.0):
                note(spread, BY_FELT_AT_TURNS, felt, turned)
            own[TURNS * PITCH + i] += weight
            own[TURNED_BENDS * PITCH + i] += turned
            own[PEAKS * PITCH + i] += lower
            if len(num.tracks):
                stirs, strays = own[STIRS * PITCH + i], np.sqrt(own[STRAYS * PITCH + i])
                note(spread, BY_STIRS_AT_TURNS, stirs, mean + mean)
                note(spread, BY_STRAYS_AT_TURNS, strays, mean + mean)
                own[STIRS_AT_TURNS * PITCH + i] += stirs
                own[STRAYS_AT_TURNS * PITCH + i] += strays
        own[WAY * PITCH + i] = pushed
        at_least += widely(i, lanes[GONE + k], curve, num, own)
        if pushed == F(0.0):
            continue
        moved, gone, lost = lanes[MOVED + k], lanes[GONE + k], lanes[LOST + k]
        here_s = dt * lanes[SHARE + k]
        own[PLAY * PITCH + i] = own[LEVEL * PITCH + i] - pushed * half
        own[TRAVEL * PITCH + i] += moved
        travelled += moved
        pushed_s += here_s
        note(spread, BY_TURNS, own[TURNS * PITCH + i], lost)
        note(spread, BY_BENDS, own[TURNED_BENDS * PITCH + i], lost)
        note(spread, BY_PEAKS, own[PEAKS * PITCH + i], lost)
        if len(num.tracks):
            per_nat = F(here_s / max(moved, F(1e-30)))
            note(spread, BY_STIRS, own[STIRS * PITCH + i] * per_nat, moved)
            note(spread, BY_STRAYS, np.sqrt(own[STRAYS * PITCH + i]) * per_nat, moved)
            note(spread, BY_STIRS_BEFORE, own[STIRS_AT_TURNS * PITCH + i], lost)
            note(spread, BY_STRAYS_BEFORE, own[STRAYS_AT_TURNS * PITCH + i], lost)
        took_s = F(0.0) if num.at_once else F(dt) if gone > F(STEP_NAT) else F(dt) * lanes[TOOK + k]
        scratch[TRACED + i] = left(scratch[TRACED + i], F(dt) - took_s, num)
        if gone > F(STEP_NAT):
            paced(i, pushed, moved, gone, took_s, curve, num, own, spread, scratch)
        else:
            near_it = sent_near(i, pushed, moved, took_s, num, own, scratch)
            note_both(spread, BY_SLOPE, lanes[STEEP + k], moved, near_it)
            note(spread, BY_LIGHT, lanes[DIMMEST + k], moved)
        own[TRACE * PITCH + i] = scratch[TRACED + i]
    tile[TRAVELLED] += travelled
    tile[AT_LEAST] += at_least
    tile[PUSHED_S] += pushed_s
    tile[TURNED] += turns
    tile[BEND] += bends
    tile[TURN_BEND] += turn_bends
    tile[OFF_PEAKS] += off_peaks
    tile[OFF_PEAKS_OFTEN] += off_peaks_often


@inner
def reach_of(i, num, own, scratch):
    """How far behind their mean delay the poles may be of a slope that has bent [s]: `photoreceptor_omission`."""
    tau1 = F(num.tau1_s)
    if len(num.by_light):
        tau1 = first_tau(min(own[LIGHT * PITCH + i], scratch[LIT + i]), num)
    return reach_behind(tau1, F(num.tau2_s))


@compiled
def end_measure(num, state, tiles, spread):
    """The end of a shot is a turn of what is pushed: poles have not come as far by then as they would, and a delay in
    their place lets nothing more through."""
    mean, tau1, tau2 = F(num.half), F(num.tau1_s), F(num.tau2_s)
    for k in range(len(tiles)):
        own = state[k * PLANES * PITCH : (k + 1) * PLANES * PITCH]
        for i in range(BLOCK):
            if own[WAY * PITCH + i] == F(0.0):
                continue
            width, bends = F(2.0) * num.halves[i], own[BENDS * PITCH + i]
            if len(num.by_light):
                tau1 = first_tau(own[LIGHT * PITCH + i], num)
            weight, late = (mean + mean) / width, bends * reach_behind(F(0.0), tau2)
            felt = bends * reach_behind(tau1, tau2) / width
            tiles[k, TURNED] += weight
            tiles[k, TURN_BEND] += weight * bends
            tiles[k, OFF_PEAKS] += weight * late
            tiles[k, OFF_PEAKS_OFTEN] += weight * late * (F(1.0) + np.floor(late / width))
            if felt > F(1.0):
                note(spread[k], BY_FELT_AT_TURNS, felt, weight * bends)


@inner
def lowered(i, num, own, scratch):
    """By how much the second pole lowers the peak at which a pixel turns [nat]."""
    before, bend = scratch[UNBENT + i], scratch[BENT + i]
    tau1 = F(num.tau1_s)
    if len(num.by_light):
        tau1 = first_tau(max(own[LIGHT * PITCH + i], scratch[LIT + i]), num)
    return taken(before, max(bend - before, F(0.0)), scratch[FELT + i] - bend, tau1, F(num.tau2_s))


@inner
def widely(i, gone, curve, num, own):
    """Push the wide play of a pixel by the signal behind the first pole; returns by how much [nat]."""
    wide, behind = own[WIDE * PITCH + i], own[BEHIND * PITCH + i]
    ahead = (log_level_32(max(behind, F(0.0)), curve) if num.before_log else behind) - wide
    pushed = F(max(abs(ahead) - F(num.wide), F(0.0)))
    own[WIDE * PITCH + i] = wide + (pushed if ahead > F(0.0) else -pushed)
    sent = pushed * (F(num.per_on) if ahead > F(0.0) else F(num.per_off))
    if len(num.tracks):
        sent /= F(1.0) + max(gone, pushed) * F(num.blind_s / (num.dt_s * 2.0 * num.half))
    return sent


@inner
def gather(count, hits, num, own, scratch, lanes):
    """What is known of the pixels in `hits` into lanes."""
    for k in range(count):
        i = hits[k]
        lanes[AT_HALF + k] = num.halves[i]
        lanes[AT_LEVEL + k], lanes[AT_PLAY + k] = own[LEVEL * PITCH + i], own[PLAY * PITCH + i]
        lanes[FROM + k], lanes[AT_SMOOTH + k] = scratch[BEFORE + i], scratch[SMOOTHED + i]
        lanes[AT_SLOPE + k], lanes[AT_LIT + k] = own[SLOPE * PITCH + i], scratch[LIT + i]
        lanes[AT_LIGHT + k] = own[LIGHT * PITCH + i]
