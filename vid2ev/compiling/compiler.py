"""How kernels are compiled: no more than a walk calls for, and each part once.

**Flags.** A kernel gets its flags as a named tuple of tuples, empty where an effect is off, so their types say which
effects are on.  numba prunes branches that are constant before it infers types, but does not know that
`len(flags.noise)` is a constant.  `FlagsAreConstants` tells it, so what is off is not even looked at.

**Inner functions.** numba optimises each function and makes machine code of it, and again wherever it is called.  What
kernels call is here made ready to be inlined, and no more, also where Python calls it as well.

**Arguments** are borrowed (`compiling/borrowing.py`).

**Passes.** Of numba's passes over a function those are left out that look for what kernels do not have: closures,
`with`, `raise` with values, literals to be unrolled, expressions of whole arrays.

**Caches** are of one version of all files that kernels are made of (`compiling/cache.py`).

**Types.** numba has a variant of a function for each literal that it is called with; here a literal is an int64.
"""

from __future__ import annotations

import dis
import functools
import gc
from collections.abc import Callable
from typing import Any

from llvmlite.binding import Linkage, get_host_cpu_features
from numba import _dynfunc, njit  # type: ignore[attr-defined]
from numba.core import ir, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import FunctionPass, LoweringPass, PassManager, register_pass
from numba.core.ir_utils import get_definition, guard
from numba.core.typed_passes import (
    IRLegalization,
    NoPythonBackend,
    NoPythonSupportedFeatureValidation,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    GenericRewrites,
    IRProcessing,
    ReconstructSSA,
    RewriteSemanticConstants,
    TranslateByteCode,
)

from vid2ev.compiling.borrowing import LoweringWithBorrowing
from vid2ev.compiling.cache import of_this_version
from vid2ev.compiling.call_types import kept_call_types
from vid2ev.compiling.flags import Numba, pass_over_flags

OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
INNER_OPTIONS = OPTIONS | {"no_cpython_wrapper": True}


def compiled(function: Callable) -> Any:
    """A kernel: compiled and cached, for Python and other kernels to call."""
    return _for_python_and_kernels(function, {})


def inlined(function: Callable) -> Any:
    """A law that is put into what calls it, however long it is: so a loop over pixels that does is vector code."""
    return _for_python_and_kernels(function, {"forceinline": True})


def inner(function: Callable) -> Any:
    """A part of kernels, which only they can call."""
    return _for_kernels(function, {})


def _for_kernels(function: Callable, options: dict[str, Any]) -> Any:
    return of_plain_types(njit(pipeline_class=KernelCompiler, **INNER_OPTIONS, **options)(function))


def _for_python_and_kernels(function: Callable, options: dict[str, Any]) -> Any:
    """A function for Python, cached; kernels take it as an inner one, for which no machine code is made."""
    dispatcher = njit(cache=True, pipeline_class=KernelCompiler, **OPTIONS, **options)(function)
    part = _for_kernels(function, options)
    dispatcher.get_call_template, dispatcher.get_overload = part.get_call_template, part.get_overload
    return of_this_version(dispatcher)


def of_plain_types(dispatcher: Any) -> Any:
    template_of = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, kws: template_of([types.unliteral(arg) for arg in args], kws)
    return dispatcher


FlagsAreConstants = pass_over_flags(register_pass, FunctionPass, Numba(ir, types, guard, get_definition))


class WideLibrary(JITCodeLibrary):
    """Code in vectors as wide as the machine has them.

    LLVM takes half of them on Intel's machines, as the first that had wide ones ran slower for using them; later ones,
    which have VBMI2, do not (sensors take 4 to 13 % less time by it, light carried along motion a fifth).
    """

    def add_ir_module(self, ir_module: Any) -> None:
        if has_wide_vectors():
            for function in ir_module.functions:
                if not function.is_declaration:
                    set.add(function.attributes, '"prefer-vector-width"="512"')  # (llvmlite knows no such attribute)
        super().add_ir_module(ir_module)


