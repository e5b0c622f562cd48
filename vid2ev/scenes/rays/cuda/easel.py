"""What kernels work on: the worlds of several pictures, what these are painted on, and what is listed on the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vid2ev.scenes.rays.compiler import law
from vid2ev.scenes.rays.layout import World

STILL = (
    "pictures", "levels", "texels", "bounds", "links", "corners", "triangle_uv", "triangle_normals", "triangle_colours",
    "triangle_part",
)  # fmt: skip


class Easel(NamedTuple):
    """What pictures are painted on: as `walk` has it, one picture after the other."""

    rays: np.ndarray  # float64 [H + 2, W + 2, 2], of all
    light: np.ndarray  # float32 [pictures, H, W, 3]
    depth: np.ndarray  # float32 [pictures, H + 2, W + 2]
    thing: np.ndarray  # int32 [pictures, H, W]
    keys: np.ndarray  # int64 [pictures, H + 2, W + 2]
    details: np.ndarray  # uint8 [pictures, H + 2, W + 2]


class Listed(NamedTuple):
    """What is found for the next kernel."""

    things: np.ndarray  # int64 [pictures, tiles, n]: what a tile may see
    counts: np.ndarray  # int64 [pictures, tiles]: how many
    mixed: np.ndarray  # int64 [pictures x H x W]: pixels in which things meet
    total: np.ndarray  # int64 [1]: how many


class Measured(NamedTuple):
    """Pixels in which things meet, n that are cut into as many cells each, and what is found out about them.

    All that their kernels take but the worlds: some drivers take 4096 bytes and no more.
    """

    rays: np.ndarray  # as of `Easel`
    light: np.ndarray
    details: np.ndarray
    things: np.ndarray  # as of `Listed`
    counts: np.ndarray
    pixels: np.ndarray  # int64 [n], as of `Listed.mixed`
    finest: int  # whether what these cells do not tell apart is left at that
    corners: np.ndarray  # int64 [n, cells + 1, cells + 1], as of `Scratch`, as are those that follow
    across: np.ndarray  # float64 [n, cells + 1, cells]
    down: np.ndarray  # float64 [n, cells, cells + 1]
    middles: np.ndarray  # float64 [n, cells, cells, 2]
    depths: np.ndarray  # float64 [n, cells + 1, cells + 1]
    split: np.ndarray  # float64 [n], infinite at first
    odd: np.ndarray  # int64 [n]
    changes: np.ndarray  # int64 [n x (sides + cells)]: sides along which keys change, and, behind room for all sides,
    # cells that are shared; those of the first pixel are numbered first
    finer: np.ndarray  # int64 [n]: pixels that are to be cut finer
    totals: np.ndarray  # int64 [3]: how many sides, shared cells, and pixels to be cut finer there are


class Carried(NamedTuple):
    """Where the points of a picture are at another instant: see `walk.carry_all`."""

    rays: np.ndarray
    depth: np.ndarray
    thing: np.ndarray
    motions: np.ndarray
    plane: np.ndarray
    seen: np.ndarray


@law
def world_of(worlds, k):
    """The world of picture k, of a `World` in which all but what is `STILL` has a row for each picture."""
    w = worlds
    return World(
        w.kind[k], w.order[k], w.half[k], w.turn[k], w.eye[k], w.ball[k], w.nearest[k], w.root[k], w.colour[k],
        w.gloss[k], w.repeat[k], w.wraps[k], w.texture[k], w.environment[k], w.to_environment[k], w.environment_gain[k],
        w.irradiance[k], w.ambient[k], w.casts[k], w.lamp_kind[k], w.lamp_colour[k], w.lamp_reach2[k],
        w.lamp_shadows[k], w.lamp_in_camera[k], w.lamp[k], w.pictures, w.levels, w.texels, w.bounds, w.links, w.corners,
        w.triangle_uv, w.triangle_normals, w.triangle_colours, w.triangle_part,
    )  # fmt: skip
