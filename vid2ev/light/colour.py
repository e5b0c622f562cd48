"""RGB in linear light from the planes of a picture: `luminance.py`, without the last step.

The three channels, each light of the picture's own primaries, go to those of BT.709:

    light[y, x] = to_bt709 (R, G, B)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.light.luminance import F, Steps, YuvCode, chroma_row, places


def rgb_of_yuv(
    planes: Sequence[np.ndarray], size: tuple[int, int], code: YuvCode, table: np.ndarray, to_bt709: np.ndarray
) -> np.ndarray:
    """Light [float32, H x W x 3] of the planes Y', Cb, Cr; arguments as for `luminance_of_yuv`."""
    width, height = size
    out = np.empty((height, width, 3), np.float32)
    luma, cb, cr = planes
    steps = tuple(Steps.of(code, table))
    _yuv(luma, cb, cr, code.halvings, steps, table, to_bt709.astype(np.float32), out)
    return out


def rgb_of_rgb(
    channels: Sequence[np.ndarray], size: tuple[int, int], table: np.ndarray, to_bt709: np.ndarray
) -> np.ndarray:
    """Light [float32, H x W x 3] of three arrays of codes: red, green, blue; table is a `transfer.code_table`."""
    width, height = size
    out = np.empty((height, width, 3), np.float32)
    red, green, blue = channels
    _rgb(red, green, blue, table, to_bt709.astype(np.float32), out)
    return out


@compiled
def _yuv(y, u, v, halvings, steps, table, to_bt709, out):
    scale, offset, neutral, per_cb, per_cr = steps
    height, width, _ = out.shape
    halvings_x, halvings_y = halvings
    column = np.empty(((width + (1 << halvings_x) - 1) >> halvings_x) + 1, np.float32)
    cb, cr = np.empty(width, np.float32), np.empty(width, np.float32)
    entry, share, light = np.empty(width, np.int32), np.empty(width, np.float32), np.empty((3, width), np.float32)
    top = F(table.size - 2)
    for row in range(height):
        chroma_row(u, row, halvings_x, halvings_y, neutral, column, cb)
        chroma_row(v, row, halvings_x, halvings_y, neutral, column, cr)
        for channel in range(3):
            places(y[row], scale, offset, cb, per_cb[channel], cr, per_cr[channel], top, entry, share)
            for x in range(width):
                below = np.uintp(entry[x])
                light[channel, x] = table[below] + (table[below + np.uintp(1)] - table[below]) * share[x]
        for x in range(width):
            _mix(light[0, x], light[1, x], light[2, x], to_bt709, out[row, x])


@compiled
def _rgb(red, green, blue, table, to_bt709, out):
    last = np.uintp(table.size - 1)  # (a damaged file may hold codes beyond its depth)
    for row in range(out.shape[0]):
        for x in range(out.shape[1]):
            r = table[min(np.uintp(red[row, x]), last)]
            g = table[min(np.uintp(green[row, x]), last)]
            b = table[min(np.uintp(blue[row, x]), last)]
            _mix(r, g, b, to_bt709, out[row, x])


@inner
def _mix(r, g, b, to_bt709, out):
    for channel in range(3):
        out[channel] = to_bt709[channel, 0] * r + to_bt709[channel, 1] * g + to_bt709[channel, 2] * b
