"""What recurrent networks remember, as plain arrays, for the disk: nested tuples of tensors, bit for bit."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import torch


def as_arrays(memory: Any) -> dict[str, np.ndarray]:
    """Arrays of nested tuples of tensors and None; `nested` gives them back."""
    found: dict[str, np.ndarray] = {}
    return found | {"shape": np.array(json.dumps(_taken(memory, found)))}


def nested(arrays: dict[str, np.ndarray], device: torch.device | str) -> Any:
    """The nested tuples of arrays, on a device; an empty tuple of none."""
    return _given(json.loads(str(arrays["shape"])), arrays, device) if arrays else ()


# (A function in a function that calls itself refers to itself, and so would what it refers to, the arrays, live on
# until the next collection of garbage: that is, for hundreds of pictures.)
def _taken(part: Any, found: dict[str, np.ndarray]) -> Any:
    """Names in place of the tensors, which go to `found`."""
    if isinstance(part, torch.Tensor):
        found[f"tensor{len(found)}"] = part.detach().cpu().numpy()
        return f"tensor{len(found) - 1}"
    return None if part is None else [_taken(each, found) for each in part]


def _given(shape: Any, arrays: dict[str, np.ndarray], device: torch.device | str) -> Any:
    """Tensors in place of the names."""
    if isinstance(shape, str):
        return torch.from_numpy(arrays[shape]).to(device)
    return None if shape is None else tuple(_given(each, arrays, device) for each in shape)
