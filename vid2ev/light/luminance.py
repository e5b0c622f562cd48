"""Luminance in linear light from the planes of a picture.

    R' = Y' + 2 (1 - KR) Cr           R = light(R')
    B' = Y' + 2 (1 - KB) Cb           B = light(B')        Y = wR R + wG G + wB B
    G' = (Y' - KR R' - KB B') / KG    G = light(G')

Y', Cb and Cr come from the codes in float32 and never touch 8 bits again; the transfer curve acts on each channel
before the channels are added, because luminance is a sum of light, not of codes.  Codes brighter than white (above 235
in limited range) become light above 1; a channel that the matrix makes negative is black, and one that it makes larger
than 1.25, which no camera means, is 1.25.

Y'CgCo has R' = Y' - Cg + Co, G' = Y' + Cg, B' = Y' - Cg - Co instead, of codes: in limited range red, green and blue
have it, so that steps of Cg and Co are those of Y', a 219th, and not a 224th.

Chroma of 4:2:0 and 4:2:2 is interpolated linearly, sited left in a row and centred between rows, which is what H.264
and HEVC mean when they say nothing.  The curve is read from a table of 4096 steps per unit of signal and interpolated:
within 8e-8 of the closed form for sRGB and BT.709.  PQ, HLG and the others that are steep for their light have a table
of 32768 steps: within 3e-7 (light + 0.001), which is as fine as float32 signals are.

Sources: equations and ranges, Rec. ITU-T H.273 section 8.3; chroma siting, Rec. ITU-T H.264 figure E-1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.light.transfer import parse_transfer

STEPS, FINE_STEPS = 4096, 32768  # table entries per unit of signal
FINE_CURVES = ("pq", "hlg", "smpte240m", "st428", "log100", "log316")
TOP = 1.25  # the highest signal: limited range ends at (255 - 16) / 219 = 1.09, colours that there are not go beyond
F = np.float32
_ZERO = F(0)


class YuvCode(NamedTuple):
    """How a picture in Y'CbCr is coded."""

    bits: int  # of a code, 8 to 16
    full_range: bool
    kr_kb: tuple[float, float] | None  # the matrix: shares of red and of blue in Y'; None: Y'CgCo
    halvings: tuple[int, int]  # of chroma, in x and in y: (1, 1) is 4:2:0, (1, 0) 4:2:2, (0, 0) 4:4:4


def signal_table(transfer: str) -> np.ndarray:
    """Light [float32] of the signals 0, 1 / STEPS, ... TOP, and one entry more for the interpolation."""
    steps = FINE_STEPS if transfer in FINE_CURVES else STEPS
    signal = np.arange(int(steps * TOP) + 2) / steps
    return parse_transfer(transfer).to_light(signal).astype(np.float32)


class Steps(NamedTuple):
    """How codes become places in a signal table: luma * scale + offset + (cb, cr less neutral) * per_cb, per_cr."""

    scale: np.float32
    offset: np.float32
    neutral: np.float32
    per_cb: np.ndarray  # [3]: red, green, blue
    per_cr: np.ndarray

    @classmethod
    def of(cls, code: YuvCode, table: np.ndarray) -> Steps:
        """The numbers for pictures of this code and a table of `signal_table`."""
        steps = round((table.size - 2) / TOP)
        unit = 2.0 ** (code.bits - 8)
        luma = 1 / (2**code.bits - 1) if code.full_range else 1 / (219 * unit)
        chroma = luma if code.full_range or code.kr_kb is None else 1 / (224 * unit)
        black = 0.0 if code.full_range else 16 * unit
        per_cb, per_cr = _chroma_shares(code.kr_kb, chroma)
        return cls(
            F(steps * luma),
            F(-steps * luma * black),
            F(2 ** (code.bits - 1)),
            (F(steps) * per_cb).astype(np.float32),
            (F(steps) * per_cr).astype(np.float32),
        )


def _chroma_shares(kr_kb: tuple[float, float] | None, chroma: float) -> tuple[np.ndarray, np.ndarray]:
    """What a code of Cb, and one of Cr, adds to red, green and blue."""
    if kr_kb is None:
        return chroma * np.array([-1.0, 1.0, -1.0]), chroma * np.array([1.0, 0.0, -1.0])
    kr, kb = kr_kb
    kg = 1 - kr - kb
    red_cr, blue_cb = 2 * (1 - kr) * chroma, 2 * (1 - kb) * chroma
    return np.array([0, -blue_cb * kb / kg, blue_cb]), np.array([red_cr, -red_cr * kr / kg, 0])


