"""The colours of events: ON is amber, OFF is blue, on dark ground; more events are brighter.

    colour(off, on) = ground + strength(off + on) (mix - ground),   mix = (off OFF + on ON) / (off + on)
    strength(n)     = 1 - 0.45^n

Colours are R'G'B' from 0 to 1; `codes` are theirs in 8 bits of limited range, by Rec. ITU-R BT.709-6.
"""

from __future__ import annotations

import numpy as np

MOST = 15  # events of one polarity that a pixel can tell apart
ON, OFF, GROUND = np.array([[255, 190, 90], [90, 160, 255], [16, 18, 24]]) / 255
STRENGTH_PER_EVENT = 0.55  # share of the remaining way from the ground to the full colour
NEUTRAL = 128  # the code of no colour
RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722  # shares in luma, item 3.2
BLUE_SPAN, RED_SPAN = 1.8556, 1.5748  # of the colour differences, item 3.3


def strength(events: np.ndarray) -> np.ndarray:
    """How far from the ground towards the full colour, 0 to 1, for a number of events (which may be a fraction)."""
    return 1 - (1 - STRENGTH_PER_EVENT) ** events


def event_colours() -> np.ndarray:
    """R'G'B' [OFF events, ON events, 3] of a pixel, for 0 ... MOST of each."""
    off, on = np.mgrid[0 : MOST + 1, 0 : MOST + 1][..., None]
    mix = (off * OFF + on * ON) / np.maximum(off + on, 1)
    return GROUND + strength(off + on) * (mix - GROUND)


def codes(rgb: np.ndarray) -> np.ndarray:
    """Codes Y, U, V [uint8, ..., 3] of R'G'B' [..., 3], by items 3.2 to 3.4."""
    y = rgb @ [RED, GREEN, BLUE]
    u, v = (rgb[..., 2] - y) / BLUE_SPAN, (rgb[..., 0] - y) / RED_SPAN
    return np.rint(np.stack([16 + 219 * y, NEUTRAL + 224 * u, NEUTRAL + 224 * v], axis=-1)).astype(np.uint8)


def in_8_bits(rgb: np.ndarray) -> np.ndarray:
    """R'G'B' of full range [uint8]."""
    return np.rint(255 * np.clip(rgb, 0, 1)).astype(np.uint8)
