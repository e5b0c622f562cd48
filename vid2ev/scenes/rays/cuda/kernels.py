"""The kernels: list what tiles may see, trace the centres of all pixels, list those that are mixed, smooth these."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import cuda

from vid2ev.kernels.cuda.machine import jit
from vid2ev.scenes.rays.cuda.threads import carry_at, is_mixed_at, list_at, smooth_listed, trace_at
from vid2ev.scenes.rays.layout import STACK
from vid2ev.scenes.rays.scratch import KEYS

f64, i64 = np.float64, np.int64


class Kernels(NamedTuple):
    """Each takes `worlds`, `easel` and `listed`."""

    listing: Any  # a thread for each tile
    trace: Any  # for each pixel, tile by tile, as are those that follow
    mixing: Any
    smooth: Any
    carry: Any  # takes the world of the second instant, and `Carried`; for each pixel, row by row


def kernels_of(cells: tuple[int, int]) -> Kernels:
    """The kernels for pixels that are cut into so many cells each way: usually, and at details."""
    n = cells[1]
    square, wide, high, rows = (n + 1, n + 1), (n + 1, n), (n, n + 1), (KEYS, 5)

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
    def smooth_kernel(worlds, easel, listed):
        thread = cuda.grid(1)
        stack, keys = cuda.local.array(STACK, i64), cuda.local.array(KEYS, i64)
        corners, depths = cuda.local.array(square, i64), cuda.local.array(square, f64)
        across, down = cuda.local.array(wide, f64), cuda.local.array(high, f64)
        split, odd, parts = cuda.local.array(1, f64), cuda.local.array(1, i64), cuda.local.array(rows, f64)
        if thread < listed.total[0]:
            smooth_listed(
                thread, worlds, easel, listed, cells, stack, corners, across, down, depths, split, odd, keys, parts
            )

    @jit
    def carry_kernel(worlds, carried):
        stack = cuda.local.array(STACK, i64)
        carry_at(cuda.grid(1), worlds, carried, stack)

    return Kernels(listing_kernel, trace_kernel, mixing_kernel, smooth_kernel, carry_kernel)