def luminance_of_yuv(
    planes: Sequence[np.ndarray],
    size: tuple[int, int],
    code: YuvCode,
    table: np.ndarray,
    weights: tuple[float, float, float],
) -> np.ndarray:
    """Light [float32, H x W] of the planes Y', Cb, Cr.

    planes   codes, uint8 or uint16; rows may be longer than the picture
    size     (width, height)
    table    a `signal_table`
    weights  luminance of the red, green and blue primary
    """
    width, height = size
    tables = np.outer(weights, table).astype(np.float32)
    out = np.empty((height, width), np.float32)
    luma, cb, cr = planes
    _yuv(luma, cb, cr, code.halvings, tuple(Steps.of(code, table)), tables, out)
    return out


def luminance_of_rgb(
    channels: Sequence[np.ndarray],
    size: tuple[int, int],
    table: np.ndarray,
    weights: tuple[float, float, float],
) -> np.ndarray:
    """Light [float32, H x W] of three arrays of codes: red, green, blue; table is a `transfer.code_table`."""
    width, height = size
    out = np.empty((height, width), np.float32)
    red, green, blue = channels
    _rgb(red, green, blue, table, np.array(weights, np.float32), out)
    return out


@inner
def chroma_row(plane, row, halvings_x, halvings_y, neutral, column, out):
    """One row of chroma, less its neutral value, at the places of luma; `column` is room for the row before."""
    centre = (row + 0.5) / (1 << halvings_y) - 0.5
    above = int(np.floor(centre))
    share = F(centre - above)
    upper, lower = plane[max(above, 0)], plane[min(above + 1, plane.shape[0] - 1)]
    last = column.size - 1
    for i in range(np.uintp(last)):
        code = F(upper[i])
        column[i] = code + (F(lower[i]) - code) * share - neutral
    column[last] = column[last - 1]
    if halvings_x == 1:
        _between_twos(column, out)
        return
    for phase in range(1 << halvings_x):
        share = F(phase) / F(1 << halvings_x)
        for i in range((out.size - phase + (1 << halvings_x) - 1) >> halvings_x):
            out[(i << halvings_x) + phase] = column[i] + (column[i + 1] - column[i]) * share


@inner
def _between_twos(column, out):
    """Chroma at twice as many places: every value, and between two of them their mean (in vectors: both are written by
    one loop)."""
    one, pairs = np.uintp(1), np.uintp(out.size >> 1)
    for i in range(pairs):
        here, right = column[i], column[i + one]
        out[i + i] = here
        out[i + i + one] = here + (right - here) * F(0.5)
    if out.size & 1:
        out[out.size - 1] = column[pairs]


@inner
def places(luma, scale, offset, cb, per_cb, cr, per_cr, top, entry, share):
    """Where in the table the signals of a channel lie, along a row: the entry below, the share of the one above."""
    for x in range(entry.size):
        step = F(luma[x]) * scale + offset + per_cb * cb[x] + per_cr * cr[x]
        step = _ZERO if step < _ZERO else step
        step = top if step > top else step
        below = np.int32(step)
        entry[x] = below
        share[x] = step - F(below)


# Places first and look-ups after: the first loop runs in vectors, which a loop with a look-up in it cannot.
@compiled
def _yuv(y, u, v, halvings, steps, tables, out):
    scale, offset, neutral, per_cb, per_cr = steps
    height, width = out.shape
    halvings_x, halvings_y = halvings
    column = np.empty(((width + (1 << halvings_x) - 1) >> halvings_x) + 1, np.float32)
    cb, cr = np.empty(width, np.float32), np.empty(width, np.float32)
    red, green, blue = tables[0], tables[1], tables[2]
    entry, share = np.empty((3, width), np.int32), np.empty((3, width), np.float32)
    top = F(red.size - 2)
    one = np.uintp(1)
    for row in range(height):
        chroma_row(u, row, halvings_x, halvings_y, neutral, column, cb)
        chroma_row(v, row, halvings_x, halvings_y, neutral, column, cr)
        for channel in range(3):
            k, f = entry[channel], share[channel]
            places(y[row], scale, offset, cb, per_cb[channel], cr, per_cr[channel], top, k, f)
        for x in range(width):
            r, g, b = np.uintp(entry[0, x]), np.uintp(entry[1, x]), np.uintp(entry[2, x])
            light = red[r] + (red[r + one] - red[r]) * share[0, x]
            light += green[g] + (green[g + one] - green[g]) * share[1, x]
            light += blue[b] + (blue[b + one] - blue[b]) * share[2, x]
            out[row, x] = light


@compiled
def _rgb(red, green, blue, table, weights, out):
    height, width = out.shape
    last = np.uintp(table.size - 1)  # (a damaged file may hold codes beyond its depth)
    for row in range(height):
        for x in range(width):
            r = table[min(np.uintp(red[row, x]), last)]
            g = table[min(np.uintp(green[row, x]), last)]
            b = table[min(np.uintp(blue[row, x]), last)]
            out[row, x] = weights[0] * r + weights[1] * g + weights[2] * b
