"""The light of a pixel in which things meet: the areas of what is in it, measured, and the light of each.

    light = sum over keys of  area(key) * light(key at the centre of its area)

The pixel is cut into cells; where the corners of a cell have different keys, the places on its sides at which the key
changes are found by bisection, and the cell is shared out along straight lines from those to their middle.  A straight
edge has its exact area at any angle, so light changes smoothly while an edge moves through the pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import PART, STACK, THING
from vid2ev.scenes.rays.meet import key_of, meet, meet_thing, row, turned
from vid2ev.scenes.rays.pixel import light_of, shadows_of

HALVINGS = 9  # an edge is found to 1 / 1000 px
KEYS = 12  # parts of a pixel that are told apart
AREA, X, Y, AT_X, AT_Y = range(5)


class Scratch(NamedTuple):
    """What one thread works in."""

    stack: np.ndarray  # int64 [STACK]: nodes of a hierarchy
    things: np.ndarray  # int64 [n]: what may be seen in a tile
    corners: np.ndarray  # int64 [cells + 1, cells + 1]: keys at the corners of cells
    across: np.ndarray  # float64 [cells + 1, cells]: where the key changes along horizontal sides, 0 ... 1
    down: np.ndarray  # float64 [cells, cells + 1]: along vertical sides
    keys: np.ndarray  # int64 [KEYS]: what is in the pixel
    parts: np.ndarray  # float64 [KEYS, 5]: area, first moments, the place of a corner with that key


def scratch_for(things: int, cells: int) -> Scratch:
    """New scratch, for a world of so many things."""
    return Scratch(
        np.empty(STACK, np.int64),
        np.empty(things, np.int64),
        np.empty((cells + 1, cells + 1), np.int64),
        np.empty((cells + 1, cells), np.float64),
        np.empty((cells, cells + 1), np.float64),
        np.empty(KEYS, np.int64),
        np.empty((KEYS, 5), np.float64),
    )


@law
def ray_at(rays, x, y):
    """The ray (x, y, 1) through any place of the picture [px], from those through the centres of its pixels."""
    column = min(max(math.floor(x) + 1, 0), rays.shape[1] - 2)
    line = min(max(math.floor(y) + 1, 0), rays.shape[0] - 2)
    right, low = x + 1.0 - column, y + 1.0 - line
    w00, w01 = (1.0 - right) * (1.0 - low), right * (1.0 - low)
    w10, w11 = (1.0 - right) * low, right * low
    return (
        w00 * rays[line, column, 0] + w01 * rays[line, column + 1, 0]
        + w10 * rays[line + 1, column, 0] + w11 * rays[line + 1, column + 1, 0],
        w00 * rays[line, column, 1] + w01 * rays[line, column + 1, 1]
        + w10 * rays[line + 1, column, 1] + w11 * rays[line + 1, column + 1, 1],
    )  # fmt: skip


@law
def key_at(world, rays, x, y, count, scratch):
    """The key at any place of the picture."""
    rx, ry = ray_at(rays, x, y)
    meeting = meet(world, scratch.things, count, rx, ry, scratch.stack)
    return key_of(world, meeting[0], meeting[1], meeting[2], shadows_of(world, meeting, rx, ry, scratch.stack))


@law
def change_between(world, rays, x0, y0, x1, y1, key, count, scratch):
    """The share of the way from one place to another at which the key is no longer that of the first."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if key_at(world, rays, x0 + middle * (x1 - x0), y0 + middle * (y1 - y0), count, scratch) == key:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@law
def measure(world, rays, column, line, cells, count, scratch):
    """Fill `keys` and `parts` with what is in a pixel; how many."""
    left, top, size = column - 0.5, line - 0.5, 1.0 / cells
    for j in range(cells + 1):
        for i in range(cells + 1):
            scratch.corners[j, i] = key_at(world, rays, left + i * size, top + j * size, count, scratch)
    # A side belongs to two cells; its change is found once.
    for j in range(cells + 1):
        for i in range(cells + 1):
            x, y, key = left + i * size, top + j * size, scratch.corners[j, i]
            if i < cells and scratch.corners[j, i + 1] != key:
                scratch.across[j, i] = change_between(world, rays, x, y, x + size, y, key, count, scratch)
            if j < cells and scratch.corners[j + 1, i] != key:
                scratch.down[j, i] = change_between(world, rays, x, y, x, y + size, key, count, scratch)
    found = 0
    for j in range(cells):
        for i in range(cells):
            found = share_cell(scratch, i, j, left + i * size, top + j * size, size, found)
    return found


