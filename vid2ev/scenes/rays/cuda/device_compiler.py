"""In the place of `vid2ev.scenes.rays.compiler` on a GPU: all is inlined into its kernels, as there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import cuda


def law(function: Callable) -> Any:
    """A function that kernels call, or others that they call."""
    return cuda.jit(device=True, forceinline=True, lto=False)(function)


walk = law
