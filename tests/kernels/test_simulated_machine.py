"""Threads of a simulated GPU share what they are to share: numba's simulator does not see to it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import cuda

from vid2ev.kernels.cuda.simulated_machine import jit

THREADS = 32


class Counted(NamedTuple):
    """(numba's simulator takes arrays in tuples as they are, and asks the driver of a GPU for others)"""

    places: np.ndarray  # int64 [threads]
    totals: np.ndarray  # int64 [blocks]


@jit
def count(into: Counted) -> None:
    """Each thread takes a place of its block; the first one says how many are taken."""
    taken = cuda.shared.array(1, np.int64)
    if cuda.threadIdx.x == 0:
        taken[0] = 0
    cuda.syncthreads()
    into.places[cuda.grid(1)] = cuda.atomic.add(taken, 0, 1)
    cuda.syncthreads()
    if cuda.threadIdx.x == 0:
        into.totals[cuda.blockIdx.x] = taken[0]


@jit
def write_two(into: Counted) -> None:
    one, other = cuda.shared.array(1, np.int64), cuda.shared.array(1, np.int64)
    one[0], other[0] = 1, 2
    into.totals[0] = one[0]


@pytest.fixture
def arrays_take_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """While one thread makes an array, others run."""
    for name in ("zeros", "empty"):
        monkeypatch.setattr(np, name, slow(getattr(np, name)))


def slow(made: Callable) -> Callable:
    def make(*shape_and_type: Any, **more: Any) -> Any:
        time.sleep(1e-4)
        return made(*shape_and_type, **more)

    return make


@pytest.mark.usefixtures("arrays_take_time")
def test_all_threads_of_a_block_count_in_one_array():
    counted = Counted(np.full(2 * THREADS, -1, np.int64), np.full(2, -1, np.int64))
    count[2, THREADS](counted)
    np.testing.assert_array_equal(np.sort(counted.places.reshape(2, THREADS)), [np.arange(THREADS)] * 2)
    np.testing.assert_array_equal(counted.totals, [THREADS] * 2)


def test_two_arrays_of_a_line_are_two():
    counted = Counted(np.zeros(1, np.int64), np.zeros(1, np.int64))
    write_two[1, 1](counted)
    assert counted.totals[0] == 1
