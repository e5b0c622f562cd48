"""Light back to codes of 8 bits, for pictures that people look at."""

from __future__ import annotations

import numpy as np

from vid2ev.light.transfer import parse_transfer

LAST = 65535  # entries of the table, less one: finer than the steepest step of the curve


def srgb_codes(light: np.ndarray) -> np.ndarray:
    """sRGB codes [uint8] of linear light of any shape; white is 1.0 and above, NaN is black."""
    return _TABLE[(np.clip(np.nan_to_num(light, nan=0.0), 0, 1) * LAST + 0.5).astype(np.uint16)]


_TABLE = np.rint(255 * parse_transfer("srgb").to_signal(np.arange(LAST + 1) / LAST)).astype(np.uint8)
