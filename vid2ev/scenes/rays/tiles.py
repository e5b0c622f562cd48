"""Tiles of a picture, and the things that each may see: those whose ball its cone of rays may touch."""

from __future__ import annotations

import math

from vid2ev.scenes.rays.compiler import law

TILE = 16
WIDE = 1.2  # rad from the middle of a tile to its corners: of wider ones the corners may not be farthest from it


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
    if not middle > 0.0 or widest > WIDE:  # (a corner sees nothing, or nearly all is in the tile: look at everything)
        return 0.0, 0.0, 1.0, math.pi
    # (sides between the corners may bend outwards through a lens)
    return x / middle, y / middle, z / middle, 1.1 * widest + 1e-6
