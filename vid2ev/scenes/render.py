"""Pictures of a world: light, depth and what is seen, exact at the centre of each pixel, edges smoothed.

    depth, thing   where the ray through the pixel's centre meets something first
    light          there, with pictures on surfaces filtered over the pixel; where things, faces or shadows meet
                   within a pixel or beside it, the light of each weighted with its area in the pixel

A picture is a function of its arguments alone, and light changes smoothly while things move.  What is narrower than
a sixth of a pixel may be missed; spikes of meshes and gaps between things, if they are narrower than a pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from vid2ev.cores import usable_cores
from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.scenes.details import details_of
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.rays.layout import World
from vid2ev.scenes.rays.scratch import Scratch, scratch_for
from vid2ev.scenes.rays.tiles import TILE
from vid2ev.scenes.rays.walk import smooth_band, trace_band
from vid2ev.scenes.snapshot import Snapshot
from vid2ev.scenes.world_numbers import numbers_of

SAMPLES = 2
FINE = 6  # the same, of pixels with corners of things and of small things
FEW = 1 << 13  # pixels that are painted before threads would have started
Work = Callable[[int, int, Scratch], Any]  # on rows first ... last - 1


class Picture(NamedTuple):
    """What a camera sees.

    light  float32 [H, W, 3], linear, 1.0 a white surface under ambient light of 1.0
    depth  float32 [H, W], z in the camera's coordinates [m]; +inf where nothing is, NaN where the lens sees nothing
    thing  int32 [H, W], the number of the thing in the snapshot; -1 where nothing is
    """

    light: np.ndarray
    depth: np.ndarray
    thing: np.ndarray


class Canvas(NamedTuple):
    """What a picture is painted on: light and thing of `Picture`, depth and keys with a margin of a pixel."""

    light: np.ndarray
    thing: np.ndarray
    depth: np.ndarray
    keys: np.ndarray  # int64

    def picture(self) -> Picture:
        """The picture on it, which stays as it is when the canvas is painted on."""
        return Picture(self.light, self.depth[1:-1, 1:-1].copy(), self.thing)


def canvas_of(size: tuple[int, int]) -> Canvas:
    """An empty canvas for a picture of this size (width, height)."""
    width, height = size
    light, thing = np.empty((height, width, 3), np.float32), np.empty((height, width), np.int32)
    return Canvas(light, thing, *(np.empty((height + 2, width + 2), dtype) for dtype in (np.float32, np.int64)))


def tiles_of(size: tuple[int, int]) -> tuple[int, int]:
    """How many tiles a canvas of this size (width, height) has down and across."""
    width, height = size
    return -(-(height + 2) // TILE), -(-(width + 2) // TILE)


def cells_of(samples: int) -> tuple[int, int]:
    """Into how many cells pixels are cut each way: usually, and at details.  Raises UsageError."""
    if not 1 <= samples <= 16:
        raise UsageError(f"{samples} samples must be 1 (jagged edges) to 16; 2 is usual")
    return samples, max(samples, FINE)


def render(
    snapshot: Snapshot, intrinsics: Intrinsics, pose: Pose, *, samples: int = SAMPLES, threads: int | None = None
) -> Picture:
    """The picture of a camera with this pose (camera to world).

    samples  1: one ray for each pixel, jagged edges; n >= 2: pixels at edges are measured in n x n cells
    threads  all cores if not given; the picture is the same
    """
    world = numbers_of(snapshot, pose)
    canvas, details = canvas_of(intrinsics.size), details_of(snapshot, world, intrinsics, pose)
    paint(canvas, world, details, intrinsics, np.ones(tiles_of(intrinsics.size), np.uint8), samples, threads)
    return canvas.picture()


def paint(
    canvas: Canvas,
    world: World,
    details: np.ndarray,
    intrinsics: Intrinsics,
    wanted: np.ndarray,
    samples: int = SAMPLES,
    threads: int | None = None,
) -> None:
    """Paint the tiles that are `wanted`, uint8 of `tiles_of`; all others stay as they are."""
    rays, cells = rays_of_pixels(intrinsics), cells_of(samples)
    light, thing, depth, keys = canvas

    def trace(first: int, last: int, scratch: Scratch) -> Any:
        trace_band(world, rays, first, last, wanted, light, depth, thing, keys, scratch)

    def smooth(first: int, last: int, scratch: Scratch) -> Any:
        smooth_band(world, rays, first, last, wanted, cells, details, light, depth, keys, scratch)

    threads = 1 if thing.size <= FEW else threads
    works: list[Work] = [trace, smooth] if samples > 1 else [trace]
    for work in works:
        _in_bands(
            work, np.flatnonzero(wanted.any(axis=1)), len(rays), lambda: scratch_for(len(world.kind), cells[1]), threads
        )


def _in_bands(work: Work, bands: np.ndarray, height: int, scratch: Callable[[], Scratch], threads: int | None) -> None:
    """Do the work for these bands of rows."""

    def band(first: int) -> None:
        work(first, min(first + TILE, height), scratch())

    firsts = [int(band) * TILE for band in bands]
    threads = min(threads or usable_cores(), len(firsts))
    if threads <= 1:
        for first in firsts:
            band(first)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(band, firsts))
