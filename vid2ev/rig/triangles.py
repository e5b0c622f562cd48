"""Triangles drawn into the picture of a camera: which place of the source each pixel sees, the nearest winning.

A pixel is drawn where its centre lies in a triangle or on its edge.  With e_k the areas opposite to its corners,

    inverse depth = sum e_k w_k / sum e_k,        place = sum e_k q_k place_k / sum e_k q_k,        q = 1 / c

c being the depth of a corner, or that over any length that is the same for all three, and w the inverse depths.  Areas
that rounding has made negative are 0, so that depth and place are never beyond the corners'.
Triangles that are seen from behind are left out, and those with a corner that is NaN: it is behind the camera.

Source: J. Blinn, "Hyperbolic interpolation", IEEE Computer Graphics and Applications 12(4), 1992.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vid2ev.compiling.cache import cached

F = np.float32
ROUNDING = F(1e-4)  # of a triangle's area: by so much its edges reach out, lest rounding makes a crack
REACH = F(1e-4)  # px; the same of its bounds
_ZERO, _ONE = F(0), F(1)


@cached
def draw_quads(begin, end, u, v, q, w, columns, rows, cut, gap, x, y, inverse):
    """The quads between corners [H, W], two triangles each, on the pixels' rows begin ... end.

    u, v, q, w        corners in the camera: pixel, 1 / c, inverse depth
    columns, rows     corners in the source
    cut               [H - 1, W - 1]: quads that are left out where they are wider than `gap` + 1 px
    x, y, inverse     [h, w] place in the source and inverse depth of each pixel; drawn over where nearer
    """
    height, width = cut.shape
    far_right, first_row, last_row = F(x.shape[1] - 1), F(begin), F(end - 1)
    for j in range(height):
        if not _on_rows(v[j], v[j + 1], first_row, last_row):
            continue
        for i in range(width):
            # (from the corner that both triangles have: what is NaN after it changes nothing)
            top = min(min(min(v[j, i], v[j, i + 1]), v[j + 1, i]), v[j + 1, i + 1])
            bottom = max(max(max(v[j, i], v[j, i + 1]), v[j + 1, i]), v[j + 1, i + 1])
            left = min(min(min(u[j, i], u[j, i + 1]), u[j + 1, i]), u[j + 1, i + 1])
            right = max(max(max(u[j, i], u[j, i + 1]), u[j + 1, i]), u[j + 1, i + 1])
            if bottom < first_row or top > last_row or right < _ZERO or left > far_right:
                continue
            if cut[j, i] and max(right - left, bottom - top) > gap + _ONE:
                continue
            # the triangle above the falling diagonal, then the one below it
            _draw(
                (u[j, i], u[j, i + 1], u[j + 1, i + 1]), (v[j, i], v[j, i + 1], v[j + 1, i + 1]),
                (q[j, i], q[j, i + 1], q[j + 1, i + 1]), (w[j, i], w[j, i + 1], w[j + 1, i + 1]),
                (columns[i], columns[i + 1], columns[i + 1]), (rows[j], rows[j], rows[j + 1]),
                begin, end, x, y, inverse,
            )  # fmt: skip
            _draw(
                (u[j, i], u[j + 1, i + 1], u[j + 1, i]), (v[j, i], v[j + 1, i + 1], v[j + 1, i]),
                (q[j, i], q[j + 1, i + 1], q[j + 1, i]), (w[j, i], w[j + 1, i + 1], w[j + 1, i]),
                (columns[i], columns[i + 1], columns[i]), (rows[j], rows[j + 1], rows[j + 1]),
                begin, end, x, y, inverse,
            )  # fmt: skip


@cached
def draw_patches(begin, end, u, v, q, w, columns, rows, x, y, inverse):
    """Patches of four corners [n, 4] that go round clockwise; as in `draw_quads`."""
    for k in range(u.shape[0]):
        for a, b in ((1, 2), (2, 3)):
            _draw(
                (u[k, 0], u[k, a], u[k, b]), (v[k, 0], v[k, a], v[k, b]), (q[k, 0], q[k, a], q[k, b]),
                (w[k, 0], w[k, a], w[k, b]), (columns[k, 0], columns[k, a], columns[k, b]),
                (rows[k, 0], rows[k, a], rows[k, b]), begin, end, x, y, inverse,
            )  # fmt: skip


@njit(nogil=True, error_model="numpy", inline="always")
def _draw(u, v, q, w, columns, rows, begin, end, x, y, inverse):
    area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
    if area > _ZERO:
        far_right, slack = F(x.shape[1] - 1), -ROUNDING * area
        left, right = min(min(u[0], u[1]), u[2]) - REACH, max(max(u[0], u[1]), u[2]) + REACH
        top, bottom = min(min(v[0], v[1]), v[2]) - REACH, max(max(v[0], v[1]), v[2]) + REACH
        first, last = int(np.ceil(max(left, _ZERO))), int(np.floor(min(right, far_right)))
        upper, lower = int(np.ceil(max(top, F(begin)))), int(np.floor(min(bottom, F(end - 1))))
        for row in range(upper, lower + 1):
            down0, down1, down2 = v[0] - F(row), v[1] - F(row), v[2] - F(row)
            for column in range(first, last + 1):
                right0, right1, right2 = u[0] - F(column), u[1] - F(column), u[2] - F(column)
                e0 = right1 * down2 - right2 * down1
                e1 = right2 * down0 - right0 * down2
                e2 = right0 * down1 - right1 * down0
                if e0 >= slack and e1 >= slack and e2 >= slack:
                    # (a corner near the camera's plane has a q that would take a place beyond an edge far out; and
                    # what is seen from its edge has areas that are all rounding)
                    e0, e1, e2 = max(e0, _ZERO), max(e1, _ZERO), max(e2, _ZERO)
                    depth = (e0 * w[0] + e1 * w[1] + e2 * w[2]) / (e0 + e1 + e2)
                    if depth > inverse[row, column]:  # (never of NaN, where all areas are 0)
                        e0, e1, e2 = e0 * q[0], e1 * q[1], e2 * q[2]
                        share = _ONE / (e0 + e1 + e2)
                        inverse[row, column] = depth
                        x[row, column] = (e0 * columns[0] + e1 * columns[1] + e2 * columns[2]) * share
                        y[row, column] = (e0 * rows[0] + e1 * rows[1] + e2 * rows[2]) * share


@cached
def _on_rows(above, below, first, last):
    """Whether any of the corners of two rows, or a side between them, may be on the rows first ... last; NaN is on
    none."""
    low, high = F(np.inf), F(-np.inf)
    for i in range(above.size):
        low, high = min(min(low, above[i]), below[i]), max(max(high, above[i]), below[i])
    return not (low > last or high < first)
