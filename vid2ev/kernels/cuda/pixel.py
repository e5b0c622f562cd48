"""What a thread does: one pixel, frame after frame.

`glance` is for all pixels: the scan alone, the state in registers, up to the first frame in which the pixel has to be
looked at.  `walk` is for those that have: scan, solve, commit, from that frame to the last.
"""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.company import together
from vid2ev.kernels.cuda.staged import Staged, send_waiting
from vid2ev.kernels.forced import keep_likely
from vid2ev.kernels.general import walk_pixel
from vid2ev.kernels.layout import LAG1, NOT_FINITE, Planes, stride_of
from vid2ev.kernels.light import BRIGHTEST
from vid2ev.kernels.rows import RISEN, interval_of_row
from vid2ev.kernels.scan import advance, advance_noise, commit, flag_rice, scan
from vid2ev.kernels.scratch import NEW, SCRATCH
from vid2ev.kernels.settle import settle_lanes, shift_pixel
from vid2ev.kernels.slow import climb, load
from vid2ev.kernels.steep import forget_rests, note_rests

F = np.float32


@inner
def take_light(scratch, light, gain):
    """Light of the pixel, mended and shaded, into the scratch; returns 1 if it was no light."""
    good = (light >= F(0.0)) & (light <= BRIGHTEST)
    value = light if light > F(0.0) else F(0.0)
    scratch[NEW] = (value if value < BRIGHTEST else BRIGHTEST) * gain
    return np.int64(0) if good else np.int64(1)


@inner
def gain_of(planes, pixel):
    """The optical gain at a pixel."""
    return planes.shade[pixel] if pixel < planes.shade.size else F(1.0)  # (without shading there is one entry)


@compiled
def glance(pixel, light, floats, ints, forced, planes, own, scratch, flagged, flags, num, tally):
    """The first frame of light [frames, pixels] in which the pixel has to be looked at, or how many there are.

    The state up to there is left in `own`, one block of `fast`, which has it as it is before the first.
    """
    if forced:
        return np.int64(0)
    first, gain = LAG1 + len(flags.poles), gain_of(planes, pixel)
    n1, n2, mended = F(0.0), F(0.0), np.int64(0)
    for k in range(light.shape[0]):
        iv = interval_of_row(floats[k], ints[k])
        bad = take_light(scratch, light[k, pixel], gain)
        if len(flags.noise):
            n1, n2 = own[first], own[first + 1]
            advance_noise(own, scratch, pixel, 1, len(flags.poles), num, iv)
        steep = advance(own, scratch, flagged, 1, flags, num, iv)
        if len(flags.noise) and not iv.noise_resolved:
            flag_rice(own, scratch, flagged, pixel, 1, flags, num, iv)
        if flagged[0] != 0 or steep > 0 or floats[k, RISEN] > 0.0:
            if len(flags.noise):
                own[first], own[first + 1] = n1, n2
            tally[NOT_FINITE] += mended
            return np.int64(k)
        commit(own, scratch, 1, flags)
        mended += bad
    tally[NOT_FINITE] += mended
    return np.int64(light.shape[0])


@compiled
def walk(pixel, first, light, floats, ints, bases, due, planes, work, sent, flags, num, tally):
    """Walk a pixel through the frames of light [frames, pixels] from `first` on, and send its events.

    `due` has the pixel's forced candidates.  All threads come through all frames (`company`): one without a pixel has
    that of another, and `first` beyond the last.
    """
    stride, n, gain = stride_of(flags), np.int64(0), gain_of(planes, pixel)
    block, rest = planes.fast[pixel * stride : (pixel + 1) * stride], planes.rest[2 * pixel : 2 * pixel + 2]
    for i in range(SCRATCH):
        work.scratch[i] = F(0.0)
    work.one_pixel[1] = 0
    for k in range(light.shape[0]):
        iv, out = interval_of_row(floats[k], ints[k]), Staged(sent.waiting, sent.keys, sent.taken, bases[k])
        forced, work.flagged[0] = np.int64(0), 0
        together()
        if k >= first:
            if floats[k, RISEN] > 0.0:
                shift_pixel(pixel, floats[k, RISEN], planes, flags, num, work)
            forget_rests(work.scratch)
            tally[NOT_FINITE] += take_light(work.scratch, light[k, pixel], gain)
            note_rests(work.scratch, scan(block, rest, work.scratch, work.flagged, pixel, 1, flags, num, iv))
            if len(flags.forced):
                forced = take_due(due, iv)
                forced = keep_likely(block, work.scratch, due.keys, due.chance, forced, flags, num, iv)
        out, n = solve(pixel, block, due, forced, planes, work, flags, num, iv, out, n, tally)
        if k >= first:
            commit(block, work.scratch, 1, flags)
    if n > 0:
        send_waiting(sent, n)


@inner
def solve(pixel, block, due, forced, planes, work, flags, num, iv, out, n, tally):
    """Events of a pixel that has been scanned, if it is flagged or has forced candidates: (out, n)."""
    general, loaded = len(flags.no_closed_form) > 0, np.int64(0)
    if len(flags.noise):
        general = general or not iv.noise_resolved
    if forced > 0 or (general and work.flagged[0] != 0):
        if len(flags.forced) + len(flags.noise) + len(flags.no_closed_form):
            out, n = walk_pixel(
                block, work.scratch, 0, pixel, work.one_lane, work.one_pixel, due.keys, due.chance, forced, work.knots,
                0, planes, flags, num, iv, out, n, tally,
            )  # fmt: skip
    elif work.flagged[0] != 0:
        work.hits[0] = 0
        load(block, work.scratch, work.lanes, work.pixels, work.hits, 1, pixel, flags)
        loaded = np.int64(1)
    return climb(work, loaded, planes, flags, num, iv, out, n, tally)


@inner
def take_due(due, iv):
    """The candidates of the interval, as of a block of one pixel, to the front of `due.keys`; returns their number."""
    n, until = np.int64(0), iv.t0_ns + np.int64(iv.dt_ns)
    for j in range(due.t_ns.size):
        if due.t_ns[j] > iv.t0_ns and due.t_ns[j] <= until:
            due.keys[n], due.chance[n] = due.t_ns[j] - iv.t0_ns, due.wanted[j]
            n += 1
    return n


@compiled
def settle(pixel, light, t_ns, bad, random_phase, planes, work, flags, num, tally):
    """The state of a pixel after a long time in this light [pixels]."""
    stride = stride_of(flags)
    block = planes.fast[pixel * stride : (pixel + 1) * stride]
    for i in range(stride):
        block[i] = F(0.0)
    tally[NOT_FINITE] += take_light(work.scratch, light[pixel], gain_of(planes, pixel))
    seen = work.scratch[NEW : NEW + 1]
    settle_lanes(block, seen, 0, 1, pixel, t_ns, bad, random_phase, planes, flags, num, work)


@compiled
def planes_of_clip(planes, clip, pixels, flags):
    """The planes of one of many sensors of as many pixels, which lie one after the other."""
    stride = stride_of(flags)
    first, last = clip * pixels, (clip + 1) * pixels
    return Planes(
        planes.fast[first * stride : last * stride],
        planes.rest[2 * first : 2 * last],
        planes.memory[first:last],
        planes.theta[first:last],
        planes.drawn[first:last],
        planes.t_last[first:last],
        planes.count[first:last],
        planes.t_reset[first:last],
        planes.hot,
        planes.shade[first:last],
    )
