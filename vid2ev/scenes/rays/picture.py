"""One pixel of a picture: what is at its centre, and its light anew where things meet in it or beside it."""

from __future__ import annotations

import math

from vid2ev.scenes.rays.carry import carry
from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.edges import light_of_parts, measure
from vid2ev.scenes.rays.layout import JUMP, MESH, THING
from vid2ev.scenes.rays.meet import key_of, meet
from vid2ev.scenes.rays.pixel import light_of, shadows_of


@law
def trace(world, rays, line, column, things, count, light, depth, thing, keys, stack):
    """Light, depth, thing and key at the centre of a pixel (the margin is line 0), of the first `count` of `things`."""
    x, y = rays[line, column, 0], rays[line, column, 1]
    meeting = meet(world, things, count, x, y, stack)
    shadows = shadows_of(world, meeting, x, y, stack)
    keys[line, column] = key_of(world, meeting[0], meeting[1], meeting[2], shadows, math.inf)
    seen = x == x  # (no ray leads to what a lens does not see)
    depth[line, column] = meeting[1] if seen else math.nan
    if 0 < line < rays.shape[0] - 1 and 0 < column < rays.shape[1] - 1:
        across, down = steps(rays, line, column)
        r, g, b = light_of(world, meeting, x, y, across, down, shadows) if seen else (0.0, 0.0, 0.0)
        light[line - 1, column - 1, 0] = r
        light[line - 1, column - 1, 1] = g
        light[line - 1, column - 1, 2] = b
        thing[line - 1, column - 1] = meeting[0]


@law
def is_mixed(world, rays, line, column, details, depth, keys):
    """Whether the light of a pixel is more than that at its centre."""
    across, _ = steps(rays, line, column)
    return details[line, column] != 0 or differs(world, keys, depth, line, column, across)


@law
def smooth(world, rays, line, column, cells, details, count, light, scratch):
    """The light of a pixel in which things meet; `cells` is into how many it is cut: usually, and at details."""
    cut, found = cells[1] if details[line, column] else cells[0], -1
    while found < 0:  # (once or twice: what is called in one place is compiled once)
        found = measure(world, rays, column - 1, line - 1, cut, count, scratch)
        if scratch.odd[0] and cut < cells[1]:
            cut, found = cells[1], -1
    mix(world, rays, line, column, found, count, light, scratch)


@law
def mix(world, rays, line, column, found, count, light, scratch):
    """The light of a pixel that has been measured, of which as many parts were found."""
    across, down = steps(rays, line, column)
    r, g, b = light_of_parts(world, rays, found, across, down, count, scratch)
    light[line - 1, column - 1, 0] = r
    light[line - 1, column - 1, 1] = g
    light[line - 1, column - 1, 2] = b


@law
def carry_pixel(world, line, column, rays, depth, thing, motions, plane, seen, stack):
    """Where the point of a pixel (line 0 is the first of the picture) is at another instant."""
    x, y = rays[line + 1, column + 1, 0], rays[line + 1, column + 1, 1]
    there_x, there_y, visible = carry(world, motions, x, y, depth[line, column], thing[line, column], stack)
    plane[line, column, 0], plane[line, column, 1], seen[line, column] = there_x, there_y, visible


@law
def differs(world, keys, depth, line, column, across):
    """Whether any of the eight neighbours has another key, or on a mesh a depth at which it may hide itself."""
    key, here, same, jump = keys[line, column], depth[line, column], True, math.inf
    if key >= 0 and world.kind[key // THING] == MESH:
        jump = JUMP * here * math.sqrt(across[0] * across[0] + across[1] * across[1])
    for j in range(line - 1, line + 2):
        for i in range(column - 1, column + 2):
            same = same and keys[j, i] == key and not abs(depth[j, i] - here) > jump
    return not same


@law
def steps(rays, line, column):
    """How a ray turns from pixel to pixel, across and down."""
    return (
        0.5 * (rays[line, column + 1, 0] - rays[line, column - 1, 0]),
        0.5 * (rays[line, column + 1, 1] - rays[line, column - 1, 1]),
    ), (
        0.5 * (rays[line + 1, column, 0] - rays[line - 1, column, 0]),
        0.5 * (rays[line + 1, column, 1] - rays[line - 1, column, 1]),
    )
