"""In the place of `vid2ev.kernels.company` on a GPU: the 32 threads of a warp go together.

A warp has one instruction at a time.  Threads that leave a loop earlier than others would go on by themselves, and the
warp through all that follows once for each: walks of busy pixels then had 4.5 threads at work of 32.  So they wait for
each other at the beginning of each frame, and go through loops as often as any of them has to.  All threads of a warp
must come to each of these places.
"""

from __future__ import annotations

import numpy as np
from numba import cuda

from vid2ev.compiling.compiler import inner

ALL = 0xFFFFFFFF


@inner
def together():
    """Wait for the others."""
    cuda.syncwarp(ALL)


@inner
def rolled(times):
    """So many times; the compiler, which does not know that `blockDim.y` is 1, cannot write the loop out."""
    return times + (np.int64(cuda.blockDim.y) - np.int64(1))


@inner
def anyone(does):
    """Whether any of those that go together does."""
    return cuda.any_sync(ALL, does)
