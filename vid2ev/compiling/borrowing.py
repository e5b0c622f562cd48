"""Nobody counts, while a kernel runs, who holds an array: those who call it hold its arguments.

numba counts whenever an array gets a name, is handed on or cut, with instructions that threads exclude each other by.
That was a third of the time of a walk with shot noise (some 70 counts for each shot), a tenth without, and more where
two threads count the same arrays.  Here

    a kernel      takes its arguments for arrays that nobody has to count, so that counting them folds away
    inner parts   do not count at all

but where a function makes arrays, or is given some by what it calls; and arguments of a kind that it returns are
counted, as it may return the very argument.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from numba.core import cgutils, types
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering


class BorrowingLower(Lower):
    """numba's lowering of a kernel, whose arguments are borrowed."""

    def extract_function_arguments(self) -> list[Any]:
        """The values of the arguments."""
        returned = {array.dtype for array in arrays_of(self.fndesc.restype)}
        arguments = zip(self.fndesc.argtypes, super().extract_function_arguments(), strict=True)
        self.fnargs = [self._borrowed(kind, value, returned) for kind, value in arguments]
        return self.fnargs

    def _borrowed(self, kind: Any, value: Any, returned: set[Any]) -> Any:
        if isinstance(kind, types.Array) and kind.dtype not in returned:
            array = self.context.make_array(kind)(self.context, self.builder, value)
            array.meminfo, array.parent = (cgutils.get_null_value(part.type) for part in (array.meminfo, array.parent))
            return array._getvalue()
        if parts := parts_of(kind):
            taken = [self._borrowed(part, self.builder.extract_value(value, k), returned) for k, part in parts]
            return self.context.make_tuple(self.builder, kind, taken)
        return value


@register_pass(mutates_CFG=True, analysis_only=False)
class LoweringWithBorrowing(NativeLowering):
    """The pass: of kernels with BorrowingLower, of inner parts without counting."""

    _name = "lowering_with_borrowing"

    def run_pass(self, state: Any) -> bool:
        self._kernel, counting = not state.flags.no_cpython_wrapper, state.targetctx
        if not self._kernel and not _is_given_arrays(state):
            state.targetctx = counting.subtarget(enable_nrt=False)
        try:
            return super().run_pass(state)
        finally:
            state.targetctx = counting

    @property
    def lowering_class(self) -> type[Lower]:
        return BorrowingLower if self._kernel else Lower


def _is_given_arrays(state: Any) -> bool:
    """Whether a function makes or returns arrays, or is given some by what it calls."""
    kinds = [state.return_type]
    kinds += [call.return_type for asked, call in state.calltypes.items() if getattr(asked, "op", "") == "call"]
    return any(True for kind in kinds for _ in arrays_of(kind))


def arrays_of(kind: Any) -> Iterator[Any]:
    """The types of all arrays in a type."""
    if isinstance(kind, types.Array):
        yield kind
    for _, part in parts_of(kind):
        yield from arrays_of(part)


def parts_of(kind: Any) -> list[tuple[int, Any]]:
    """The types of what is in a record, with their numbers; none of anything else."""
    return [*enumerate(iter(kind))] if isinstance(kind, types.BaseTuple) else []  # type: ignore[call-overload]
