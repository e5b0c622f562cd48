"""The kernels: glance at all pixels and list those that have to be walked, walk these; settle, and undo a walk."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import cuda

from vid2ev.kernels.crossing import FREE
from vid2ev.kernels.cuda.machine import jit
from vid2ev.kernels.cuda.proposals import propose
from vid2ev.kernels.cuda.staged import STAGED
from vid2ev.kernels.cuda.threads import glance_at, settle_at, undo_listed, walk_listed
from vid2ev.kernels.layout import BLOCK, LANE_COUNT, LANE_PITCH, TALLIES, Flags
from vid2ev.kernels.path import KNOTS
from vid2ev.kernels.response import LANES
from vid2ev.kernels.roots import GUESSES, JOBS
from vid2ev.kernels.scratch import SCRATCH
from vid2ev.kernels.turns import TURNS
from vid2ev.kernels.work import Work

THREADS = 128  # of a block
REGISTERS = 64  # of a thread that walks: what does not fit is in memory, but 1024 at work take 2/3 of the time of 320
HITS, LIVE, BATCH, STAMPS = BLOCK + 1, LANE_COUNT + 1, LANE_COUNT + 2, 2 * LANE_PITCH
f64, f32, i64, i32, u64, u8 = np.float64, np.float32, np.int64, np.int32, np.uint64, np.uint8


class Kernels(NamedTuple):
    """Those for some flags; each takes what `threads` says, for as many threads as there are pixels, or listed ones."""

    glance: Any
    walk: Any
    settle: Any
    undo: Any
    propose: Any


def kernels_of(flags: Flags, stride: int) -> Kernels:
    """The kernels for a combination of effects."""

    @jit
    def glance_kernel(clips, planes, listed, totals):
        thread, all_threads = cuda.grid(1), planes.memory.size
        own, scratch, flagged = cuda.local.array(stride, f32), cuda.local.array(SCRATCH, f32), cuda.local.array(1, u8)
        tally = cuda.local.array(TALLIES, i64)
        found = cuda.shared.array(1, i64)
        start = cuda.shared.array(1, i64)
        frames, first, place = clips.light.shape[0], clips.light.shape[0], 0
        if cuda.threadIdx.x == 0:
            found[0] = 0
        cuda.syncthreads()
        if thread < all_threads:
            first = glance_at(thread, clips, planes, own, scratch, flagged, flags, totals, tally)
        if first < frames:
            place = cuda.atomic.add(found, 0, 1)
        cuda.syncthreads()
        if cuda.threadIdx.x == 0:
            start[0] = cuda.atomic.add(listed.count, 0, found[0])
        cuda.syncthreads()
        if first < frames:
            listed.pixel[start[0] + place] = thread
            listed.frame[start[0] + place] = first

    def walk_kernel(clips, listed, candidates, planes, saved, sent, totals):
        waiting, tally = cuda.local.array(STAGED, u64), cuda.local.array(TALLIES, i64)
        scratch, flagged, hits = cuda.local.array(SCRATCH, f32), cuda.local.array(1, u8), cuda.local.array(HITS, i32)
        lanes, pixels, live = cuda.local.array(LANES, f64), cuda.local.array(1, i64), cuda.local.array(LIVE, i64)
        who, levels, when = cuda.local.array(BATCH, i64), cuda.local.array(BATCH, f64), cuda.local.array(BATCH, f64)
        steps, jobs = cuda.local.array(LANE_COUNT, f64), cuda.local.array(JOBS, f64)
        guesses, turns = cuda.local.array(GUESSES, f32), cuda.local.array(TURNS, f64)
        stamps, knots = cuda.local.array(STAMPS, u64), cuda.local.array(KNOTS, f64)
        one_lane, one_pixel = cuda.local.array(FREE, f64), cuda.local.array(2, i64)
        work = Work(
            scratch, flagged, hits, hits, lanes, pixels, live, who, levels, when, steps, jobs, guesses, turns, stamps,
            one_lane, one_pixel, one_lane, one_pixel, knots,
        )  # fmt: skip
        for first in range(0, listed.count[0], cuda.gridsize(1)):
            thread = first + cuda.grid(1)
            walk_listed(thread, clips, listed, candidates, planes, saved, work, waiting, sent, flags, totals, tally)

    @jit
    def settle_kernel(clips, start, planes, totals):
        thread = cuda.grid(1)
        scratch, tally, live = cuda.local.array(SCRATCH, f32), cuda.local.array(TALLIES, i64), cuda.local.array(2, i64)
        one_lane, one_pixel, none = cuda.local.array(FREE, f64), cuda.local.array(2, i64), cuda.local.array(1, f32)
        hits, flagged, stamps = cuda.local.array(1, i32), cuda.local.array(1, u8), cuda.local.array(1, u64)
        work = Work(
            scratch, flagged, hits, hits, one_lane, one_pixel, live, live, one_lane, one_lane, one_lane, one_lane, none,
            one_lane, stamps, one_lane, one_pixel, one_lane, one_pixel, one_lane,
        )  # fmt: skip
        if thread < planes.memory.size:
            settle_at(thread, clips, start, planes, work, flags, totals, tally)

    @jit
    def undo_kernel(listed, planes, saved):
        thread = cuda.grid(1)
        if thread < listed.count[0]:
            undo_listed(thread, listed, planes, saved, flags)

    @jit
    def propose_kernel(clips, asked):
        thread = cuda.grid(1)
        if thread < asked.count.size:
            propose(thread, clips, asked, flags)

    return Kernels(glance_kernel, jit(walk_kernel, REGISTERS), settle_kernel, undo_kernel, propose_kernel)
