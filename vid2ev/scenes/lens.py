"""Rays of all pixels of a camera, as the ray caster takes them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import pixel_grid, rays_of


@lru_cache(maxsize=16)
def rays_of_pixels(intrinsics: Intrinsics) -> np.ndarray:
    """x, y [H + 2, W + 2, 2] of the rays (x, y, 1) through pixel centres, with a margin of 1 px; not to be written to.

    NaN where no ray leads to the pixel: nothing is seen there.
    """
    width, height = intrinsics.size
    rays = np.ascontiguousarray(rays_of(pixel_grid((width + 2, height + 2)) - 1, intrinsics)[..., :2])
    rays.flags.writeable = False
    return rays
