"""The play of pixels that are pushed or were until now (`vid2ev.stream.scene`), and the sums that are taken of it.

Those of a block go to lanes: first what takes numbers alone, for all of them in vector code, then the sums, pixel after
pixel in their order.  What a pixel adds to a sum weighs as many mean thresholds as its own is part of: its travel is
that of its events at the mean threshold.
"""

from __future__ import annotations

import numpy as np

from vid2ev.kernel_compiler import compiled, inner
from vid2ev.kernel_intrinsics import bits_32
from vid2ev.kernels.layout import PITCH
from vid2ev.physics.elementary import expm1_32
from vid2ev.physics.log_curve import light_per_nat_32

F = np.float32
# Planes of the state of a block, in units of PITCH; the last two are of memories that jump to the signal.
LIGHT, LEVEL, SLOPE, PLAY, WIDE, WAY, BENDS, TURNS, TURNED_BENDS, TRAVEL, SMOOTH, STIRS, STIRS_AT_TURNS = range(13)
PLANES = 13
# Planes of the scratch: light now, the level and the smoothed slope before, bend, all bends as they count at a turn and
# as they are felt, the greater of the slopes beside the bend.
SEEN, BEFORE, SMOOTHED, BENT, IF_TURNED, FELT, STEEPER, BARE_BEFORE = (k * PITCH for k in range(8))
SCRATCH = 8 * PITCH
# Planes of the lanes: what is taken from a pixel, and what is found for it.
AT_LEVEL, AT_PLAY, FROM, AT_SLOPE, AT_SMOOTH, AT_LIGHT = (k * PITCH for k in range(6))
AT_HALF, PUSHED, MOVED, GONE, SHARE, LOST, STEEP, DIMMEST, BUNCHED = (k * PITCH for k in range(6, 15))
LANES = 15 * PITCH
TRAVELLED, AT_LEAST, PUSHED_S, TURNED, BEND, TURN_BEND, DENSE = range(3, 10)  # sums of a block, after its extremes
FIGURES = 10
# How travel is spread: sums of travel and of travel x number, by the number's quarter of an octave.
BY_SLOPE, BY_TURNS, BY_BENDS, BY_LIGHT, BY_STIRS, BY_STIRS_BEFORE, BY_STIRS_AT_TURNS = range(7)
BY_ALL, BY_JUMPS = 4, 7  # how many there are, without and with memories that jump
QUARTERS, LOWEST = 160, (127 - 24) << 2  # from 2**-24, and all below, to 2**16, and all above; four to an octave
STEPS = 6  # of an interval, whose slopes differ
SMALL_NAT = 0.1  # what goes no further than this is taken at its greatest slope
PER_MS2 = F(1e-6)  # of 1/s^2, so that sums are within the quarters


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
    travelled = at_least = pushed_s = turns = bends = turn_bends = dense = 0.0
    mean, dt = F(num.half), num.dt_s
    for k in range(count):
        i, pushed, half = np.uintp(hits[k]), lanes[k + PUSHED], lanes[k + AT_HALF]
        weight = mean / half
        way = own[WAY * PITCH + i]
        bend = weight * (scratch[FELT + i] if way == F(0.0) else scratch[BENT + i])
        bends += bend
        if len(num.tracks):
            own[STIRS * PITCH + i] += PER_MS2 * bend * scratch[STEEPER + i] / (half + half)
        if way != F(0.0) and pushed != way:
            turned = weight * scratch[IF_TURNED + i]
            turns += weight
            turn_bends += turned
            own[TURNS * PITCH + i] += weight
            own[TURNED_BENDS * PITCH + i] += turned
            if len(num.tracks):
                note(spread, BY_STIRS_AT_TURNS, own[STIRS * PITCH + i], mean + mean)
                own[STIRS_AT_TURNS * PITCH + i] += own[STIRS * PITCH + i]
        own[WAY * PITCH + i] = pushed
        if pushed == F(0.0):
            continue
        moved, gone, lost = lanes[MOVED + k], lanes[GONE + k], lanes[LOST + k]
        here_s = dt * lanes[SHARE + k]
        own[PLAY * PITCH + i] = own[LEVEL * PITCH + i] - pushed * half
        own[TRAVEL * PITCH + i] += moved
        at_least += widely(i, half, gone, num, own)
        travelled += moved
        pushed_s += here_s
        note(spread, BY_TURNS, own[TURNS * PITCH + i], lost)
        note(spread, BY_BENDS, own[TURNED_BENDS * PITCH + i], lost)
        if len(num.tracks):
            note(spread, BY_STIRS, F(own[STIRS * PITCH + i] * here_s / max(moved, F(1e-30))), moved)
            note(spread, BY_STIRS_BEFORE, own[STIRS_AT_TURNS * PITCH + i], lost)
        if gone > F(SMALL_NAT):
            dense += weight * pace(i, moved, gone, curve, num, own, spread, scratch)
            continue
        note(spread, BY_SLOPE, lanes[STEEP + k], moved)
        note(spread, BY_LIGHT, lanes[DIMMEST + k], moved)
        dense += moved * lanes[BUNCHED + k]
    tile[TRAVELLED] += travelled
    tile[AT_LEAST] += at_least
    tile[PUSHED_S] += pushed_s
    tile[TURNED] += turns
    tile[BEND] += bends
    tile[TURN_BEND] += turn_bends
    tile[DENSE] += dense


