"""How kernels are compiled for a GPU: what is off is left out, and arithmetic is that of the text.

numba's compiler for GPUs has no options for either.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from vid2ev.compiling.flags import Numba, pass_over_flags

NO_MORE = "row_stack"
_lock = threading.RLock()


@contextmanager
def strict() -> Iterator[None]:
    """What numba compiles for a GPU within knows its flags, and has `-fma=0`: a product and a sum are fused where the
    text says so, and nowhere else."""
    compiler: Any = import_module("numba.cuda.compiler")
    nvvm: Any = import_module("numba.cuda.cudadrv.nvvm")
    with _lock:
        _load()
        plain, plain_compiler = nvvm.compile_ir, compiler.CUDACompiler

        def compile_ir(modules: Any, **options: Any) -> Any:
            return plain(modules, **(options | {"fma": False}))

        nvvm.compile_ir, compiler.CUDACompiler = compile_ir, _compiler()
        try:
            yield
        finally:
            nvvm.compile_ir, compiler.CUDACompiler = plain, plain_compiler


@cache
def _load() -> None:
    """What numba compiles for a GPU, loaded.  Up to 0.30 numba-cuda asks for `numpy.row_stack`, which numpy 2.5 has no
    more: it is lent one."""
    lent = not hasattr(np, NO_MORE)
    if lent:
        setattr(np, NO_MORE, np.vstack)
    try:
        import_module("numba.cuda.cudaimpl")
    finally:
        if lent:
            delattr(np, NO_MORE)


@cache
def _compiler() -> Any:
    """numba's compiler for GPUs with the lengths of flags as constants."""
    from numba.cuda import types
    from numba.cuda.compiler import CUDACompiler
    from numba.cuda.core import ir
    from numba.cuda.core.compiler_machinery import FunctionPass, register_pass
    from numba.cuda.core.ir_utils import get_definition, guard
    from numba.cuda.core.untyped_passes import RewriteSemanticConstants

    flags_are_constants = pass_over_flags(register_pass, FunctionPass, Numba(ir, types, guard, get_definition))

    class Compiler(CUDACompiler):
        def define_pipelines(self) -> list:
            passes = super().define_pipelines()
            passes[0].add_pass_after(flags_are_constants, RewriteSemanticConstants)
            passes[0].finalize()
            return passes

    return Compiler
