"""Arithmetic that must not run in 16 bits: warps, blends, losses, recurrent states.

In float16 numbers near 1 are 2^-11 apart, in bfloat16 2^-8: normalised coordinates of a picture 1280 pixels wide
would be off by up to 0.3 and 2.5 pixels, and an epsilon of 1e-8 would be 0.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import torch

Result = TypeVar("Result")


def in_full_precision(function: Callable[..., Result]) -> Callable[..., Result]:
    """The function without autocast; tensors among its arguments that have 16 bits come in float32."""

    @functools.wraps(function)
    def run(*args: Any, **named: Any) -> Result:
        device = next((tensor.device.type for tensor in _tensors([*args, *named.values()])), "cpu")
        with torch.autocast(device, enabled=False):
            return function(*map(_full, args), **{key: _full(value) for key, value in named.items()})

    return run


def _tensors(values: Any) -> Iterator[torch.Tensor]:
    for value in values:
        if isinstance(value, torch.Tensor):
            yield value
        elif isinstance(value, (list, tuple)):
            yield from _tensors(value)


def _full(value: Any) -> Any:
    if isinstance(value, torch.Tensor) and value.dtype in (torch.float16, torch.bfloat16):
        return value.float()
    return type(value)(map(_full, value)) if type(value) in (list, tuple) else value
