"""Lengths of the fields of named tuples, and what is computed from them and other constants, as constants.

numba has its representation of functions and its passes over them twice, for CPUs and for GPUs; what is asked of it
is handed in.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Numba(NamedTuple):
    """The parts of numba that are needed: modules `ir` and `types`, functions of `ir_utils`."""

    ir: Any
    types: Any
    guard: Any
    get_definition: Any


def pass_over_flags(register_pass: Any, function_pass: Any, numba: Numba) -> type:
    """The pass of a compiler that does it, by numba's `register_pass` and its base of passes over functions."""

    @register_pass(mutates_CFG=False, analysis_only=False)
    class FlagsAreConstants(function_pass):
        _name = "flags_are_constants"

        def __init__(self) -> None:
            function_pass.__init__(self)

        def run_pass(self, state: Any) -> bool:
            return fold_flags(state.func_ir, state.args, numba)

    return FlagsAreConstants


def fold_flags(func_ir: Any, argument_types: tuple, numba: Numba) -> bool:
    """Make constants of all that are in a function of such arguments; returns whether there were any."""
    changed = False
    left = [stmt for block in func_ir.blocks.values() for stmt in block.find_insts(numba.ir.Assign)]
    while folded := [stmt for stmt in left if _fold(stmt, func_ir, argument_types, numba)]:
        left, changed = [stmt for stmt in left if stmt not in folded], True
    return changed


def _fold(stmt: Any, func_ir: Any, argument_types: tuple, numba: Numba) -> bool:
    """Make the value of an assignment a constant where it is one."""
    ir, value, constant = numba.ir, stmt.value, None
    if not isinstance(value, ir.Expr):
        return False
    if value.op == "call":
        constant = _flag_length(value, func_ir, argument_types, numba)
    elif value.op == "binop":
        sides = [numba.guard(numba.get_definition, func_ir, side) for side in (value.lhs, value.rhs)]
        if all(isinstance(side, ir.Const) for side in sides):
            constant = value.fn(*(side.value for side in sides))
    if constant is None:
        return False
    definitions = func_ir._definitions[stmt.target.name]
    stmt.value = ir.Const(constant, stmt.loc)
    definitions[definitions.index(value)] = stmt.value
    return True


def _flag_length(call: Any, func_ir: Any, argument_types: tuple, numba: Numba) -> int | None:
    """n for `len(argument.field)`, where the field is a tuple of length n."""
    ir, types, guard, get_definition = numba
    function, field = guard(get_definition, func_ir, call.func), None
    if isinstance(function, ir.Global) and function.value is len:
        field = guard(get_definition, func_ir, call.args[0])
    if not (isinstance(field, ir.Expr) and field.op == "getattr"):
        return None
    argument = guard(get_definition, func_ir, field.value)
    whole: Any = argument_types[argument.index] if isinstance(argument, ir.Arg) else None
    if not isinstance(whole, (types.NamedTuple, types.NamedUniTuple)) or field.attr not in whole.fields:
        return None
    part = whole.types[whole.fields.index(field.attr)]
    return len(part) if isinstance(part, types.BaseTuple) else None
