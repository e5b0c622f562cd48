"""The kernels of a frame sensor: each value of its rows goes through the CPU's kernels by itself."""

from __future__ import annotations

import numpy as np
from numba import cuda

from vid2ev.compiling.compiler import compiled
from vid2ev.kernels.cuda.counter import take
from vid2ev.kernels.cuda.machine import jit
from vid2ev.kernels.exposures import add_rows, read_rows, take_rows


@compiled
def take_value(y, x, taken, signed):
    """`take_rows`, which counts on the device."""
    j, i = slice(y, y + 1), slice(x, x + 1)
    bad = take_rows(taken.light[j, i], taken.rows[j, i], signed)
    if bad > 0:
        take(taken.mended, 0, bad)


@compiled
def add_value(y, x, added):
    """`add_rows`."""
    j, i = slice(y, y + 1), slice(x, x + 1)
    add_rows(added.total[j, i], added.before[j, i], added.weight_before[j], added.after[j, i], added.weight_after[j])


@compiled
def read_value(y, x, read, tick, num, words, noise):
    """`read_rows`; where a plane has no such value it is empty there."""
    j, i, first = slice(y, y + 1), slice(x, x + 1), y * read.total.shape[1] + x
    total, shade, gain, dark = read.total[j, i], read.shade[j, i], read.gain[j, i], read.dark[j, i]
    read_rows(total, shade, gain, dark, first, tick, num, words, noise, read.codes[j, i], read.light[j, i])


@jit
def take_values(taken, signed):
    thread, n = cuda.grid(1), taken.rows.shape[1]
    if thread < taken.rows.size:
        take_value(thread // n, thread % n, taken, signed)


@jit
def add_values(added):
    thread, n = cuda.grid(1), added.total.shape[1]
    if thread < added.total.size:
        add_value(thread // n, thread % n, added)


@jit
def read_values(read, tick, num):
    thread, n = cuda.grid(1), read.total.shape[1]
    words, noise = cuda.local.array((4, 1), np.uint32), cuda.local.array((2, 1), np.float64)
    noise[0, 0] = noise[1, 0] = 0.0
    if thread < read.total.size:
        read_value(thread // n, thread % n, read, tick, num, words, noise)
