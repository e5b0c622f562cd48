"""The light that an environment sends to surfaces, by their normals.

    light(n) = 1/pi * integral of L(w) max(n w, 0) dw,   as nine spherical harmonics

It is exact for an even sky, and within a few percent for most others; a small bright sun in the picture lights less
sharply than it should: give such a sun a lamp of its own.

Source: R. Ramamoorthi, P. Hanrahan, "An efficient representation for irradiance environment maps", SIGGRAPH 2001.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vid2ev.scenes.snapshot import Texture

# Of each harmonic: its factor squared, times that of its order in the convolution with the cosine, over pi.
WEIGHTS = np.array([0.282095, *[0.488603] * 3, 1.092548, 1.092548, 0.315392, 1.092548, 0.546274]) ** 2 * np.array(
    [1, *[2 / 3] * 3, *[1 / 4] * 5]
)
ENOUGH = 64  # rows


@lru_cache(maxsize=4)
def irradiance_of(environment: Texture) -> np.ndarray:
    """The nine harmonics [9, 3] that `rays.light.irradiance` adds up."""
    levels, sizes = environment.levels
    first, width, height = next((size for size in sizes if size[2] <= ENOUGH), sizes[-1])
    pixels = levels[first : first + width * height].reshape(height, width, 3).astype(np.float64)
    # (the centres of few and large pixels do not stand for all that these cover: cut them up)
    pixels = pixels.repeat(-(-ENOUGH // height), axis=0).repeat(-(-2 * ENOUGH // width), axis=1)
    height, width = pixels.shape[:2]
    edges = np.cos(np.linspace(0, np.pi, height + 1))
    area = (edges[:-1] - edges[1:]) * 2 * np.pi / width
    latitude = (np.arange(height)[:, None] + 0.5) / height * np.pi
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    x, z = np.sin(latitude) * np.sin(longitude), np.sin(latitude) * np.cos(longitude)
    y = -np.cos(latitude) + 0 * x
    basis = np.stack([1 + 0 * x, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y])
    return WEIGHTS[:, None] * np.einsum("khw,h,hwc->kc", basis, area, pixels)
