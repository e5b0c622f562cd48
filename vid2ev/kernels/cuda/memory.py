"""Where arrays of a GPU are, and how its kernels are launched: a card through torch, or one that is simulated."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from vid2ev.kernels.cuda.build import CARD, SIMULATED, Build
from vid2ev.kernels.layout import PITCH, Flags, stride_of

THREADS = 128  # of a block
# What torch has as signed numbers for want of these, by the tuple that it is in, and its name there.
UNSIGNED = {
    ("Planes", "count"): np.uint32, ("Clips", "bases"): np.uint64, ("Sent", "keys"): np.uint64,
    ("Read", "codes"): np.uint16,
}  # fmt: skip
SIGNED = {np.dtype(np.uint16): np.int16, np.dtype(np.uint32): np.int32, np.dtype(np.uint64): np.int64}


class Simulated:
    """numba's simulator of a GPU: each thread a thread of Python, which calls code compiled for the CPU."""

    name = "simulated"

    def zeros(self, shape: Any, dtype: Any) -> Any:
        """An array of zeros."""
        return np.zeros(shape, dtype)

    def like(self, array: Any) -> Any:
        """A device's array of the same shape and type, with anything in it."""
        return np.empty_like(array)

    def put(self, array: np.ndarray) -> Any:
        """A copy of an array, on the device."""
        return np.array(array)

    def get(self, array: Any) -> np.ndarray:
        """A copy of a device's array, as one of numpy."""
        return np.array(array)

    def light(self, light: Any) -> Any:
        """Light, an array or a tensor, as contiguous float32."""
        return _linear(light.detach().numpy() if hasattr(light, "detach") else light)

    def count_to(self, n: int) -> Any:
        """0, 1, ... n - 1."""
        return np.arange(n)

    def order(self, numbers: Any) -> Any:
        """Indices of numbers in ascending order, those of equals as they are."""
        return np.argsort(numbers, kind="stable")

    def ordered(self, keys: Any) -> Any:
        """Keys, as int64, in order of what is above their lowest three bits, those of equals as they are."""
        return keys[self.order(keys >> np.uint64(3))].view(np.int64)

    def joined(self, parts: Any) -> Any:
        """Arrays one after the other."""
        return np.concatenate(parts)

    def searchsorted(self, ascending: Any, numbers: Any) -> Any:
        """How many of the ascending numbers are less than each of the others."""
        return np.searchsorted(ascending, numbers)

    def add_at(self, sums: Any, places: Any, values: Any) -> None:
        """Add whole numbers to those at some places, as often as a place is named."""
        np.add.at(sums, places, values)

    def cast(self, array: Any, dtype: Any) -> Any:
        """An array of another type."""
        return array.astype(dtype)

    def launch(self, kernel: Any, threads: int, *arguments: Any) -> None:
        """Run a kernel with at least so many threads."""
        if threads > 0:
            kernel[-(-threads // THREADS), THREADS](*arguments)

    def kernels(self, flags: Flags) -> Any:
        """The kernels for a combination of effects."""
        return _kernels("simulated", flags)

    def module(self, name: str) -> Any:
        """A module of kernels, as it is for this device."""
        return _build("simulated").module(name)


class Card:
    """A GPU of NVIDIA's, through torch: no copies between its tensors and the kernels."""

    name = "cuda"

    def __init__(self, device: str = "cuda") -> None:
        import torch

        self.torch, self.device = torch, torch.device(device)
        if device == "cuda":  # (that of this thread, whichever thread asks next)
            self.device = torch.device("cuda", torch.cuda.current_device())
        self._compiled: dict[Any, Any] = {}  # each kernel as it is for the types that it is always launched with

    def zeros(self, shape: Any, dtype: Any) -> Any:
        kind = np.dtype(dtype)
        kind = getattr(self.torch, np.dtype(SIGNED.get(kind, kind)).name)
        return self.torch.zeros(shape, dtype=kind, device=self.device)

    def like(self, array: Any) -> Any:
        return self.torch.empty_like(array)

    def put(self, array: np.ndarray) -> Any:
        return self.torch.from_numpy(np.array(array).view(SIGNED.get(array.dtype, array.dtype))).to(self.device)

    def get(self, array: Any) -> np.ndarray:
        return array.to("cpu", copy=True).numpy()

    def light(self, light: Any) -> Any:
        light = light.detach() if hasattr(light, "detach") else self.torch.from_numpy(_linear(light))
        return light.to(self.device, self.torch.float32).contiguous()

    def count_to(self, n: int) -> Any:
        return self.torch.arange(n, device=self.device)

    def order(self, numbers: Any) -> Any:
        return self.torch.sort(numbers, stable=True).indices

    def ordered(self, keys: Any) -> Any:
        return keys[self.order(keys >> 3)]

    def joined(self, parts: Any) -> Any:
        return self.torch.cat(parts)

    def searchsorted(self, ascending: Any, numbers: Any) -> Any:
        return self.torch.searchsorted(ascending, numbers)

    def add_at(self, sums: Any, places: Any, values: Any) -> None:
        sums.index_add_(0, places, values)

    def cast(self, array: Any, dtype: Any) -> Any:
        return array.to(getattr(self.torch, np.dtype(dtype).name))

    def launch(self, kernel: Any, threads: int, *arguments: Any) -> None:
        from numba import cuda
        from numba.cuda.core import config

        from vid2ev.kernels.cuda.strict import strict

        if threads == 0:
            return
        config.CUDA_LOW_OCCUPANCY_WARNINGS = 0  # (small sensors have few pixels)
        seen, blocks = [_seen(argument) for argument in arguments], -(-threads // THREADS)
        with self.torch.cuda.device(self.device):
            ours = self.torch.cuda.current_stream().cuda_stream
            configured = kernel.configure(blocks, THREADS, cuda.external_stream(ours) if ours else 0)
            if kernel in self._compiled:  # (numba itself looks up the types of all arrays anew, which takes 1 ms)
                self._compiled[kernel].launch(seen, configured.griddim, configured.blockdim, configured.stream)
                return
            with strict():
                configured(*seen)
            (self._compiled[kernel],) = kernel.overloads.values()

    def kernels(self, flags: Flags) -> Any:
        return _kernels("cuda", flags)

    def module(self, name: str) -> Any:
        return _build("cuda").module(name)


def _linear(light: Any) -> np.ndarray:
    """An array as one of float32 that a tensor can share."""
    with np.errstate(over="ignore"):  # (beyond float32 is infinite, and mended)
        return np.require(light, np.float32, ["C", "W"])


def _seen(argument: Any, place: tuple[str, str] = ("", "")) -> Any:
    """An argument as a kernel takes it, without a copy."""
    from numba.cuda.api import from_cuda_array_interface

    if hasattr(argument, "_fields"):
        kind = type(argument)
        return kind(*(_seen(getattr(argument, name), (kind.__name__, name)) for name in argument._fields))
    if not hasattr(argument, "__cuda_array_interface__"):
        return argument
    views = argument.__dict__.setdefault("seen_by_kernels", {})  # (a tensor stays where it is)
    kind = UNSIGNED.get(place)
    if kind not in views:
        assert argument.is_contiguous(), place  # (what is compiled is compiled for that)
        array = from_cuda_array_interface(argument.__cuda_array_interface__)  # (an owner of it would be a circle)
        views[kind] = array if kind is None else array.view(kind)
    return views[kind]


@cache
def _build(kind: str) -> Build:
    return Build(SIMULATED if kind == "simulated" else CARD)


@cache
def _kernels(kind: str, flags: Flags) -> Any:
    ours = _build(kind).module("vid2ev.kernels.layout")
    stride = int(stride_of(flags)) // PITCH
    return _build(kind).module("vid2ev.kernels.cuda.kernels").kernels_of(ours.Flags(*flags), stride)
