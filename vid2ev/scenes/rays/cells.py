"""A cell of a pixel, shared out among the keys at its corners.

    middle = the place nearest to all lines along which the key changes:  min over m of  sum |(I - d d') (m - p)|^2

p are the places on the cell's sides at which the key changes, d the directions in which it changes there: the corner of
a box, or the place where one edge disappears behind another, is where those lines meet.  Where the key changes along
one straight line, m is in the middle of it.  Each key has the triangles between its parts of the sides and m.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.probe import HALVINGS, key_at
from vid2ev.scenes.rays.scratch import AREA, AT_X, AT_Y, KEYS, X, Y

OFF_LINE = 0.02  # of a cell: how far an edge may be from straight
RADIUS = 0.1  # of a cell: where the direction of an edge is looked for
PULL = 1e-4  # towards the mean of p, where the lines do not meet


@law
def corners_of(j, i, scratch):
    """The keys at the corners of a cell, around it from the left upper one."""
    corners = scratch.corners
    return corners[j, i], corners[j, i + 1], corners[j + 1, i + 1], corners[j + 1, i]


@law
def changes_of(j, i, x, y, size, scratch):
    """Where the key changes on the sides of a cell that begins at (x, y): the upper, right, lower and left one."""
    return (
        (x + size * scratch.across[j, i], y),
        (x + size, y + size * scratch.down[j, i + 1]),
        (x + size * scratch.across[j + 1, i], y + size),
        (x, y + size * scratch.down[j, i]),
    )


@law
def is_shared(cells, cell, scratch):
    """Whether the corners of a cell have different keys."""
    a, b, c, d = corners_of(cell // cells, cell % cells, scratch)
    return a != b or b != c or c != d


@law
def find_middle(world, rays, left, top, cells, cell, count, scratch):
    """Where the parts of a cell that is shared meet."""
    j, i, size = cell // cells, cell % cells, 1.0 / cells
    x, y = left + i * size, top + j * size
    keys, changes = corners_of(j, i, scratch), changes_of(j, i, x, y, size, scratch)
    middle = middle_of(world, rays, keys, changes, size, (x + 0.5 * size, y + 0.5 * size), count, scratch)
    scratch.middles[j, i, 0], scratch.middles[j, i, 1] = middle


@law
def share_cells(left, top, cells, scratch):
    """Fill `keys` and `parts` with what is in the cells of a pixel; how many."""
    found, size = 0, 1.0 / cells
    for cell in range(cells * cells):
        j, i = cell // cells, cell % cells
        x, y = left + i * size, top + j * size
        x1, y1 = x + size, y + size
        middle = x + 0.5 * size, y + 0.5 * size
        if is_shared(cells, cell, scratch):
            middle = scratch.middles[j, i, 0], scratch.middles[j, i, 1]
        a, b, c, d = corners_of(j, i, scratch)
        upper, right, lower, left_side = changes_of(j, i, x, y, size, scratch)
        found = share_side(scratch, a, b, (x, y), (x1, y), upper, middle, found)
        found = share_side(scratch, b, c, (x1, y), (x1, y1), right, middle, found)
        found = share_side(scratch, c, d, (x1, y1), (x, y1), lower, middle, found)
        found = share_side(scratch, d, a, (x, y1), (x, y), left_side, middle, found)
    return found


@law
def middle_of(world, rays, keys, changes, size, centre, count, scratch):
    """Where the parts of a cell meet; sides go around: from the corner of each key to that of the next."""
    mean_x, mean_y, number, apart_x, apart_y = 0.0, 0.0, 0, 0.0, 0.0
    for side in range(4):
        if keys[side] != keys[(side + 1) % 4]:
            mean_x, mean_y, number = mean_x + changes[side][0], mean_y + changes[side][1], number + 1
            apart_x, apart_y = changes[side][0] - apart_x, changes[side][1] - apart_y
    mean_x, mean_y = mean_x / number, mean_y / number
    if number == 2 and is_straight(world, rays, keys, mean_x, mean_y, apart_x, apart_y, size, count, scratch):
        return mean_x, mean_y
    m00, m01, m11, r0, r1 = PULL, 0.0, PULL, PULL * mean_x, PULL * mean_y
    for side in range(4):
        key = keys[side]
        if key != keys[(side + 1) % 4]:
            px, py = changes[side]
            dx, dy = direction_at(world, rays, px, py, side, key, size, count, scratch)
            m00, m01, m11 = m00 + dy * dy, m01 - dx * dy, m11 + dx * dx
            r0, r1 = r0 + dy * (dy * px - dx * py), r1 + dx * (dx * py - dy * px)
    whole, half = m00 * m11 - m01 * m01, 0.5 * size
    meet_x, meet_y = (r0 * m11 - r1 * m01) / whole, (r1 * m00 - r0 * m01) / whole
    return (
        min(max(meet_x, centre[0] - half), centre[0] + half),
        min(max(meet_y, centre[1] - half), centre[1] + half),
    )


@law
def is_straight(world, rays, keys, x, y, apart_x, apart_y, size, count, scratch):
    """Whether the key changes in the middle between two changes, too; both places are (x, y) -+ half of `apart`."""
    length = math.sqrt(apart_x * apart_x + apart_y * apart_y)
    if length == 0.0:
        return True
    off_x, off_y = OFF_LINE * size * apart_y / length, -OFF_LINE * size * apart_x / length
    one, other = keys[0], keys[0]
    for _ in range(2):  # (one side, and the other)
        one = other
        other, _there = key_at(world, rays, x + off_x, y + off_y, count, scratch)
        off_x, off_y = -off_x, -off_y
    return one != other and (one == keys[0] or other == keys[0])


@law
def direction_at(world, rays, px, py, side, key, size, count, scratch):
    """The direction into the cell in which the key changes from a place on a side."""
    low, high = 0.0, math.pi  # from the way back along the side, through the cell, to the way on
    turn = side * 0.5 * math.pi
    for _ in range(HALVINGS):
        angle = 0.5 * (low + high)
        around = turn + math.pi - angle
        x, y = px + RADIUS * size * math.cos(around), py + RADIUS * size * math.sin(around)
        there, _ = key_at(world, rays, x, y, count, scratch)
        if there == key:
            low = angle
        else:
            high = angle
    around = turn + math.pi - 0.5 * (low + high)
    return math.cos(around), math.sin(around)


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
