"""Textures: photographs that come with scikit-image, a person's own files, and patterns that are computed.

    checker   squares, `count` across and down, of two colours in turn
    stripes   `count` upright stripes; with `soft`, light follows a sine instead of jumping
    noise     clouds: the spectrum of light falls as frequency**-roughness; from the darkest, colours[0], to colours[1]
    sky       for environments: colours[0] below, colours[1] at the horizon, colours[2] above

All of them can be repeated without a seam, but for photographs, a `checker` with an odd count, and `sky` up and down.
Colours are linear.

Source: clouds of a power-law spectrum, R. F. Voss, "Random fractal forgeries", 1985.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from vid2ev.errors import UsageError
from vid2ev.scenes.part import Colour, Part
from vid2ev.stamps import Stamp, stamp

PHOTOGRAPHS = {
    "astronaut": "astronaut.png",
    "brick": "brick.png",
    "camera": "camera.png",
    "cat": "chelsea.png",
    "coffee": "coffee.png",
    "coins": "coins.png",
    "grass": "grass.png",
    "gravel": "gravel.png",
    "hubble": "hubble_deep_field.jpg",
    "moon": "moon.png",
    "motorcycle": "motorcycle_left.png",
    "retina": "retina.jpg",
    "rocket": "rocket.jpg",
    "text": "text.png",
    "tissue": "ihc.png",
}
ANY = "photographs"  # any of these
IN_COLOUR = ("astronaut", "cat", "coffee", "hubble", "motorcycle", "retina", "rocket", "tissue")


class Pattern(Part):
    """A texture that is computed."""

    pattern: Literal["checker", "stripes", "noise", "sky"] = Field(description="which")
    colours: Annotated[tuple[Colour, ...], Field(min_length=2, max_length=3)] = Field(
        default=((0.05, 0.05, 0.05), (0.8, 0.8, 0.8)), description="linear, from 0 to 1; two, of a sky three"
    )
    count: int = Field(default=8, ge=1, le=512, description="squares or stripes across")
    soft: bool = Field(default=False, description="stripes follow a sine")
    roughness: float = Field(default=1.2, ge=0, le=4, description="of noise: 0 is white noise, 2 is soft clouds")
    seed: int = Field(default=0, ge=0, lt=1 << 63, description="which of all noises")
    size_px: int = Field(default=512, ge=2, le=4096, description="pixels across and down")

    @model_validator(mode="after")
    def _fits(self) -> Pattern:
        wanted, of = (3, ", below, at the horizon and above") if self.pattern == "sky" else (2, "")
        if len(self.colours) != wanted:
            raise ValueError(f"pattern '{self.pattern}' takes {wanted} colours{of}, not {len(self.colours)}")
        return self


def pixels_of(texture: str | Pattern) -> np.ndarray:
    """The linear light [H, W, 3] of a texture.  Raises UsageError, DataError for a file that cannot be read."""
    if isinstance(texture, Pattern):
        return _computed(texture)
    path = photograph_file(texture) if texture in PHOTOGRAPHS else Path(texture)
    return _photograph(path, stamp(path))


def photograph_file(name: str) -> Path:
    """Where a bundled photograph is.  Raises UsageError if scikit-image came without it."""
    import skimage

    path = Path(skimage.__file__).parent / "data" / PHOTOGRAPHS[name]
    if not path.exists():
        raise UsageError(f"texture '{name}': this scikit-image has no {path.name}; install another, or choose a file")
    return path


@lru_cache(maxsize=64)
def _photograph(path: Path, written: Stamp) -> np.ndarray:
    from vid2ev.light.picture_files import read_picture, white_in
    from vid2ev.light.pictures import PictureReader

    pixels, primaries, tagged = read_picture(path)
    transfer = "linear" if pixels.dtype.kind == "f" else tagged or "srgb"
    return np.maximum(PictureReader(transfer, "rgb", white_in(path)).light(pixels, primaries), 0)


def _computed(pattern: Pattern) -> np.ndarray:
    n = pattern.size_px
    colours = np.array(pattern.colours, np.float32)
    if pattern.pattern == "sky":
        height = -np.cos(np.pi * (np.arange(n) + 0.5) / n)[:, None, None]  # -1 above ... 1 below
        far = np.where(height > 0, colours[0], colours[2])
        # (most of the change is near the horizon, as in the sky)
        return np.repeat(colours[1] + (far - colours[1]) * np.sqrt(np.abs(height)), 2, axis=1).astype(np.float32)
    share = _noise(pattern) if pattern.pattern == "noise" else _regular(pattern)
    return (colours[0] + (colours[1] - colours[0]) * share[..., None]).astype(np.float32)


def _regular(pattern: Pattern) -> np.ndarray:
    place = (np.arange(pattern.size_px) + 0.5) / pattern.size_px * pattern.count
    if pattern.pattern == "stripes":
        across = (1 - np.cos(2 * np.pi * place)) / 2 if pattern.soft else np.floor(2 * place) % 2
        return np.tile(across, (pattern.size_px, 1))
    cells = np.floor(place)
    return (cells[:, None] + cells[None, :]) % 2


def _noise(pattern: Pattern) -> np.ndarray:
    """Clouds [n, n] from 0 to 1: the lightest and darkest percent are cut off."""
    n = pattern.size_px
    white = np.random.Generator(np.random.Philox(pattern.seed)).standard_normal((n, n))
    frequency = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None, :])
    frequency[0, 0] = np.inf
    clouds = np.fft.irfft2(np.fft.rfft2(white) * frequency**-pattern.roughness, (n, n))
    low, high = np.percentile(clouds, [1, 99])
    return np.clip((clouds - low) / (high - low), 0, 1)
