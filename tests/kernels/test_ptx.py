"""The kernels of a GPU as machine code of NVIDIA's (PTX), which needs compilers, but no GPU.

That code is what says whether arithmetic is that of the text: products and sums are rounded each by itself but where
the text fuses them.  Most sensors are slow: `python -m pytest tests/kernels/test_ptx.py -m "slow or not slow"` is all.
"""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from against.clips import AFTER_TRACKING, EVERYTHING, clean

from vid2ev.kernels.cuda.build import CARD, Build
from vid2ev.kernels.cuda.clips import Candidates, Clips, Listed, Sent, Start, Totals
from vid2ev.kernels.cuda.proposals import Proposals
from vid2ev.kernels.cuda.row_values import Added, Read, Taken
from vid2ev.kernels.layout import PITCH, Flags, Planes, stride_of
from vid2ev.sensors.cis_readout import numbers_of
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.compiled import flags_of
from vid2ev.sensors.spec import DvsSpec

pytestmark = pytest.mark.skipif(
    find_spec("numba_cuda") is None or find_spec("nvidia") is None,
    reason="needs numba-cuda and NVIDIA's compilers: pip install 'vid2ev[cuda]'",
)
CAPABILITY = (9, 0)
TWO_POLES = clean(photoreceptor_tau_us=300, follower_tau_us=100)
SENSORS = {"two poles": TWO_POLES, "paper": DvsSpec(), "everything": EVERYTHING, "after, tracking": AFTER_TRACKING}
QUICK = ("two poles",)


@pytest.fixture(scope="module", autouse=True)
def a_card_to_compile_for():
    """numba asks the GPU that is there for what it can do; none need be there."""
    from numba.cuda import dispatcher

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=CAPABILITY))
        yield


def array(kind: Any, *shape: int) -> np.ndarray:
    return np.zeros(shape or (1,), kind)


def arguments() -> dict[str, tuple]:
    """Of each kernel of the walk, arguments of the types that it is launched with."""
    f4, f8, i8, u8, u1 = np.float32, np.float64, np.int64, np.uint64, np.uint8
    planes = Planes(
        array(f4), array(f4), array(f8), array(f4, 1, 2), array(f4, 1, 2), array(i8), array(np.uint32), array(i8),
        array(i8), array(f4),
    )  # fmt: skip
    clips = Clips(
        1, array(f4, 1, 1, 1), array(f8, 1, 1), array(i8, 1, 1), array(f8, 1, 1, 1), array(i8, 1, 1, 1),
        array(u8, 1, 1), array(u1),
    )  # fmt: skip
    listed, totals = Listed(array(i8), array(np.int32), array(i8)), Totals(array(i8))
    candidates = Candidates(array(i8), array(i8), array(f8), array(i8), array(f8))
    asked = Proposals(
        array(i8), array(f8), 1, 1, array(i8), array(i8, 1, 1), array(f8, 1, 1), array(i8), array(i8), array(i8)
    )
    return {
        "glance": (clips, planes, listed, totals),
        "walk": (clips, listed, candidates, planes, planes, Sent(array(u8), array(i8)), totals),
        "settle": (clips, Start(array(i8), array(u1), array(u1)), planes, totals),
        "undo": (listed, planes, planes),
        "propose": (clips, asked),
    }


def of_rows() -> dict[str, tuple]:
    """The same of the kernels of frame sensors."""
    f4, f8 = array(np.float32, 1, 1), array(np.float64, 1, 1)
    num = numbers_of(CisSpec(), 2**64 - 1, 3)
    return {
        "take_values": (Taken(f4, f4, array(np.int64)), True),
        "add_values": (Added(f8, f4, f4, array(np.float64), array(np.float64)),),
        "read_values": (Read(f8, f4, f4, f4, f4, array(np.uint16, 1, 1)), 5, num),
    }


