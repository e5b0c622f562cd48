"""What compiled code asks of the machine itself: the bits of numbers, and sums and products rounded once."""

from __future__ import annotations

from typing import Any

from numba import types

from vid2ev.kernel_extending import intrinsic


def _bitcast(source: Any, target: Any) -> Any:
    @intrinsic
    def cast(typing_context, value):
        def codegen(context, builder, signature, arguments):
            return builder.bitcast(arguments[0], context.get_value_type(target))

        return target(source), codegen

    return cast


@intrinsic
def fma(typing_context, a, b, c):
    """a * b + c, rounded once: the same bits on every machine, and one instruction on all but the oldest."""

    def codegen(context, builder, signature, arguments):
        return builder.fma(*arguments)

    return a(a, a, a), codegen


@intrinsic
def floor(typing_context, x):
    """The greatest whole number that is not greater, as a number of the same type."""
    return _rounded("llvm.floor", x)


@intrinsic
def sqrt(typing_context, x):
    """The square root, rounded once."""
    return _rounded("llvm.sqrt", x)


def _rounded(name: str, x: Any) -> Any:
    def codegen(context, builder, signature, arguments):
        return builder.call(builder.module.declare_intrinsic(name, [arguments[0].type]), arguments)

    return x(x), codegen


bits_32 = _bitcast(types.float32, types.int32)
float_32 = _bitcast(types.int32, types.float32)
bits_64 = _bitcast(types.float64, types.int64)
float_64 = _bitcast(types.int64, types.float64)
