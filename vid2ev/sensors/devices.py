"""On which device a sensor is: the CPU, a GPU of NVIDIA's, or one that is simulated."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from vid2ev.errors import UsageError


def missing_for_cuda() -> str:
    """What is missing for a GPU to be used, in a few words; nothing if all is there."""
    import torch

    if not torch.cuda.is_available():
        return "torch sees no GPU"
    if find_spec("numba_cuda") is None:
        return "numba-cuda is not installed (pip install 'vid2ev[cuda]')"
    return ""


def memory_of(device: str) -> Any:
    """The memory of a device, "cuda" or "simulated" (`vid2ev.kernels.cuda.memory`).

    Raises UsageError where there is none.
    """
    from vid2ev.kernels.cuda.memory import Card, Simulated

    if device == "simulated":
        return Simulated()
    if missing := missing_for_cuda():
        raise UsageError(f"device cuda: {missing}; use device cpu")
    return Card()