def ptx_of(flags: Flags, kernel: str) -> str:
    build = Build(CARD)
    ours = build.module("vid2ev.kernels.layout").Flags(*flags)
    kernels = build.module("vid2ev.kernels.cuda.kernels").kernels_of(ours, int(stride_of(flags)) // PITCH)
    return compiled(getattr(kernels, kernel), arguments()[kernel])


def compiled(kernel: Any, given: tuple) -> str:
    from numba import cuda
    from numba.cuda.typing.typeof import typeof

    types = tuple(typeof(argument) for argument in given)
    return cuda.compile(kernel.py_func, types, device=False, abi="numba", cc=CAPABILITY, output="ptx")[0]


def strictly(flags: Flags, kernel: str) -> str:
    from vid2ev.kernels.cuda.strict import strict

    with strict():
        return ptx_of(flags, kernel)


@pytest.mark.parametrize(
    "kernel", ["glance", pytest.param("walk", marks=pytest.mark.long), "settle", "undo", "propose"]
)
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SENSORS]
)
def test_kernels_compile_and_call_nothing(name, kernel):
    ptx = strictly(flags_of(SENSORS[name], labels=True), kernel)
    assert ".visible .entry" in ptx
    assert not re.search(r"^\s*call", ptx, re.MULTILINE), "all is in one piece, nothing is left to a library"


@pytest.mark.parametrize("kernel", of_rows())
def test_kernels_of_frame_sensors_do_so_and_keep_no_more_than_six_numbers_in_memory(kernel):
    from vid2ev.kernels.cuda.strict import strict

    with strict():
        module = Build(CARD).module("vid2ev.kernels.cuda.exposures")
        ptx = compiled(getattr(module, kernel), of_rows()[kernel])
    assert ".visible .entry" in ptx and not re.search(r"^\s*call", ptx, re.MULTILINE)
    scratch = re.findall(r"\.local .*\[(\d+)\]", ptx)
    assert scratch == (["32"] if kernel == "read_values" else [])  # four words, and noise of both kinds


def test_a_product_and_a_sum_are_fused_only_where_the_text_says_so():
    flags = flags_of(TWO_POLES, labels=False)
    assert "fma.rn.f32" in ptx_of(flags, "glance")  # as numba compiles, which shows that this can be seen
    strict = strictly(flags, "glance")
    assert "fma" not in strict and "mul.rn.f32" in strict and "add.rn.f32" in strict


def test_kernels_are_not_optimised_again_as_they_are_linked():
    """That would fuse products and sums."""
    flags = flags_of(TWO_POLES, labels=False)
    build = Build(CARD)
    ours = build.module("vid2ev.kernels.layout").Flags(*flags)
    kernels = build.module("vid2ev.kernels.cuda.kernels").kernels_of(ours, int(stride_of(flags)) // PITCH)
    inside = build.module("vid2ev.physics.elementary").log64
    assert [each.targetoptions["lto"] for each in (*kernels, inside)] == [False] * (len(kernels) + 1)


def test_numpy_without_a_name_that_numba_cuda_asks_for_stays_without_it():
    """As numpy 2.5 is."""
    code = (
        "import warnings; warnings.simplefilter('ignore'); import numpy as np; vars(np).pop('row_stack', None)\n"
        "from vid2ev.kernels.cuda.strict import strict\n"
        "with strict():\n    from numba.cuda import cudaimpl\n"
        "print('row_stack' in vars(np), cudaimpl.__name__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["False", "numba.cuda.cudaimpl"], done.stderr


@pytest.mark.long
@pytest.mark.parametrize("name", ["two poles", "paper"])
def test_a_walk_has_most_of_its_lane_in_registers(name):
    """Where the compiler does not know that there is one lane, that is 672 bytes of memory, and half again the code."""
    ptx = strictly(flags_of(SENSORS[name], labels=False), "walk")
    assert sum(map(int, re.findall(r"\.local .*\[(\d+)\]", ptx))) <= 320


@pytest.mark.long
def test_a_glance_at_a_pixel_is_in_registers():
    for spec in SENSORS.values():
        assert ".local" not in strictly(flags_of(spec, labels=False), "glance")
