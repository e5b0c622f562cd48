"""How kernels are made for a GPU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import cuda


def jit(function: Callable, registers: int | None = None) -> Any:
    """A kernel, linked as it is compiled: what optimises again while it links fuses products and sums.

    (The decorator that `cuda.jit(lto=False)` gives forgets that it was asked for.)

    registers   of each thread at most, so that there are more threads
    """
    return cuda.jit(function, lto=False, max_registers=registers)
