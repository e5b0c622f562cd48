"""The two panels of the preview: a frame in gray, and counts of events in colour, as planes of yuv420p.

Codes have 8 bits and limited range, by Rec. ITU-R BT.709-6.
"""

from __future__ import annotations

import cv2
import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.light.transfer import parse_transfer
from vid2ev.pictures.colours import MOST, NEUTRAL, codes, event_colours

EACH = MOST + 1  # counts of a polarity that are told apart
CODES = EACH * EACH


def reduced(light: np.ndarray, across: int, down: int) -> np.ndarray:
    """Codes Y [uint8, down x across] of linear light, which is averaged where pixels share one."""
    if light.shape != (down, across):
        light = cv2.resize(light, (across, down), interpolation=cv2.INTER_AREA)
    gray = np.empty(light.shape, np.uint8)
    _gray(light, GRAYS, gray)
    return gray


@compiled
def _gray(light, grays, gray):  # type: ignore[no-untyped-def]
    zero, one, most = np.float32(0), np.float32(1), np.float32(65535)
    for i in range(light.shape[0]):
        for j in range(light.shape[1]):
            shown = light[i, j] if light[i, j] > zero else zero  # (NaN is black)
            gray[i, j] = grays[np.uint16((shown if shown < one else one) * most)]


@compiled
def count(x, y, p, column, row, counts):  # type: ignore[no-untyped-def]
    """Add events to counts [polarity, down, across], those of pixel (x, y) at (column[x], row[y])."""
    for i in range(len(x)):
        polarity, down, across = p[i], row[y[i]], column[x[i]]
        if counts[polarity, down, across] < MOST:
            counts[polarity, down, across] += 1


@compiled
def paint(gray, counts, colours, enlarged, luma, chroma):  # type: ignore[no-untyped-def]
    """Fill luma [height, 2 width] and chroma [2, height / 2, width]: gray in the left half, counts in the right.

    Chroma of a block of 2 x 2 is the mean of those of its pixels that have events, so that single ones keep theirs.
    """
    down, across = gray.shape
    height, width = luma.shape[0], luma.shape[1] // 2
    columns = np.minimum(np.arange(width) // enlarged, across - 1).astype(np.uint32)
    shown, tints = np.empty(CODES, np.uint8), np.zeros((3, CODES), np.int32)
    for code in range(CODES):
        colour = colours[code // EACH, code % EACH]
        shown[code] = colour[0]
        if code > 0:  # (a pixel without events counts nothing, so that nothing asks whether it has some)
            tints[0, code], tints[1, code], tints[2, code] = colour[1], colour[2], 1
    chroma[:, :, : width // 2] = NEUTRAL
    seen = np.empty((2, width), np.uint8)
    for i in range(height):
        row, here = min(i // enlarged, down - 1), seen[i % 2]
        _look(gray[row], counts[0, row], counts[1, row], columns, here, shown, luma[i, :width], luma[i, width:])
        if i % 2:
            u_row, v_row = chroma[0, i // 2, width // 2 :], chroma[1, i // 2, width // 2 :]
            _tint(seen[0], seen[1], tints, colours[0, 0], u_row, v_row)


@inner
def _look(gray, off, on, columns, codes, shown, left, right):  # type: ignore[no-untyped-def]
    """Luma of a row of both panels, and the codes of its counts."""
    for j in range(columns.size):
        column = columns[j]
        code = np.uint8(off[column] * np.uint8(EACH) + on[column])
        codes[j], left[j], right[j] = code, gray[column], shown[code]


@inner
def _tint(upper, lower, tints, ground, u_row, v_row):  # type: ignore[no-untyped-def]
    """Chroma of two rows of codes."""
    two, one = np.uintp(2), np.uintp(1)
    u_of, v_of, n_of = tints[0], tints[1], tints[2]
    for j in range(np.uintp(u_row.size)):
        a, b, c, d = upper[two * j], upper[two * j + one], lower[two * j], lower[two * j + one]
        n = n_of[a] + n_of[b] + n_of[c] + n_of[d]
        if n == 0:
            u_row[j], v_row[j] = ground[1], ground[2]
        else:
            u_row[j] = np.uint8(np.float32(u_of[a] + u_of[b] + u_of[c] + u_of[d]) / np.float32(n))
            v_row[j] = np.uint8(np.float32(v_of[a] + v_of[b] + v_of[c] + v_of[d]) / np.float32(n))


def _gray_table() -> np.ndarray:
    """Codes Y of light in steps of 1 / 65535, by Rec. ITU-R BT.709-6 items 1.2 and 3.4, 8 bits."""
    return np.rint(16 + 219 * parse_transfer("bt709").to_signal(np.arange(1 << 16) / 65535)).astype(np.uint8)


COLOURS, GRAYS = codes(event_colours()), _gray_table()
