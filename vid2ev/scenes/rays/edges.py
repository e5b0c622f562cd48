"""The light of a pixel in which things meet: the areas of what is in it, measured, and the light of each.

    light = sum over keys of  area(key) * light(key at the centre of its area)

The pixel is cut into cells; where the corners of a cell have different keys, the places on its sides at which the key
changes are found by bisection, and the cell is shared out along straight lines (`cells`).  A straight edge has its
exact area at any angle, so light changes smoothly while an edge moves through the pixel.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.cells import find_middle, is_shared, share_cells
from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import BEHIND, JUMP, MESH, NOTHING, PART, THING
from vid2ev.scenes.rays.meet import key_of, meet, meet_thing, row, turned
from vid2ev.scenes.rays.pixel import light_of
from vid2ev.scenes.rays.probe import change_between, key_at, ray_at
from vid2ev.scenes.rays.scratch import AREA, AT_X, AT_Y, X, Y


@law
def measure(world, rays, column, line, cells, count, scratch):
    """Fill `keys` and `parts` with what is in a pixel; how many."""
    scratch.odd[0], scratch.split[0] = 0, math.inf
    left, top = column - 0.5, line - 0.5
    for corner in range((cells + 1) * (cells + 1)):
        look_at_corner(world, rays, left, top, cells, corner, count, scratch)
    part_meshes(world, rays, left, top, cells, scratch)
    for side in range(sides_of(cells)):
        if is_changing(cells, side, scratch):
            find_change(world, rays, left, top, cells, side, count, scratch)
    for cell in range(cells * cells):
        if is_shared(cells, cell, scratch):
            find_middle(world, rays, left, top, cells, cell, count, scratch)
    return share_cells(left, top, cells, scratch)


@law
def look_at_corner(world, rays, left, top, cells, corner, count, scratch):
    """The key and the depth at a corner of cells."""
    j, i = corner // (cells + 1), corner % (cells + 1)
    key, depth = key_at(world, rays, left + i / cells, top + j / cells, count, scratch)
    scratch.corners[j, i], scratch.depths[j, i] = key, depth


@law
def part_meshes(world, rays, left, top, cells, scratch):
    """Set the depth at which a mesh hides itself, and mark the corners behind it."""
    hides = False
    for j in range(cells + 1):
        for i in range(cells + 1):
            key = scratch.corners[j, i]
            hides = hides or (key >= 0 and world.kind[key // THING] == MESH)
    if not hides:
        return
    scratch.split[0] = widest_gap(world, rays, left, top, cells, scratch)
    for j in range(cells + 1):
        for i in range(cells + 1):
            key = scratch.corners[j, i]
            if key >= 0 and world.kind[key // THING] == MESH and scratch.depths[j, i] > scratch.split[0]:
                scratch.corners[j, i] = key + BEHIND


@law
def sides_of(cells):
    """How many sides as many cells across and down have; one that belongs to two cells is one."""
    return 2 * cells * (cells + 1)


@law
def ends_of(cells, side):
    """(j, i, dj, di): the corner at which a side begins, and the way to the next."""
    if side < cells * (cells + 1):
        return side // cells, side % cells, 0, 1
    rest = side - cells * (cells + 1)
    return rest // (cells + 1), rest % (cells + 1), 1, 0


@law
def is_changing(cells, side, scratch):
    """Whether the ends of a side have different keys."""
    j, i, dj, di = ends_of(cells, side)
    return scratch.corners[j, i] != scratch.corners[j + dj, i + di]


@law
def find_change(world, rays, left, top, cells, side, count, scratch):
    """Where along a side the key changes."""
    j, i, dj, di = ends_of(cells, side)
    size = 1.0 / cells
    x, y = left + i * size, top + j * size
    share = change_between(
        world, rays, x, y, x + di * size, y + dj * size, scratch.corners[j, i], scratch.corners[j + dj, i + di],
        count, scratch,
    )  # fmt: skip
    if di > 0:
        scratch.across[j, i] = share
    else:
        scratch.down[j, i] = share


@law
def widest_gap(world, rays, left, top, cells, scratch):
    """The middle of the widest gap in depth between corners on the same part of a mesh; infinite if none is wide."""
    x, y = ray_at(rays, left, top)
    x1, y1 = ray_at(rays, left + 1.0, top)
    least, split = JUMP * math.sqrt((x1 - x) * (x1 - x) + (y1 - y) * (y1 - y)), math.inf
    widest = 0.0
    across, number = cells + 1, (cells + 1) * (cells + 1)
    for k in range(number):
        key, depth = scratch.corners[k // across, k % across], scratch.depths[k // across, k % across]
        if key >= 0 and world.kind[key // THING] == MESH:
            further = math.inf
            for other in range(number):
                behind = scratch.depths[other // across, other % across]
                same = scratch.corners[other // across, other % across] // PART == key // PART
                if same and depth < behind < further:
                    further = behind
            if further < math.inf and further - depth > max(widest, least * depth):
                widest, split = further - depth, 0.5 * (further + depth)
    return split


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
    meeting, shadows = (NOTHING, math.inf, 0, 0.0, 0.0), 0
    if key >= 0:
        thing, shadows = key // THING, key % BEHIND
        eye, d = row(world.eye, thing), turned(world.turn, thing, x, y, 1.0)
        t, face, b1, b2 = meet_thing(world, thing, eye, d, math.inf, scratch.stack)
        meeting = thing, t, face, b1, b2
        if not (t < math.inf and key_of(world, thing, t, face, shadows, scratch.split[0]) == key):
            x, y = ray_at(rays, scratch.parts[part, AT_X], scratch.parts[part, AT_Y])
            meeting = meet(world, scratch.things, count, x, y, scratch.stack)
    return light_of(world, meeting, x, y, across, down, shadows)
