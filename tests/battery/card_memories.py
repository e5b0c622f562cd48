"""Memories of a GPU that is simulated: with arrays, and with tensors as on a card."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from vid2ev.kernels.cuda.memory import UNSIGNED, Card, Simulated
from vid2ev.kernels.layout import Flags


class Tensors(Card):
    """A card's memory, with tensors of torch on the CPU, and the kernels of the simulator."""

    def __init__(self) -> None:
        super().__init__("cpu")

    def kernels(self, flags: Flags) -> Any:
        return Simulated().kernels(flags)

    def module(self, name: str) -> Any:
        return Simulated().module(name)

    def launch(self, kernel: Any, threads: int, *arguments: Any) -> None:
        Simulated().launch(kernel, threads, *(as_arrays(argument) for argument in arguments))


def as_arrays(argument: Any, place: tuple[str, str] = ("", "")) -> Any:
    """Tensors as the arrays that kernels see, which share their memory."""
    if hasattr(argument, "_fields"):
        kind = type(argument)
        return kind(*(as_arrays(getattr(argument, name), (kind.__name__, name)) for name in argument._fields))
    if not isinstance(argument, torch.Tensor):
        return argument
    assert argument.is_contiguous(), place  # (as `memory._seen` wants it)
    return argument.numpy().view(UNSIGNED.get(place, argument.numpy().dtype))


memories = pytest.mark.parametrize("memory", [Simulated(), Tensors()], ids=["arrays", "tensors"])
