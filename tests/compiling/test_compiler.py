"""What is left out of numba's work on a kernel is not missed."""

from __future__ import annotations

import math
import operator
from collections import Counter
from typing import Any

import numpy as np
import pytest
from numba import complex64, int8
from numba.core.errors import TypingError
from numba.core.types.functions import BaseFunction

from vid2ev.compiling import call_types
from vid2ev.compiling.compiler import compiled, inlined, inner


def cube(x: float) -> float:
    return x * x * x + math.sin(x)


def test_a_kernel_gives_what_python_does_whoever_calls_it() -> None:
    for wrap in compiled, inlined:
        law = wrap(cube)

        @inner
        def part(x: float) -> float:
            return law(x) + 1.0  # noqa: B023 (called before the next)

        @compiled
        def kernel(x: float) -> float:
            return part(x) * law(x)  # noqa: B023

        assert kernel(1.25) == (cube(1.25) + 1.0) * cube(1.25)
        assert not law.overloads, "machine code was made of what only a kernel has called"
        assert law(1.25) == cube(1.25)
        assert len(law.overloads) == 1


def test_numba_is_asked_once_for_the_type_of_a_call(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: Counter = Counter()
    ask = call_types._ask

    def counting(function: Any, context: Any, args: tuple, kws: dict) -> Any:
        asked[function.typing_key, args] += 1
        return ask(function, context, args, kws)

    monkeypatch.setattr(call_types, "_ask", counting)

    @inner
    def part(a: complex, b: int) -> complex:
        return (a - b) * (a - b)

    @compiled
    def kernel(a: complex, b: int) -> complex:
        return part(a, b) + (a - b) + (a - b)

    assert kernel(np.complex64(3 + 1j), np.int8(2)) == (1 + 1j) ** 2 + 2 + 2j
    counts = {count for (name, args), count in asked.items() if (name, args) == (operator.sub, (complex64, int8))}
    assert counts == {2}, "once for the kernel, once for its part"


def test_numba_is_left_as_it_was_and_a_fault_is_a_fault_again() -> None:
    @compiled
    def kernel(x: float) -> float:
        return x + "metres"  # type: ignore[operator]

    before = BaseFunction.get_call_type
    for _ in range(2):
        with pytest.raises(TypingError, match="float64"):
            kernel(1.0)
        assert BaseFunction.get_call_type is before
