"""The light of a pixel in which things meet: the areas of what is in it, measured, and the light of each.

    light = sum over keys of  area(key) * light(key at the centre of its area)

The pixel is cut into cells; where the corners of a cell have different keys, the places on its sides at which the key
changes are found by bisection, and the cell is shared out along straight lines (`cells`).  A straight edge has its
exact area at any angle, so light changes smoothly while an edge moves through the pixel.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.cells import share_cell
from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import BEHIND, JUMP, MESH, NOTHING, PART, THING
from vid2ev.scenes.rays.meet import key_of, meet, meet_thing, row, turned
from vid2ev.scenes.rays.pixel import light_of
from vid2ev.scenes.rays.probe import change_between, key_at, ray_at
from vid2ev.scenes.rays.scratch import AREA, AT_X, AT_Y, X, Y


@law
def measure(world, rays, column, line, cells, count, scratch):
    """Fill `keys` and `parts` with what is in a pixel; how many."""
    scratch.odd[0] = 0
    left, top, size = column - 0.5, line - 0.5, 1.0 / cells
    look_at_corners(world, rays, left, top, cells, count, scratch)
    # A side belongs to two cells; its change is found once.
    for j in range(cells + 1):
        for i in range(cells + 1):
            x, y = left + i * size, top + j * size
            for way in range(2):
                di, dj = 1 - way, way
                if i + di > cells or j + dj > cells:
                    continue
                key, next_key = scratch.corners[j, i], scratch.corners[j + dj, i + di]
                if key != next_key:
                    share = change_between(
                        world, rays, x, y, x + di * size, y + dj * size, key, next_key, count, scratch
                    )
                    if way == 0:
                        scratch.across[j, i] = share
                    else:
                        scratch.down[j, i] = share
    found = 0
    for j in range(cells):
        for i in range(cells):
            found = share_cell(world, rays, i, j, left + i * size, top + j * size, size, found, count, scratch)
    return found


@law
def look_at_corners(world, rays, left, top, cells, count, scratch):
    """Fill `corners`, and set the depth at which a mesh hides itself."""
    scratch.split[0], hides = math.inf, False
    for j in range(cells + 1):
        for i in range(cells + 1):
            key, depth = key_at(world, rays, left + i / cells, top + j / cells, count, scratch)
            scratch.corners[j, i], scratch.depths[j, i] = key, depth
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
