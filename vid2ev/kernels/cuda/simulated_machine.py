"""In the place of `vid2ev.kernels.cuda.machine` where a GPU is simulated."""

from __future__ import annotations

from numba.cuda import simulator

jit = simulator.jit
