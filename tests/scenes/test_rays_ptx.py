"""The ray caster's kernels as machine code of NVIDIA's (PTX), which needs compilers, but no GPU."""

from __future__ import annotations

import re
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vid2ev.kernels.cuda.build import Build
from vid2ev.kernels.cuda.memory import Simulated
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import IDENTITY
from vid2ev.scenes.on_card import BUILT_ANEW, CARD, PainterOnCard
from vid2ev.scenes.rays.cuda.kernels import Kernels
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world_numbers import numbers_of

pytestmark = pytest.mark.skipif(
    find_spec("numba_cuda") is None or find_spec("nvidia") is None,
    reason="needs numba-cuda and NVIDIA's compilers: pip install 'vid2ev[cuda]'",
)
CAPABILITY = (9, 0)
# Functions of NVIDIA's own library for angles and powers, too long to be in one piece with what calls them.
LIBRARY = {"__internal_accurate_pow", "__internal_trig_reduction_slowpathd"}
PARAMETERS = 4096  # bytes that a kernel takes on any card and driver


class Asked(Simulated):
    """What kernels are launched with, in the place of launching them; one of whatever is counted there was found."""

    def __init__(self) -> None:
        self.arguments: dict[Any, tuple] = {}

    def get(self, array):
        return np.ones_like(array)

    def launch(self, kernel, threads, *arguments):
        self.arguments[kernel] = arguments


def arguments() -> dict[str, tuple]:
    """Of each kernel, arguments of the types that it is launched with."""
    memory, camera = Asked(), Intrinsics.of_field((14, 14), 60)
    numbers, painter = numbers_of(Snapshot(), IDENTITY), PainterOnCard(memory, camera, 2)
    (picture,) = painter.paint([numbers], [np.zeros((0, 2), np.int64)])
    painter.flow(picture, numbers, np.zeros((1, 3, 4)))
    return dict(zip(Kernels._fields, memory.arguments.values(), strict=True))


def ptx_of(kernel: str) -> str:
    from numba import cuda
    from numba.cuda import dispatcher
    from numba.cuda.typing.typeof import typeof

    from vid2ev.kernels.cuda.strict import strict

    kernels = Build(CARD, BUILT_ANEW).module("vid2ev.scenes.rays.cuda.kernels").all_kernels()
    types = tuple(typeof(argument) for argument in arguments()[kernel])
    function: Any = getattr(kernels, kernel).py_func
    with pytest.MonkeyPatch.context() as patch, strict():
        # (numba asks the GPU that is there for what it can do; none need be there)
        patch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=CAPABILITY))
        return cuda.compile(function, types, device=False, abi="numba", cc=CAPABILITY, output="ptx")[0]


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("carry", "trace", "corner", "change", "middle", "mix")]


@pytest.mark.parametrize("kernel", ["listing", "mixing", "part", *SLOW])
def test_kernels_are_in_one_piece_and_no_card_takes_them_for_too_large(kernel):
    head, _, body = ptx_of(kernel).partition(".visible .entry")[2].partition("{")
    called = re.findall(r"^\s*call\S*\s+(?:\(\w+\),\s*)?(\w+)", body, re.MULTILINE)
    assert {*called} <= LIBRARY, "all of ours is inlined"
    parameters = re.findall(r"\.param \.[busf](\d+)", head)
    assert parameters and len(parameters) == head.count(".param")
    assert sum(map(int, parameters)) // 8 <= PARAMETERS


def test_a_product_and_a_sum_are_not_fused():
    ptx = ptx_of("mixing")
    assert "fma" not in ptx and "mul.rn.f64" in ptx