@law
def share_cell(scratch, i, j, x, y, size, found):
    """Add a cell to the parts of its pixel."""
    a, b = scratch.corners[j, i], scratch.corners[j, i + 1]
    c, d = scratch.corners[j + 1, i + 1], scratch.corners[j + 1, i]
    top, bottom = x + size * scratch.across[j, i], x + size * scratch.across[j + 1, i]
    left, right = y + size * scratch.down[j, i], y + size * scratch.down[j, i + 1]
    x1, y1, sum_x, sum_y, changes = x + size, y + size, 0.0, 0.0, 0
    if a != b:
        sum_x, sum_y, changes = sum_x + top, sum_y + y, changes + 1
    if b != c:
        sum_x, sum_y, changes = sum_x + x1, sum_y + right, changes + 1
    if c != d:
        sum_x, sum_y, changes = sum_x + bottom, sum_y + y1, changes + 1
    if d != a:
        sum_x, sum_y, changes = sum_x + x, sum_y + left, changes + 1
    middle = (sum_x / changes, sum_y / changes) if changes > 0 else (x + 0.5 * size, y + 0.5 * size)
    found = share_side(scratch, a, b, (x, y), (x1, y), (top, y), middle, found)
    found = share_side(scratch, b, c, (x1, y), (x1, y1), (x1, right), middle, found)
    found = share_side(scratch, c, d, (x1, y1), (x, y1), (bottom, y1), middle, found)
    return share_side(scratch, d, a, (x, y1), (x, y), (x, left), middle, found)


@law
def share_side(scratch, key, next_key, start, end, change, middle, found):
    """Add the triangle between a cell's side and its middle, in two where the key changes."""
    if key == next_key:
        return add_triangle(scratch, key, start, end, middle, start, found)
    found = add_triangle(scratch, key, start, change, middle, start, found)
    return add_triangle(scratch, next_key, change, end, middle, end, found)


@law
def add_triangle(scratch, key, a, b, c, corner, found):
    """Add a triangle to the part of its key."""
    part = 0
    while part < found and scratch.keys[part] != key:
        part += 1
    if part == found:
        if found == KEYS:
            part = KEYS - 1  # (more than can be told apart)
        else:
            scratch.keys[part] = key
            for k in range(3):
                scratch.parts[part, k] = 0.0
            scratch.parts[part, AT_X], scratch.parts[part, AT_Y] = corner
            found += 1
    area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    scratch.parts[part, AREA] += area
    scratch.parts[part, X] += area * (a[0] + b[0] + c[0]) / 3.0
    scratch.parts[part, Y] += area * (a[1] + b[1] + c[1]) / 3.0
    return found


@law
def light_of_parts(world, rays, found, across, down, count, scratch):
    """Red, green and blue of a pixel that has been measured."""
    red, green, blue, whole = 0.0, 0.0, 0.0, 0.0
    for part in range(found):
        area = scratch.parts[part, AREA]
        if area > 0.0:
            r, g, b = light_of_part(world, rays, part, across, down, count, scratch)
            red, green, blue, whole = red + area * r, green + area * g, blue + area * b, whole + area
    return red / whole, green / whole, blue / whole


@law
def light_of_part(world, rays, part, across, down, count, scratch):
    """The light of a part where its centre is, even if something else is in front there; at its corner if it is not."""
    key, area = scratch.keys[part], scratch.parts[part, AREA]
    x, y = ray_at(rays, scratch.parts[part, X] / area, scratch.parts[part, Y] / area)
    if key < 0:
        return light_of(world, (-1, math.inf, 0, 0.0, 0.0), x, y, across, down, 0)
    thing, shadows = key // THING, key % PART
    eye, d = row(world.eye, thing), turned(world.turn, thing, x, y, 1.0)
    t, face, b1, b2 = meet_thing(world, thing, eye, d, math.inf, scratch.stack)
    meeting = thing, t, face, b1, b2
    if not (t < math.inf and key_of(world, thing, t, face, shadows) == key):
        x, y = ray_at(rays, scratch.parts[part, AT_X], scratch.parts[part, AT_Y])
        meeting = meet(world, scratch.things, count, x, y, scratch.stack)
    return light_of(world, meeting, x, y, across, down, shadows)
