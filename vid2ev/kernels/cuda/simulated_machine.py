"""In the place of `vid2ev.kernels.cuda.machine` where a GPU is simulated."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.cuda.simulator import kernel, kernelapi


class SharedArrays(kernelapi.FakeCUDAShared):
    """Arrays that the threads of a block share, one for each place in the code that asks for one.

    numba's own looks whether there is one already and then makes it: of threads that do so at the same time some get an
    array of their own, with whatever is in it, and then list pixels that there are not.  It also takes two arrays on
    one line for the same.
    """

    def array(self, shape: Any, dtype: Any) -> np.ndarray:
        """The array of the place that calls, zeros at first."""
        caller = sys._getframe(1)
        return self._allocations.setdefault((caller.f_code, caller.f_lasti), np.zeros(shape, dtype))


class SimulatedKernel(kernel.FakeCUDAKernel):
    """A kernel as numba simulates it, but for the arrays that its threads share."""

    def __call__(self, *arguments: Any) -> None:
        plain, kernelapi.FakeCUDAShared = kernelapi.FakeCUDAShared, SharedArrays  # type: ignore[misc]
        try:
            super().__call__(*arguments)
        finally:
            kernelapi.FakeCUDAShared = plain  # type: ignore[misc]


def jit(function: Callable, registers: int | None = None) -> SimulatedKernel:
    """A kernel."""
    return SimulatedKernel(function, device=False)
