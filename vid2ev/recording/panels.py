"""The two panels of the preview: a frame in gray, and counts of events in colour, as planes of yuv420p.

Codes have 8 bits and limited range, by Rec. ITU-R BT.709-6.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from vid2ev.pictures.colours import MOST, NEUTRAL, codes, event_colours


def reduced(light: np.ndarray, across: int, down: int) -> np.ndarray:
    """Codes Y [uint8, down x across] of linear light, which is averaged where pixels share one."""
    if light.shape != (down, across):
        light = cv2.resize(light, (across, down), interpolation=cv2.INTER_AREA)
    gray = np.empty(light.shape, np.uint8)
    _gray(light, GRAYS, gray)
    return gray


@njit(cache=True, nogil=True, error_model="numpy")
def _gray(light, grays, gray):  # type: ignore[no-untyped-def]
    zero, one, most = np.float32(0), np.float32(1), np.float32(65535)
    for i in range(light.shape[0]):
        for j in range(light.shape[1]):
            shown = light[i, j] if light[i, j] > zero else zero  # (NaN is black)
            gray[i, j] = grays[np.uint16((shown if shown < one else one) * most)]


@njit(cache=True, nogil=True)
def count(x, y, p, column, row, counts):  # type: ignore[no-untyped-def]
    """Add events to counts [polarity, down, across], those of pixel (x, y) at (column[x], row[y])."""
    for i in range(len(x)):
        polarity, down, across = p[i], row[y[i]], column[x[i]]
        if counts[polarity, down, across] < MOST:
            counts[polarity, down, across] += 1


@njit(cache=True, nogil=True)
def paint(gray, counts, colours, enlarged, luma, chroma):  # type: ignore[no-untyped-def]
    """Fill luma [height, 2 width] and chroma [2, height / 2, width]: gray in the left half, counts in the right.

    Chroma of a block of 2 x 2 is the mean of those of its pixels that have events, so that single ones keep theirs.
    """
    down, across = gray.shape
    height, width = luma.shape[0], luma.shape[1] // 2
    columns = np.minimum(np.arange(width) // enlarged, across - 1)
    for block_i in range(height // 2):
        for block_j in range(width // 2):
            u = v = n = 0
            for k in range(4):
                i, j = 2 * block_i + k // 2, 2 * block_j + k % 2
                row, column = min(i // enlarged, down - 1), columns[j]
                off, on = counts[0, row, column], counts[1, row, column]
                luma[i, j] = gray[row, column]
                luma[i, width + j] = colours[off, on, 0]
                if off + on > 0:
                    u, v, n = u + colours[off, on, 1], v + colours[off, on, 2], n + 1
            chroma[0, block_i, block_j] = chroma[1, block_i, block_j] = NEUTRAL
            right = width // 2 + block_j
            chroma[0, block_i, right] = u // n if n else colours[0, 0, 1]
            chroma[1, block_i, right] = v // n if n else colours[0, 0, 2]


def _gray_table() -> np.ndarray:
    """Codes Y of light in steps of 1 / 65535, by Rec. ITU-R BT.709-6 items 1.2 and 3.4, 8 bits."""
    light = np.arange(1 << 16) / 65535
    return np.rint(16 + 219 * np.where(light < 0.018, 4.5 * light, 1.099 * light**0.45 - 0.099)).astype(np.uint8)


COLOURS, GRAYS = codes(event_colours()), _gray_table()
