"""What compiled code asks of the machine itself: the bits of numbers, and sums and products rounded once."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from vid2ev.compiling.extending import intrinsic


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


@intrinsic
def prefetch(typing_context, array, index):
    """Begin to bring an entry of an array to the second cache; nothing waits for it."""

    def codegen(context, builder, signature, arguments):
        view = context.make_array(array)(context, builder, arguments[0])
        entry = cgutils.get_item_pointer(context, builder, array, view, [arguments[1]], wraparound=False)
        number = ir.IntType(32)
        shape = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, number, number, number])
        fetch = cgutils.get_or_insert_function(builder.module, shape, "llvm.prefetch.p0")
        builder.call(fetch, [builder.bitcast(entry, cgutils.voidptr_t), number(0), number(2), number(1)])
        return context.get_dummy_value()

    return types.none(array, types.int64), codegen


@intrinsic
def put_eight(typing_context, array, index, first, packed):
    """Write `first` + each of the eight bytes of `packed` to an array of int32 from an index on, in one go."""

    def codegen(context, builder, signature, arguments):
        view = context.make_array(array)(context, builder, arguments[0])
        entry = cgutils.get_item_pointer(context, builder, array, view, [arguments[1]], wraparound=False)
        number, eight = ir.IntType(32), ir.VectorType(ir.IntType(32), 8)
        parts = builder.zext(builder.bitcast(arguments[3], ir.VectorType(ir.IntType(8), 8)), eight)
        one = builder.insert_element(ir.Constant(eight, ir.Undefined), arguments[2], number(0))
        every = builder.shuffle_vector(one, ir.Constant(eight, ir.Undefined), ir.Constant(eight, [0] * 8))
        builder.store(builder.add(parts, every), builder.bitcast(entry, eight.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.none(array, types.int64, types.int32, types.uint64), codegen


@intrinsic
def from_entry(typing_context, array, index):
    """An array as long as this one that begins at another entry than its first, before or after it, unchecked: it is up
    to the caller that there is one."""

    def codegen(context, builder, signature, arguments):
        view = context.make_array(array)(context, builder, arguments[0])
        other = context.make_array(array)(context, builder)
        context.populate_array(
            other,
            data=builder.gep(view.data, [arguments[1]]),
            shape=view.shape,
            strides=view.strides,
            itemsize=view.itemsize,
            meminfo=None,
        )
        return other._getvalue()

    return array(array, types.int64), codegen


bits_32 = _bitcast(types.float32, types.int32)
float_32 = _bitcast(types.int32, types.float32)
bits_64 = _bitcast(types.float64, types.int64)
float_64 = _bitcast(types.int64, types.float64)
