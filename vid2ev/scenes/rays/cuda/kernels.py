"""The kernels: list what tiles may see, trace the centres of all pixels, list those that are mixed, measure these.

To measure, each thread has one thing to look for, a corner, a change of key along a side, the middle of a cell: where
a thread had a pixel, those that run together waited for the one with most in it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import cuda

from vid2ev.kernels.cuda.machine import jit
from vid2ev.scenes.rays.cuda.threads import (
    carry_at,
    change_at,
    corner_at,
    is_mixed_at,
    list_at,
    list_changes,
    middle_at,
    mix_at,
    part_at,
    trace_at,
)
from vid2ev.scenes.rays.layout import STACK
from vid2ev.scenes.rays.scratch import KEYS

f64, i64 = np.float64, np.int64


class Kernels(NamedTuple):
    """The first three take `worlds`, `easel` and `listed`, those that measure `worlds` and `measured`."""

    listing: Any  # a thread for each tile
    trace: Any  # for each pixel, tile by tile
    mixing: Any
    corner: Any  # for each corner of the cells of each pixel that is measured
    part: Any  # for each pixel
    change: Any  # for each side
    middle: Any  # for each cell
    mix: Any  # for each pixel
    carry: Any  # takes the world of the second instant, and `Carried`; for each pixel, row by row


def all_kernels() -> Kernels:
    """The kernels."""

    @jit
    def listing_kernel(worlds, easel, listed):
        list_at(cuda.grid(1), worlds, easel, listed)

    @jit
    def trace_kernel(worlds, easel, listed):
        stack = cuda.local.array(STACK, i64)
        trace_at(cuda.grid(1), worlds, easel, listed, stack)

    @jit
    def mixing_kernel(worlds, easel, listed):
        found = cuda.shared.array(1, i64)
        start = cuda.shared.array(1, i64)
        place = 0
        if cuda.threadIdx.x == 0:
            found[0] = 0
        cuda.syncthreads()
        mixed = is_mixed_at(cuda.grid(1), worlds, easel, listed)
        if mixed:
            place = cuda.atomic.add(found, 0, 1)
        cuda.syncthreads()
        if cuda.threadIdx.x == 0:
            start[0] = cuda.atomic.add(listed.total, 0, found[0])
        cuda.syncthreads()
        if mixed:
            listed.mixed[start[0] + place] = cuda.grid(1)

    @jit
    def corner_kernel(worlds, measured):
        stack = cuda.local.array(STACK, i64)
        corner_at(cuda.grid(1), worlds, measured, stack)

    @jit
    def part_kernel(worlds, measured):
        p, stack = cuda.grid(1), cuda.local.array(1, i64)
        if p < measured.pixels.size:
            sides, shared = part_at(p, worlds, measured, stack)
            first_side = cuda.atomic.add(measured.totals, 0, sides)
            first_shared = cuda.atomic.add(measured.totals, 1, shared)
            list_changes(p, measured, stack, first_side, first_shared)

    @jit
    def change_kernel(worlds, measured):
        stack = cuda.local.array(STACK, i64)
        change_at(cuda.grid(1), worlds, measured, stack)

    @jit
    def middle_kernel(worlds, measured):
        stack = cuda.local.array(STACK, i64)
        middle_at(cuda.grid(1), worlds, measured, stack)

    @jit
    def mix_kernel(worlds, measured):
        p, stack = cuda.grid(1), cuda.local.array(STACK, i64)
        keys, parts = cuda.local.array(KEYS, i64), cuda.local.array((KEYS, 5), f64)
        if p < measured.pixels.size and not mix_at(p, worlds, measured, stack, keys, parts):
            measured.finer[cuda.atomic.add(measured.totals, 2, 1)] = measured.pixels[p]

    @jit
    def carry_kernel(worlds, carried):
        stack = cuda.local.array(STACK, i64)
        carry_at(cuda.grid(1), worlds, carried, stack)

    return Kernels(
        listing_kernel, trace_kernel, mixing_kernel, corner_kernel, part_kernel, change_kernel, middle_kernel,
        mix_kernel, carry_kernel,
    )  # fmt: skip
