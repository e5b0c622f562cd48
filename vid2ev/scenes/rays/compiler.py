"""How the laws of rays are compiled: into one piece, without counting references.

A world is some forty arrays.  Passed by value from function to function, and counted each time, they would cost ten
times as much as the rays: so everything is inlined into the walk, and nothing in it makes or frees memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

from vid2ev.compiling.cache import of_this_version
from vid2ev.compiling.compiler import OPTIONS, KernelCompiler, of_plain_types

UNCOUNTED: dict[str, Any] = OPTIONS | {"_nrt": False, "pipeline_class": KernelCompiler}
INLINED: dict[str, Any] = UNCOUNTED | {"no_cpython_wrapper": True, "forceinline": True}


def law(function: Callable) -> Any:
    """A part of a walk, which only compiled code can call; it may make no arrays."""
    return of_plain_types(njit(**INLINED)(function))


def walk(function: Callable) -> Any:
    """What Python calls: compiled and cached; it may make no arrays."""
    return of_this_version(of_plain_types(njit(**UNCOUNTED | {"cache": True})(function)))
