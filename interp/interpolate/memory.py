"""What recurrent networks remember, as plain arrays, for the disk: nested tuples of tensors, bit for bit."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import torch


def as_arrays(memory: Any) -> dict[str, np.ndarray]:
    """Arrays of nested tuples of tensors and None; `nested` gives them back."""
    found: dict[str, np.ndarray] = {}

    def shape_of(part: Any) -> Any:
        if isinstance(part, torch.Tensor):
            found[f"tensor{len(found)}"] = part.detach().cpu().numpy()
            return f"tensor{len(found) - 1}"
        return None if part is None else [shape_of(each) for each in part]

    shape = json.dumps(shape_of(memory))
    return found | {"shape": np.array(shape)}


def nested(arrays: dict[str, np.ndarray], device: torch.device | str) -> Any:
    """The nested tuples of arrays, on a device; an empty tuple of none."""
    if not arrays:
        return ()

    def part(shape: Any) -> Any:
        if isinstance(shape, str):
            return torch.from_numpy(arrays[shape]).to(device)
        return None if shape is None else tuple(part(each) for each in shape)

    return part(json.loads(str(arrays["shape"])))
