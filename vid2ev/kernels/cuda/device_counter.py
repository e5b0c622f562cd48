"""In the place of `vid2ev.kernels.cuda.counter` on a GPU."""

from __future__ import annotations

from numba import cuda

from vid2ev.compiling.compiler import inner


@inner
def take(counter, place, some):
    """Add `some` to an entry of a counter; returns what it was."""
    return cuda.atomic.add(counter, place, some)
