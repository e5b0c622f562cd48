"""In the place of `vid2ev.compiling.compiler` where a GPU is simulated: compiled for the CPU, under names of its own.

Machine code is linked by name: the function's, its types, and the number that it had among those compiled by its
process.  Kernels from the cache bring numbers of other processes, so a function with the name of one for blocks of many
pixels may be that one.  It is not cached for the same reason.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

from vid2ev.compiling import compiler as cpu

# (a simulated thread runs until it waits for others: what it counts needs no atomic operations, if it keeps the lock)
OPTIONS = cpu.OPTIONS | {"nogil": False}
INNER_OPTIONS = cpu.INNER_OPTIONS | {"nogil": False}


def compiled(function: Callable) -> Any:
    """A function that kernels call, or others that they call."""
    return cpu.of_plain_types(njit(pipeline_class=cpu.KernelCompiler, **OPTIONS)(named_apart(function)))


inlined = compiled


def inner(function: Callable) -> Any:
    """A function that only others call."""
    return cpu.inner(named_apart(function))


def named_apart(function: Callable) -> Callable:
    """The function, with another name than it has where it is for many pixels."""
    function.__qualname__ = f"one_pixel.{function.__qualname__}"
    return function
