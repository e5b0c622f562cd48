"""Functions for one pixel and for many are never taken for each other, although their text is the same."""

from __future__ import annotations

import re
from typing import Any

import pytest
from numba import float32, int64

from vid2ev.kernels.cuda.build import SIMULATED, Build


def names_in_machine_code(function: Any, types: tuple) -> set[str]:
    """Those by which it is linked, without the number that each process counts anew."""
    function.compile(types)
    return {re.sub(r"B\d+v\d+", "", code.fndesc.mangled_name) for code in function.overloads.values()}


@pytest.mark.parametrize(
    ("module", "name", "types"),
    [("layout", "place_of", (int64, int64)), ("turns", "balance", (float32,) * 5)],
    ids=["compiled", "inner"],
)
def test_names_in_machine_code_are_apart(module, name, types):
    many = getattr(__import__(f"vid2ev.kernels.{module}", fromlist=[name]), name)
    one = getattr(Build(SIMULATED).module(f"vid2ev.kernels.{module}"), name)
    assert one.py_func.__code__ == many.py_func.__code__ and one is not many
    ours, theirs = names_in_machine_code(one, types), names_in_machine_code(many, types)
    assert ours and theirs and not ours & theirs