@inner
def widely(i, half, gone, num, own):
    """Push the wide play of a pixel by its play, as plays of plays are plays; returns by how much [nat]."""
    wide = own[WIDE * PITCH + i]
    ahead = own[PLAY * PITCH + i] - wide
    pushed = F(max(abs(ahead) - (F(num.wide) - half), F(0.0)))
    own[WIDE * PITCH + i] = wide + (pushed if ahead > F(0.0) else -pushed)
    pushed *= F(num.per_on) if ahead > F(0.0) else F(num.per_off)
    if len(num.tracks):
        pushed /= F(1.0) + gone * F(num.blind_s / (num.dt_s * 2.0 * num.half))
    return pushed


@inner
def gather(count, hits, num, own, scratch, lanes):
    """What is known of the pixels in `hits` into lanes."""
    for k in range(count):
        i = hits[k]
        lanes[AT_HALF + k] = num.halves[i]
        lanes[AT_LEVEL + k], lanes[AT_PLAY + k] = own[LEVEL * PITCH + i], own[PLAY * PITCH + i]
        lanes[FROM + k], lanes[AT_SMOOTH + k] = scratch[BEFORE + i], scratch[SMOOTHED + i]
        lanes[AT_SLOPE + k], lanes[AT_LIGHT + k] = own[SLOPE * PITCH + i], own[LIGHT * PITCH + i]


