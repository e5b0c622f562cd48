"""In the place of `vid2ev.kernel_compiler` where a GPU is simulated: compiled for the CPU, and not cached, as what is
cached under the same names is for blocks of many pixels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

from vid2ev import kernel_compiler as cpu

# (a simulated thread runs until it waits for others: what it counts needs no atomic operations, if it keeps the lock)
OPTIONS = cpu.OPTIONS | {"nogil": False}
INNER_OPTIONS = cpu.INNER_OPTIONS | {"nogil": False}


def compiled(function: Callable) -> Any:
    """A function that kernels call, or others that they call."""
    return cpu.of_plain_types(njit(pipeline_class=cpu.KernelCompiler, **OPTIONS)(function))


inner = cpu.inner
