"""The walk over the pixels of a picture, tile by tile: first every centre, then the pixels in which things meet.

A tile looks only at things whose ball its cone of rays may touch.  Keys have a margin of one pixel, so that a pixel at
the border knows what is beyond it.  A band of tiles depends on no other, so threads may share the bands in any way.
"""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law, walk
from vid2ev.scenes.rays.edges import light_of_parts, measure
from vid2ev.scenes.rays.layout import JUMP, MESH, THING
from vid2ev.scenes.rays.meet import key_of, meet
from vid2ev.scenes.rays.pixel import light_of, shadows_of

TILE = 16


@walk
def trace_band(world, rays, first, last, wanted, light, depth, thing, keys, scratch):
    """Light, depth, thing and key at the centres of the rows first ... last - 1 of `rays` (the margin is row 0).

    rays   float64 [H + 2, W + 2, 2]: (x, y) of the rays (x, y, 1) through the centres of the pixels and of a margin
    wanted uint8 [bands, tiles]: 0 for tiles that stay as they are
    light  float32 [H, W, 3]; thing int32 [H, W]; with the margin: depth float32, keys int64 [H + 2, W + 2]
    """
    height, width = rays.shape[0], rays.shape[1]
    for left in range(0, width, TILE):
        if not wanted[first // TILE, left // TILE]:
            continue
        right = min(left + TILE, width)
        count = things_in_tile(world, rays, first, last, left, right, scratch.things)
        for line in range(first, last):
            for column in range(left, right):
                x, y = rays[line, column, 0], rays[line, column, 1]
                meeting = meet(world, scratch.things, count, x, y, scratch.stack)
                shadows = shadows_of(world, meeting, x, y, scratch.stack)
                keys[line, column] = key_of(world, meeting[0], meeting[1], meeting[2], shadows, math.inf)
                depth[line, column] = meeting[1]
                if 0 < line < height - 1 and 0 < column < width - 1:
                    across, down = steps(rays, line, column)
                    r, g, b = light_of(world, meeting, x, y, across, down, shadows)
                    light[line - 1, column - 1, 0] = r
                    light[line - 1, column - 1, 1] = g
                    light[line - 1, column - 1, 2] = b
                    thing[line - 1, column - 1] = meeting[0]


@walk
def smooth_band(world, rays, first, last, wanted, cells, details, light, depth, keys, scratch):
    """Light anew where the keys of rows first ... last - 1 differ from a neighbour's, and in finer cells at details.

    cells    into how many a pixel is cut each way: usually, and at details
    details  uint8 [H + 2, W + 2]
    """
    height, width = rays.shape[0], rays.shape[1]
    for left in range(0, width, TILE):
        if not wanted[first // TILE, left // TILE]:
            continue
        right, count = min(left + TILE, width), -1
        for line in range(max(first, 1), min(last, height - 1)):
            for column in range(max(left, 1), min(right, width - 1)):
                across, down = steps(rays, line, column)
                if details[line, column] or differs(world, keys, depth, line, column, across):
                    if count < 0:
                        count = things_in_tile(world, rays, first, last, left, right, scratch.things)
                    cut = cells[1] if details[line, column] else cells[0]
                    found = measure(world, rays, column - 1, line - 1, cut, count, scratch)
                    if scratch.odd[0] and cut < cells[1]:
                        found = measure(world, rays, column - 1, line - 1, cells[1], count, scratch)
                    r, g, b = light_of_parts(world, rays, found, across, down, count, scratch)
                    light[line - 1, column - 1, 0] = r
                    light[line - 1, column - 1, 1] = g
                    light[line - 1, column - 1, 2] = b


@walk
def cast(world, rays, depth, thing, scratch):
    """Depth and thing of single rays [n, 2]."""
    for k in range(len(rays)):
        meeting = meet(world, world.order, len(world.order), rays[k, 0], rays[k, 1], scratch.stack)
        depth[k], thing[k] = meeting[1], meeting[0]


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


@law
def things_in_tile(world, rays, first, last, left, right, things):
    """Put the things that a tile may see into `things`, the nearest first; how many."""
    ax, ay, az, widest = cone(rays, first, last, left, right)
    count = 0
    for k in range(len(world.order)):
        i = world.order[k]
        x, y, z, radius = world.ball[i, 0], world.ball[i, 1], world.ball[i, 2], world.ball[i, 3]
        distance = math.sqrt(x * x + y * y + z * z)
        seen = not distance > radius
        if not seen:
            off = math.acos(min(max((x * ax + y * ay + z * az) / distance, -1.0), 1.0))
            seen = not off > widest + math.asin(radius / distance)
        if seen:
            things[count] = i
            count += 1
    return count


@law
def cone(rays, first, last, left, right):
    """The middle of a tile's rays, a unit vector, and the angle within which they are, with half a pixel around."""
    x, y, z, widest = 0.0, 0.0, 0.0, 0.0
    low, end = min(last, rays.shape[0] - 1), min(right, rays.shape[1] - 1)
    high, start = max(first - 1, 0), max(left - 1, 0)
    for turn in range(2):
        middle = math.sqrt(x * x + y * y + z * z)
        for corner in range(4):
            line, column = (high, low)[corner // 2], (start, end)[corner % 2]
            rx, ry = rays[line, column, 0], rays[line, column, 1]
            length = math.sqrt(rx * rx + ry * ry + 1.0)
            if turn == 0:
                x, y, z = x + rx / length, y + ry / length, z + 1.0 / length
            else:
                cosine = (x * rx + y * ry + z) / (length * middle)
                widest = max(widest, math.acos(min(max(cosine, -1.0), 1.0)))
    if not middle > 0.0:  # (a corner sees nothing: look at everything)
        return 0.0, 0.0, 1.0, math.pi
    # (sides between the corners may bend outwards through a lens)
    return x / middle, y / middle, z / middle, 1.1 * widest + 1e-6
