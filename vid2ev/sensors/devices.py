"""On which device a recording is made: the CPU, a GPU of NVIDIA's, or one that is simulated.

`auto` takes the card where the whole is expected to be ready earlier there:

    on the CPU     P CPU_NS / threads              P = pixels of all cameras x frames x steps from frame to frame
    on the card    START_S + P CARD_NS

What is done on the CPU in both cases counts in neither: decoding, motion, pictures of the preview, writing.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any, NamedTuple

from vid2ev.errors import UsageError
from vid2ev.terminal import counted

DEVICES = ("cpu", "cuda", "auto")
SIMULATED = "simulated"  # for tests

# `python examples/benchmark_gpu.py` prints the first three.
CPU_NS = 29.0  # for a pixel and step, of one thread of an AMD EPYC (Zen 4): light by flow, sensor "paper"
START_S = 21.0  # until a card has made its first events: kernels are compiled
CARD_NS = 2.3  # for a pixel and step, of an H200
STEPS_OF_FLOW = 17.0  # from frame to frame, of `--subframes auto`: the median of eight clips, 1 to 51
UNKNOWN_FRAMES = 300  # what a source of unknown length is taken for


@dataclass(frozen=True)
class Device:
    """Where a recording is made: "cpu", "cuda" or "simulated"; what was asked for, and why it is made there."""

    name: str = "cpu"
    asked: str = "cpu"
    why: str = "as asked for"

    @property
    def light(self) -> str | None:
        """The device of torch's that light is on; None: light is in arrays."""
        if self.name == "cuda":  # (that of this thread, whichever thread takes light there)
            import torch

            return f"cuda:{torch.cuda.current_device()}"
        return "cpu" if self.name == SIMULATED else None

    @property
    def memory(self) -> Any:
        """Its memory, as of `memory_of`; None for the CPU."""
        return None if self.name == "cpu" else memory_of(self.name)

    def describe(self) -> dict[str, str]:
        """The device, ready for JSON."""
        return {"asked": self.asked, "used": self.name, "why": self.why}


CPU = Device()


class Work(NamedTuple):
    """What a recording takes."""

    pixels: int  # of all cameras
    frames: int | None  # of the source, if that is known
    steps: float  # from one to the next, as many as expected


def device_for(asked: str, work: Work, threads: int) -> Device:
    """The device that is asked for, "cpu", "cuda", "auto" or "simulated"; the CPU where there is no GPU.

    `threads` are those of the CPU.  Raises UsageError for another name.
    """
    if asked not in (*DEVICES, SIMULATED):
        raise UsageError(f"device '{asked}': expected one of {', '.join(DEVICES)}")
    if asked in ("cpu", SIMULATED):
        return Device(asked, asked)
    if asked == "auto" and (why := too_little(work, threads)):
        return Device("cpu", asked, why)
    if missing := missing_for_cuda():
        return Device("cpu", asked, missing)
    return Device("cuda", asked, "as asked for" if asked == "cuda" else "it is expected to be ready earlier there")


def too_little(work: Work, threads: int) -> str:
    """Why a card would not be ready earlier, in a few words; nothing if it would."""
    steps = work.pixels * (UNKNOWN_FRAMES if work.frames is None else work.frames) * work.steps
    cpu_s, card_s = 1e-9 * steps * CPU_NS / threads, START_S + 1e-9 * steps * CARD_NS
    if card_s < cpu_s:
        return ""
    unknown = f"; its length is unknown, and taken for {UNKNOWN_FRAMES} frames" * (work.frames is None)
    return f"about {cpu_s:.2g} s of {counted(threads, 'thread')}, and {card_s:.2g} s of a GPU{unknown}"


def missing_for_cuda() -> str:
    """What is missing for a GPU to be used, in a few words; nothing if all is there."""
    import torch

    if not torch.cuda.is_available():
        return "torch sees no GPU"
    if find_spec("numba_cuda") is None:
        return "numba-cuda is not installed (pip install 'vid2ev[cuda]')"
    if not import_module("numba.cuda").is_available():
        return "numba-cuda finds no compilers (pip install 'vid2ev[cuda]'), or no driver"
    return _too_new(import_module("numba.cuda.cudadrv.driver").driver.get_version(), version("cuda-bindings"))


def _too_new(driver: tuple[int, int], compilers: str) -> str:
    """What is wrong with a driver of a release of CUDA, and compilers of one; nothing if it can load what they make."""
    major = int(compilers.partition(".")[0])
    if driver[0] >= major:
        return ""
    said = f"the GPU's driver is for CUDA {driver[0]}.{driver[1]}, and numba-cuda's compilers are for CUDA {major}"
    return f"{said} (pip install 'vid2ev[cuda12]', or a newer driver)"


def memory_of(device: str) -> Any:
    """The memory of a device, "cuda" or "simulated" (`vid2ev.kernels.cuda.memory`).

    Raises UsageError where there is none.
    """
    from vid2ev.kernels.cuda.memory import Card, Simulated

    if device == SIMULATED:
        return Simulated()
    if missing := missing_for_cuda():
        raise UsageError(f"device cuda: {missing}; use device cpu")
    return Card()
