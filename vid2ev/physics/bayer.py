"""Colour filters: a sensor whose pixels each see one of red, green and blue.

    light(x, y) = channel[pattern[y mod 2][x mod 2]](x, y)        pattern RGGB: R G in even rows, G B in odd ones

The filters are ideal: each passes one primary of BT.709 and nothing of the others, and white is 1.0 in all pixels.  A
colour that the primaries cannot mix counts as none of the primary that it lacks.  Light is made denser in time before
it is filtered, because motion carries colours, not the pattern.

Source: B. E. Bayer, "Color imaging array", US patent 3971065, 1976.
"""

from __future__ import annotations

import numpy as np

from vid2ev.errors import UsageError

PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")  # the two by two pixels at the top left, row by row


def mosaic(rgb: np.ndarray, pattern: str) -> np.ndarray:
    """What each pixel sees [float32, H x W] of linear red, green and blue [H, W, 3]: of a tensor of torch, a tensor."""
    channels = ["RGB".index(letter) for letter in check_pattern(pattern)]
    light = np.empty(rgb.shape[:2], np.float32) if isinstance(rgb, np.ndarray) else rgb.new_empty(rgb.shape[:2])
    for place, channel in enumerate(channels):
        part = (slice(place // 2, None, 2), slice(place % 2, None, 2))
        light[part] = rgb[(*part, channel)].clip(0)
    return light


def check_pattern(pattern: str) -> str:
    """The pattern; raises UsageError for one that is none."""
    if pattern not in PATTERNS:
        raise UsageError(f"bayer '{pattern}': expected one of {', '.join(PATTERNS)}")
    return pattern
