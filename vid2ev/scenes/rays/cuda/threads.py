"""A thread's part of each kernel: from its number to its tile or pixel.

Threads go tile by tile, 256 pixels each, so that those that run together look at the same things.
"""

from __future__ import annotations

from vid2ev.scenes.rays.compiler import law, walk
from vid2ev.scenes.rays.cuda.easel import world_of
from vid2ev.scenes.rays.picture import carry_pixel, is_mixed, smooth, trace
from vid2ev.scenes.rays.scratch import Scratch
from vid2ev.scenes.rays.tiles import TILE, things_in_tile


@walk
def list_at(thread, worlds, easel, listed):
    """List what a tile may see."""
    height, width = easel.rays.shape[0], easel.rays.shape[1]
    tiles = listed.counts.shape[1]
    k, tile = thread // tiles, thread % tiles
    if k < listed.counts.shape[0]:
        across = (width + TILE - 1) // TILE
        first, left = TILE * (tile // across), TILE * (tile % across)
        listed.counts[k, tile] = things_in_tile(
            world_of(worlds, k), easel.rays, first, min(first + TILE, height), left, min(left + TILE, width),
            listed.things[k, tile],
        )  # fmt: skip


@walk
def trace_at(thread, worlds, easel, listed, stack):
    """The centre of a pixel."""
    k, tile, line, column = pixel_of(thread, easel.rays, listed.counts)
    if k >= 0:
        trace(
            world_of(worlds, k), easel.rays, line, column, listed.things[k, tile], listed.counts[k, tile],
            easel.light[k], easel.depth[k], easel.thing[k], easel.keys[k], stack,
        )  # fmt: skip


@walk
def is_mixed_at(thread, worlds, easel, listed):
    """Whether things meet in a pixel."""
    k, _, line, column = pixel_of(thread, easel.rays, listed.counts)
    if k < 0 or not (0 < line < easel.rays.shape[0] - 1 and 0 < column < easel.rays.shape[1] - 1):
        return False
    return is_mixed(world_of(worlds, k), easel.rays, line, column, easel.details[k], easel.depth[k], easel.keys[k])


@walk
def smooth_listed(
    thread, worlds, easel, listed, cells, stack, corners, across, down, depths, split, odd, keys, parts
):  # fmt: skip
    """The light of a pixel that is listed."""
    k, tile, line, column = pixel_of(listed.mixed[thread], easel.rays, listed.counts)
    scratch = Scratch(stack, listed.things[k, tile], corners, across, down, depths, split, odd, keys, parts)
    smooth(
        world_of(worlds, k), easel.rays, line, column, cells, easel.details[k], listed.counts[k, tile], easel.light[k],
        scratch,
    )  # fmt: skip


@walk
def carry_at(thread, worlds, carried, stack):
    """`carry` for a pixel, to the one world there is."""
    line, column = thread // carried.thing.shape[1], thread % carried.thing.shape[1]
    if line < carried.thing.shape[0]:
        carry_pixel(
            world_of(worlds, 0), line, column, carried.rays, carried.depth, carried.thing, carried.motions,
            carried.plane, carried.seen, stack,
        )  # fmt: skip


@law
def pixel_of(thread, rays, counts):
    """(picture, tile, line, column) of a thread; the picture is -1 beyond the last one and beyond its borders."""
    across = (rays.shape[1] + TILE - 1) // TILE
    place, within = thread // (TILE * TILE), thread % (TILE * TILE)
    k, tile = place // counts.shape[1], place % counts.shape[1]
    line, column = TILE * (tile // across) + within // TILE, TILE * (tile % across) + within % TILE
    if k >= counts.shape[0] or line >= rays.shape[0] or column >= rays.shape[1]:
        k = -1
    return k, tile, line, column
