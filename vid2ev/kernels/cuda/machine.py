"""How kernels are made for a GPU."""

from __future__ import annotations

from numba import cuda

jit = cuda.jit(lto=False)
