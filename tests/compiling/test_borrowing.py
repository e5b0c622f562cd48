"""Kernels do not count who holds their arguments, and what they return is held all the same."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.runtime import _nrt_python, rtsys

from vid2ev.compiling.compiler import compiled, inner


class Planes(NamedTuple):
    """Two arrays in a record."""

    light: np.ndarray
    level: np.ndarray


@inner
def first_above(planes, k, least):
    """A part that cuts what it is given, gives names to it, hands it on, and may end anywhere."""
    for i in range(planes.light.shape[1]):
        light, level = planes.light[k], planes.level[k]
        if light[i] > least:
            return level[i]
        for j in range(i):
            if level[j] < 0.0:
                return handed_on(planes, level, j)
    return 0.0


@inner
def handed_on(planes, level, n):
    """A part of the part."""
    total = 0.0
    for i in range(n):
        other = level if planes.light[n, i] > 1e9 else planes.level[n]
        for j in range(i):
            if other[j] > 1e9:
                return total
        total += other[i]
    return total


@compiled
def levels_above(planes, least, found):
    """A kernel that returns no array."""
    for k in range(found.size):
        if planes.light[k, 0] < 0.0:
            continue
        found[k] = first_above(planes, k, least)
        if found[k] > 0.0:
            found[k] += first_above(planes, k, 2.0 * least)
    return found.size


@inner
def longer(keys, n):
    """The very argument, or a new array."""
    if n <= keys.size:
        return keys
    more = np.zeros(n, np.uint64)
    for i in range(keys.size):
        more[i] = keys[i]
    return more


@compiled
def grown(keys, n):
    """A kernel that returns an argument, or an array that it made of it, and makes others on the way."""
    for size in range(1, n + 1):
        keys = longer(keys, size)
        keys[size - 1] = size
    return keys


@compiled
def second_half(keys):
    """A kernel that returns a part of an argument."""
    return keys[keys.size // 2 :]


def test_arguments_are_not_counted() -> None:
    light, level, found = np.array([[1.0, 3.0], [1.0, 5.0]]), np.array([[5.0, 7.0], [6.0, 8.0]]), np.zeros(2)
    kernel = compiled(levels_above.py_func)
    kernel._cache = NullCache()  # (what comes out of a cache cannot be looked into)
    assert kernel(Planes(light, level), 2.0, found) == 2
    assert found.tolist() == [7.0, 16.0]
    (code,) = kernel.inspect_llvm().values()
    for function in code.split("\ndefine ")[1:]:
        name = function[function.index("@") :][:60]
        if "7cpython" not in name and "@NRT_" not in name:  # (what Python calls has to count)
            assert "@NRT_" not in function, name


def test_what_is_returned_outlives_what_was_given() -> None:
    for kernel, given in (
        (grown, (np.arange(1000, dtype=np.uint64), 3)),
        (second_half, (np.arange(2000, dtype=np.uint64),)),
    ):
        found = kernel(*given)
        expected = found.copy()
        del given
        gc.collect()
        others = [np.full(1000, 7, np.uint64) for _ in range(100)]  # where it was, if it was given back
        assert np.array_equal(found, expected)
        del others


@pytest.fixture
def _counted_allocations() -> Iterator[None]:
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


@pytest.mark.usefixtures("_counted_allocations")
@pytest.mark.parametrize("start", [0, 5, 5000])
def test_what_is_made_is_given_back_once(start: int) -> None:
    keys = np.zeros(start, np.uint64)
    found = grown(keys, 50)
    assert np.array_equal(found[:50], np.arange(1, 51))
    del found
    before = rtsys.get_allocation_stats()
    for _ in range(20):
        grown(keys, 50)
    after = rtsys.get_allocation_stats()
    assert after.alloc - before.alloc == after.free - before.free
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free
