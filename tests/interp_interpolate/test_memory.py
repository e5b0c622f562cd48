"""What recurrent networks remember comes back from the disk as it was, and is gone as soon as nobody wants it."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from typing import Any

import pytest
import torch

from interp.interpolate.memory import as_arrays, nested


@pytest.fixture
def no_collection() -> Iterator[None]:
    """No collection of garbage meanwhile."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def same(one: Any, other: Any) -> bool:
    if isinstance(one, torch.Tensor):
        return isinstance(other, torch.Tensor) and one.dtype == other.dtype and torch.equal(one, other)
    if one is None:
        return other is None
    return len(one) == len(other) and all(map(same, one, other))


def test_nested_tensors_come_back() -> None:
    memory = (torch.rand(2, 3), None, ((torch.arange(3), ()), torch.tensor(True)))
    arrays = as_arrays(memory)
    assert sorted(arrays) == ["shape", "tensor0", "tensor1", "tensor2"]
    assert same(nested(arrays, "cpu"), memory) and nested({}, "cpu") == ()


@pytest.mark.usefixtures("no_collection")
def test_memory_is_not_held_until_garbage_is_collected() -> None:
    arrays = as_arrays((torch.rand(2, 3), (torch.rand(4),)))
    back = nested(arrays, "cpu")
    taken, given = weakref.ref(arrays["tensor0"]), weakref.ref(back[0])
    del arrays, back
    assert taken() is None and given() is None
