"""How networks are run: with how many bits, and as torch does it by itself or compiled."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import nn

from vid2ev.errors import DataError, UsageError

PRECISIONS = {"float32": None, "bfloat16": torch.bfloat16, "float16": torch.float16}


@dataclass(frozen=True, slots=True)
class Running:
    """How a network is run.

    precision   bits of what convolutions take and give: float32, of which GPUs from Ampere on take 10 bits behind the
                point (TF32); bfloat16 and float16, which are fast where hardware has them.  Warps, blends and what is
                remembered stay in float32 (`interp.precision`)
    compiled    by torch, once for each size of frames, which takes half a minute or more; on a CPU that needs a
                C++ compiler
    Raises UsageError for a precision that is none.
    """

    precision: str = "float32"
    compiled: bool = False

    def __post_init__(self) -> None:
        if self.precision not in PRECISIONS:
            raise UsageError(f"precision '{self.precision}': expected one of {', '.join(PRECISIONS)}")

    def ready(self, network: Any) -> Any:
        """A network to be run like this; its parts are compiled when they are first used."""
        network = laid_out(network)
        for part in network.children() if self.compiled else ():
            assert isinstance(part, nn.Module)
            part.compile()
        return network

    @contextmanager
    def on(self, device: torch.device) -> Iterator[None]:
        """Within it networks are run like this.  Raises UsageError where there is no compiler."""
        kind = PRECISIONS[self.precision]
        with torch.autocast(device.type, kind, enabled=kind is not None):
            if not self.compiled:
                yield
                return
            from torch._dynamo.exc import ShortenTraceback  # (of a compiler that fails, or is missing, or of Triton)

            try:
                yield
            except ShortenTraceback as error:
                said = str(error).strip().splitlines()[0]
                raise UsageError(f"torch cannot compile networks here ({said}); leave out --compile") from error

    def describe(self) -> dict[str, Any]:
        """It as JSON."""
        return {"precision": self.precision, "compiled": self.compiled}


PLAIN = Running()


def finite(images: torch.Tensor, name: str, running: Running = PLAIN) -> torch.Tensor:
    """The images of a network of that name.  Raises DataError where they are no numbers, which weights can lead to, and
    few bits."""
    if not bool(torch.isfinite(images).all()):
        more_bits = "" if running.precision == PLAIN.precision else f" or --precision {PLAIN.precision}"
        raise DataError(f"network '{name}' made values that are no numbers; take other weights{more_bits}")
    return images


def laid_out(network: Any) -> Any:
    """A network as its device takes it best: on a GPU with the channels of a pixel beside each other, a third faster in
    16 bits."""
    on_gpu = any(weight.is_cuda for weight in network.parameters())
    return network.to(memory_format=torch.channels_last) if on_gpu else network


def compiles(device: str) -> bool:
    """Whether torch can compile for a device here."""
    try:
        with warnings.catch_warnings(), Running(compiled=True).on(torch.device(device)):
            warnings.simplefilter("ignore")  # (of torch's own parts, as its compiler is imported)
            torch.compile(torch.square)(torch.zeros(2, device=device))
    except UsageError:
        return False
    return True
