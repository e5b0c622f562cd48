"""Light that lies between frames, where those have what is no light: it is made of what sensors take them for.

Of an infinite pixel, such as half floats have for the sun, an event camera sees the greatest light there is, and of a
NaN none.  Frames in between that took either for something else would make it flicker.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.stream.still import BRIGHTEST


def mended(light: np.ndarray) -> np.ndarray:
    """Light whose NaN are 0, and all else within BRIGHTEST of it; the very array if it is so already."""
    if ((light <= BRIGHTEST) & (light >= -BRIGHTEST)).all():
        return light
    return np.clip(np.nan_to_num(light, nan=0.0), -BRIGHTEST, BRIGHTEST).astype(np.float32)


def mended_tensor(light: Any) -> Any:
    """The same of a tensor of torch."""
    return light.nan_to_num(nan=0.0).clamp(-BRIGHTEST, BRIGHTEST)
