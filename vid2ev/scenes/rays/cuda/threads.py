"""A thread's part of each kernel: from its number to its tile or pixel.

Threads go tile by tile, 256 pixels each, so that those that run together look at the same things.
"""

from __future__ import annotations

from vid2ev.scenes.rays.cells import find_middle, is_shared, share_cells
from vid2ev.scenes.rays.compiler import law, walk
from vid2ev.scenes.rays.cuda.easel import world_of
from vid2ev.scenes.rays.edges import find_change, is_changing, look_at_corner, part_meshes, sides_of
from vid2ev.scenes.rays.picture import carry_pixel, is_mixed, mix, trace
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
def corner_at(thread, worlds, measured, stack):
    """A corner of a cell of a pixel."""
    cells = measured.corners.shape[1] - 1
    p, corner = thread // ((cells + 1) * (cells + 1)), thread % ((cells + 1) * (cells + 1))
    if p < measured.pixels.size:
        k, tile, left, top = place_of(p, measured)
        look_at_corner(
            world_of(worlds, k), measured.rays, left, top, cells, corner, measured.counts[k, tile],
            scratch_of(measured, p, measured.things[k, tile], stack),
        )  # fmt: skip


@walk
def part_at(p, worlds, measured, stack):
    """What follows from all corners of a pixel: along how many sides keys change, and how many cells are shared."""
    cells = measured.corners.shape[1] - 1
    k, tile, left, top = place_of(p, measured)
    scratch = scratch_of(measured, p, measured.things[k, tile], stack)
    part_meshes(world_of(worlds, k), measured.rays, left, top, cells, scratch)
    sides, shared = 0, 0
    for side in range(sides_of(cells)):
        sides += is_changing(cells, side, scratch)
    for cell in range(cells * cells):
        shared += is_shared(cells, cell, scratch)
    return sides, shared


@walk
def list_changes(p, measured, stack, first_side, first_shared):
    """List these, from places on that are free."""
    cells = measured.corners.shape[1] - 1
    scratch = scratch_of(measured, p, measured.things[0, 0], stack)
    for side in range(sides_of(cells)):
        if is_changing(cells, side, scratch):
            measured.changes[first_side] = p * sides_of(cells) + side
            first_side += 1
    first_shared += measured.pixels.size * sides_of(cells)
    for cell in range(cells * cells):
        if is_shared(cells, cell, scratch):
            measured.changes[first_shared] = p * cells * cells + cell
            first_shared += 1


@walk
def change_at(thread, worlds, measured, stack):
    """A side along which the key changes."""
    cells = measured.corners.shape[1] - 1
    if thread < measured.totals[0]:
        p, side = measured.changes[thread] // sides_of(cells), measured.changes[thread] % sides_of(cells)
        k, tile, left, top = place_of(p, measured)
        find_change(
            world_of(worlds, k), measured.rays, left, top, cells, side, measured.counts[k, tile],
            scratch_of(measured, p, measured.things[k, tile], stack),
        )  # fmt: skip


@walk
def middle_at(thread, worlds, measured, stack):
    """A cell that is shared."""
    cells = measured.corners.shape[1] - 1
    if thread < measured.totals[1]:
        number = measured.changes[measured.pixels.size * sides_of(cells) + thread]
        p, cell = number // (cells * cells), number % (cells * cells)
        k, tile, left, top = place_of(p, measured)
        find_middle(
            world_of(worlds, k), measured.rays, left, top, cells, cell, measured.counts[k, tile],
            scratch_of(measured, p, measured.things[k, tile], stack),
        )  # fmt: skip


@walk
def mix_at(p, worlds, measured, stack, keys, parts):
    """The light of a pixel; returns False where it is to be cut finer."""
    k, tile, line, column = pixel_of(measured.pixels[p], measured.rays, measured.counts)
    if not measured.finest and (measured.odd[p] != 0 or measured.details[k, line, column] != 0):
        return False
    scratch = with_parts(measured, p, measured.things[k, tile], stack, keys, parts)
    found = share_cells(column - 1.5, line - 1.5, measured.corners.shape[1] - 1, scratch)
    mix(world_of(worlds, k), measured.rays, line, column, found, measured.counts[k, tile], measured.light[k], scratch)
    return True


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
def place_of(p, measured):
    """(picture, tile, left, top) of pixel p of those that are measured, as of `edges.measure`."""
    k, tile, line, column = pixel_of(measured.pixels[p], measured.rays, measured.counts)
    return k, tile, column - 1.5, line - 1.5


@law
def scratch_of(measured, p, things, stack):
    """What the laws of pixels work in until their parts are told, of pixel p of those that are measured."""
    return with_parts(measured, p, things, stack, stack, measured.middles[p, 0])


@law
def with_parts(measured, p, things, stack, keys, parts):
    """The same, with parts."""
    return Scratch(
        stack, things, measured.corners[p], measured.across[p], measured.down[p], measured.middles[p],
        measured.depths[p], measured.split[p : p + 1], measured.odd[p : p + 1], keys, parts,
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
