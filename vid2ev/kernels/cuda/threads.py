"""A thread's part of each kernel: from its number to its pixel, and back to what all threads share."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.kernels.cuda.clips import Due
from vid2ev.kernels.cuda.counter import take
from vid2ev.kernels.cuda.pixel import glance, planes_of_clip, settle, walk
from vid2ev.kernels.cuda.staged import Staged
from vid2ev.kernels.forced import first_from
from vid2ev.kernels.layout import TALLIES, stride_of
from vid2ev.kernels.rows import sensor_of


@inner
def count_up(totals, tally):
    """Add what a thread has counted to the counts of all."""
    for k in range(TALLIES):
        if tally[k] > 0:
            take(totals.counts, k, tally[k])


@inner
def forget_tally(tally):
    """Nothing is counted yet."""
    for k in range(TALLIES):
        tally[k] = 0


@compiled
def glance_at(thread, clips, planes, own, scratch, flagged, flags, totals, tally):
    """`glance` for a thread's pixel; returns the frame from which on it has to be walked, or how many there are."""
    clip, stride = thread // clips.pixels, stride_of(flags)
    pixel, mine = thread - clip * clips.pixels, planes.fast[thread * stride : (thread + 1) * stride]
    times = clip if clips.interval_floats.shape[0] > 1 else 0
    forget_tally(tally)
    for i in range(stride):
        own[i] = mine[i]
    first = glance(
        pixel, clips.light[:, clip], clips.interval_floats[times], clips.interval_ints[times],
        len(flags.forced) > 0 and clips.forced[thread] != 0, planes_of_clip(planes, clip, clips.pixels, flags), own,
        scratch, flagged, flags, sensor_of(clips.sensor_floats[clip], clips.sensor_ints[clip]), tally,
    )  # fmt: skip
    for i in range(stride):
        mine[i] = own[i]
    count_up(totals, tally)
    return first


@compiled
def walk_listed(thread, clips, listed, candidates, planes, saved, work, waiting, sent, flags, totals, tally):
    """`walk` for a pixel that is listed, whose state is saved before; a thread beyond the list goes along."""
    begin = np.int64(clips.light.shape[0])
    place = listed.pixel[min(thread, listed.count[0] - 1)]
    clip, first, last = place // clips.pixels, np.int64(0), np.int64(0)
    if thread < listed.count[0]:
        begin = np.int64(listed.frame[thread])
        copy_pixel(planes, saved, place, flags)
    times = clip if clips.interval_floats.shape[0] > 1 else 0
    forget_tally(tally)
    if len(flags.forced):
        first, last = first_from(candidates.pixel, place), first_from(candidates.pixel, place + 1)
    due = Due(
        candidates.t_ns[first:last], candidates.wanted[first:last], candidates.keys[first:last],
        candidates.chance[first:last],
    )  # fmt: skip
    bases = clips.bases[clip]
    walk(
        place - clip * clips.pixels, begin, clips.light[:, clip], clips.interval_floats[times],
        clips.interval_ints[times], bases, due, planes_of_clip(planes, clip, clips.pixels, flags), work,
        Staged(waiting, sent.keys, sent.taken, bases[0]), flags,
        sensor_of(clips.sensor_floats[clip], clips.sensor_ints[clip]), tally,
    )  # fmt: skip
    count_up(totals, tally)


@compiled
def undo_listed(thread, listed, planes, saved, flags):
    """The state of a listed pixel as it was before its walk."""
    copy_pixel(saved, planes, listed.pixel[thread], flags)


@compiled
def settle_at(thread, clips, start, planes, work, flags, totals, tally):
    """`settle` for a thread's pixel, in the light of the first frame."""
    clip = thread // clips.pixels
    forget_tally(tally)
    settle(
        thread - clip * clips.pixels, clips.light[0, clip], start.t_ns[clip], start.bad[clip * clips.pixels :],
        start.random_phase[clip] != 0, planes_of_clip(planes, clip, clips.pixels, flags), work, flags,
        sensor_of(clips.sensor_floats[clip], clips.sensor_ints[clip]), tally,
    )  # fmt: skip
    count_up(totals, tally)


@inner
def copy_pixel(source, target, place, flags):
    """What changes of a pixel, from planes to others."""
    stride = stride_of(flags)
    for i in range(place * stride, (place + 1) * stride):
        target.fast[i] = source.fast[i]
    if len(flags.poles) > 0 and len(flags.log_input) == 0:
        for i in range(2 * place, 2 * place + 2):
            target.rest[i] = source.rest[i]
    target.memory[place] = source.memory[place]
    if len(flags.crossing_noise):
        target.count[place] = source.count[place]
        target.drawn[place, 0], target.drawn[place, 1] = source.drawn[place, 0], source.drawn[place, 1]
    if place < source.t_last.size:
        target.t_last[place] = source.t_last[place]
    if len(flags.labels) and len(flags.leak):
        target.t_reset[place] = source.t_reset[place]
