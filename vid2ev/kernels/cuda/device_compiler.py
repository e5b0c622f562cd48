"""In the place of `vid2ev.compiling.compiler` on a GPU: functions that its kernels call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import cuda

INNER_OPTIONS: dict[str, Any] = {}


def compiled(function: Callable) -> Any:
    """A function that kernels call, or others that they call."""
    return cuda.jit(function, device=True, lto=False)


inlined = inner = compiled