@inner
def push(count, curve, num, lanes):
    """How far and which way each is pushed, and what follows from that if it is not far."""
    dt, smooth_s, mean = F(num.dt_s), F(num.smooth_s), F(num.half)
    before_log, blind = num.before_log, F(num.blind_s / (num.dt_s * 2.0 * num.half))
    first, kept = num.decays[0], num.decays[STEPS]
    for k in range(count):
        level, play, half = lanes[AT_LEVEL + k], lanes[AT_PLAY + k], lanes[AT_HALF + k]
        weight = mean / half
        pushed = F(level - half > play) - F(level + half < play)
        gone = abs(level - lanes[FROM + k])
        moved = abs(level - pushed * half - play) if pushed != F(0.0) else F(0.0)
        share = min(moved / max(gone, F(1e-30)), F(1.0))
        if len(num.tracks):
            sent = F(1.0) / (F(1.0) + gone * blind * weight)  # (events are theta + the blind time's way apart)
            moved, share = moved * sent, share * sent
        moved, share = moved * weight, share * weight
        lanes[PUSHED + k], lanes[MOVED + k], lanes[GONE + k] = pushed, moved, gone
        lanes[SHARE + k], lanes[LOST + k] = share, moved * apart(gone, half, num)
        slope, light1 = lanes[AT_SLOPE + k], lanes[AT_LIGHT + k]
        smooth0 = slope + (lanes[AT_SMOOTH + k] - slope) * first
        smooth1, light0 = slope + (smooth0 - slope) * kept, light1
        near0 = near1 = F(1.0)
        if before_log:
            light0 = light1 - slope * dt
            near0 = light_per_nat_32(max(light0 - smooth_s * smooth0, F(0.0)), curve)
            near1 = light_per_nat_32(max(light1 - smooth_s * smooth1, F(0.0)), curve)
        steep = max(abs(smooth0) / near0, abs(smooth1) / near1)
        lanes[STEEP + k], lanes[DIMMEST + k] = steep, max(min(light0, light1), F(0.0))
        lanes[BUNCHED + k] = weight * bunched(gone, steep, slope, lanes[DIMMEST + k], curve, num)


@inner
def bunched(gone, steep, slope, dimmest, curve, num):
    """How far a signal goes within tau of an event at most [nat]: as the smoothed or the bare light does, the steeper
    one, and no farther than it goes in the interval and those beside it."""
    within = gone * F(1.0 + 2.0 * num.tau_s / num.dt_s)
    if num.at_once:
        return within
    bare = abs(slope) / light_per_nat_32(dimmest, curve) if num.before_log else abs(slope)
    return min(F(2.0 * num.tau_s) * max(steep, bare), within)


@inner
def apart(gone, half, num):
    """What two events that should be one cost at most, if between them there is a share of the gap from event to event
    and the rest to the next: 1 - exp(-gap / (2 tau)), at the least slope of an interval that goes so many nats."""
    slope = max(-expm1_32(-gone) / F(num.dt_s), F(1e-12))
    return -expm1_32(F(-0.5 / num.tau_s) * ((half + half) / slope + F(num.blind_s)))


@inner
def pace(i, moved, gone, curve, num, own, spread, scratch):
    """Spread a travel over the slopes of the smoothed signal in the interval, each as much as it goes at them."""
    slope, smooth0 = own[SLOPE * PITCH + i], scratch[SMOOTHED + i]
    old, width = own[LIGHT * PITCH + i] - slope * F(num.dt_s), F(num.dt_s) / F(STEPS)
    whole, dense = F(1e-30), 0.0
    for turn in range(2):
        before, light0 = F(0.0), old
        for step in range(STEPS + 1):
            smooth = slope + (smooth0 - slope) * num.decays[step]
            light = old + slope * width * F(step) if num.before_log else own[LIGHT * PITCH + i]
            dim = max(light - F(num.smooth_s) * smooth, F(0.0))
            near = light_per_nat_32(dim, curve) if num.before_log else F(1.0)
            here = abs(smooth) / near
            if step > 0 and turn == 0:
                whole += before + here
            elif step > 0:
                part, steep = moved * (before + here) / whole, max(before, here)
                dimmest = max(min(light, light0), F(0.0))
                note(spread, BY_SLOPE, steep, part)
                note(spread, BY_LIGHT, dimmest, part)
                dense += part * bunched(gone, steep, slope, dimmest, curve, num)
            before, light0 = here, light
    return dense


@inner
def note(spread, of, number, counted):
    """Add a travel to the quarter of an octave that a number >= 0 has, of spread [..., QUARTERS, 2]: what is
    counted of it, and that times the number."""
    quarter = np.uintp(min(max(np.int64(bits_32(number) >> np.int32(21)) - LOWEST, 0), QUARTERS - 1))
    spread[of, quarter, 0] += counted
    spread[of, quarter, 1] += counted * number
