"""Light on a device: tensors of torch in the place of arrays, from there on to the sensors."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np

from vid2ev.stream.frames import Frame


class Upload:
    """Takes light to a device of torch's ("cuda", or "cpu" for tests); what went there last does not go again."""

    def __init__(self, device: str):
        self.device = device
        self._there: deque[tuple[np.ndarray, Any]] = deque(maxlen=2)  # (an interval has two frames of the source)

    def light(self, light: Any) -> Any:
        """A tensor, float32, of an array of light; tensors are there already."""
        if not isinstance(light, np.ndarray):
            return light
        for array, tensor in self._there:
            if array is light:
                return tensor
        tensor = self.tensor(light.astype(np.float32, copy=False))
        self._there.append((light, tensor))
        return tensor

    def tensor(self, array: np.ndarray) -> Any:
        """A tensor of an array of numbers."""
        import torch

        return torch.from_numpy(np.require(array, requirements=["C", "W"])).to(self.device)

    def frame(self, frame: Frame) -> Frame:
        """The frame there; nobody looks there at what is still."""
        return replace(frame, light=self.light(frame.light), still=None)


def as_array(light: Any) -> np.ndarray:
    """Light, or whatever a device holds, as an array; the very array if it is one."""
    return light if isinstance(light, np.ndarray) else light.detach().cpu().numpy()  # type: ignore[no-any-return]


def downloaded(frame: Frame) -> Frame:
    """The frame with its light as an array; the very frame if that is one."""
    return frame if isinstance(frame.light, np.ndarray) else replace(frame, light=as_array(frame.light))