@functools.cache
def has_wide_vectors() -> bool:
    """Whether the machine has vectors of 64 bytes, and is none the slower for them."""
    return bool(get_host_cpu_features().get("avx512vbmi2"))


class InnerLibrary(WideLibrary):
    """The code of an inner function: optimised only as far as its loops vectorise, and without machine code.

    Parts of it in which loops are within loops are added after that: they have been through it themselves, and no
    loop that calls one vectorises.
    """

    has_loops = True
    put_into_loops = False
    depth = 0  # of loops within each other

    def finalize(self) -> None:
        parts = [part for part in self._linking_libraries if isinstance(part, InnerLibrary)]
        late = list(dict.fromkeys(part for part in parts if part.depth > 1))
        self.depth = 0 if self.put_into_loops else self.has_loops + max([part.depth for part in parts], default=0)
        self._linking_libraries = [part for part in self._linking_libraries if part not in late]
        super().finalize()
        for part in late:
            self._final_module.link_in(part._get_module_for_linking(), preserve=True)

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout  # (the rest is done once all is linked)

    def _optimize_final_module(self) -> None:
        if not self.has_loops:
            return
        # (without it, what is inlined into a loop late keeps that loop from being vectorised)
        passes, builder = self._codegen._module_pass_manager(loop_vectorize=True, slp_vectorize=False, cost="cheap")
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class KernelLibrary(WideLibrary):
    """The code of a kernel: its parts are its own, and what has one caller is put into it.

    A record goes to a part as its numbers, some hundred of them: a call that stays takes longer than to look at a strip
    of pixels.  Of what belongs to nobody else LLVM also drops the arguments that are not used.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()


@register_pass(mutates_CFG=True, analysis_only=False)
class CallableByKernels(LoweringPass):
    """What numba does with lowered code in the end, but without an address: for inner functions."""

    _name = "callable_by_kernels"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        if not state.flags.no_compile:
            return False
        lowered, libraries = state["cr"], (state.library,)
        fndesc = lowered.fndesc
        key = _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "", 0, lowered.env, libraries)
        state.targetctx.insert_user_function(key, fndesc, libraries)
        state["cr"] = lowered._replace(cfunc=key)
        return True


def has_loops(function: Callable) -> bool:
    """Whether a function goes back to do something again."""
    return any("JUMP_BACKWARD" in step.opname for step in dis.get_instructions(function))


PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    RewriteSemanticConstants,
    FlagsAreConstants,
    DeadBranchPrune,
    GenericRewrites,
    ReconstructSSA,
    DeadBranchPrune,
    NopythonTypeInference,
    PreLowerStripPhis,
    NoPythonSupportedFeatureValidation,
    IRLegalization,
    LoweringWithBorrowing,
    CallableByKernels,
    NoPythonBackend,
)


class KernelCompiler(CompilerBase):
    """numba's own compiler with these changes."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, args: Any, result: Any, flags: Any, names: Any):
        super().__init__(typingctx, targetctx, library, args, result, flags, names)
        if flags.no_cpython_wrapper:
            flags.no_compile = True
            self.state.library = InnerLibrary(targetctx.codegen(), "inner")
            self.state.library.put_into_loops = bool(flags.forceinline)
        else:
            self.state.library = KernelLibrary(targetctx.codegen(), "kernel")
            self.state.library.enable_object_caching()

    def compile_extra(self, function: Callable) -> Any:
        if isinstance(self.state.library, InnerLibrary):
            self.state.library.has_loops = has_loops(function)
        # (what a compilation makes is kept: looking for garbage in it takes a tenth of the time)
        collects = gc.isenabled()
        gc.disable()
        try:
            with kept_call_types():
                return super().compile_extra(function)
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> list:
        passes = PassManager("kernel")
        for each in PASSES:
            passes.add_pass(each, each.__name__)
        passes.finalize()
        return [passes]
