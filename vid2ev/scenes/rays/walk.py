"""The walk over the pixels of a picture, tile by tile: first every centre, then the pixels in which things meet.

Keys have a margin of one pixel, so that a pixel at the border knows what is beyond it.  A band of tiles depends on no
other, so threads may share the bands in any way.
"""

from __future__ import annotations

from vid2ev.scenes.rays.compiler import walk
from vid2ev.scenes.rays.picture import carry_pixel, is_mixed, smooth, trace
from vid2ev.scenes.rays.tiles import TILE, things_in_tile


@walk
def trace_band(world, rays, first, last, wanted, light, depth, thing, keys, scratch):
    """Light, depth, thing and key at the centres of the rows first ... last - 1 of `rays` (the margin is row 0).

    rays   float64 [H + 2, W + 2, 2]: (x, y) of the rays (x, y, 1) through the centres of the pixels and of a margin
    wanted uint8 [bands, tiles]: 0 for tiles that stay as they are
    light  float32 [H, W, 3]; thing int32 [H, W]; with the margin: depth float32, keys int64 [H + 2, W + 2]
    """
    width = rays.shape[1]
    for left in range(0, width, TILE):
        if not wanted[first // TILE, left // TILE]:
            continue
        right = min(left + TILE, width)
        count = things_in_tile(world, rays, first, last, left, right, scratch.things)
        for line in range(first, last):
            for column in range(left, right):
                trace(world, rays, line, column, scratch.things, count, light, depth, thing, keys, scratch.stack)


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
                if is_mixed(world, rays, line, column, details, depth, keys):
                    if count < 0:
                        count = things_in_tile(world, rays, first, last, left, right, scratch.things)
                    smooth(world, rays, line, column, cells, details, count, light, scratch)


@walk
def carry_all(world, rays, depth, thing, motions, plane, seen, stack):
    """Where the points of all pixels are at another instant, as of `carry`.

    depth, thing  of the picture [H, W]; world and motions as of `carry`
    plane         float64 [H, W, 2], the places; seen uint8 [H, W]
    """
    for line in range(thing.shape[0]):
        for column in range(thing.shape[1]):
            carry_pixel(world, line, column, rays, depth, thing, motions, plane, seen, stack)
