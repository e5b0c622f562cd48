"""Crop and size of the pictures of a source.

    crop   WxH+X+Y: the part of W x H pixels whose upper left corner is at column X, row Y;  WxH: the one in the middle
    size   W: that wide, as high as the shape asks;  WxH: the largest part in the middle that has this shape, made
           this large;  WxH!: all of it, stretched to this size

The crop comes first.  What happens to the light is in `resample.py`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.light.resample import Taps, resampled, taps_of
from vid2ev.rig.depth import between
from vid2ev.rig.intrinsics import Framing
from vid2ev.sources.edit import Edit
from vid2ev.stream.frames import Frame

if TYPE_CHECKING:
    from vid2ev.sources.source import Source

LARGEST = 1 << 15  # pixels along a side


class Box(NamedTuple):
    """A part of a picture: its upper left corner, its width and height [px]."""

    x: Fraction
    y: Fraction
    width: Fraction
    height: Fraction


def crop_box(text: str, size: tuple[int, int]) -> Box:
    """The part that a crop means in a picture of `size`.  Raises UsageError."""
    found = re.fullmatch(r"(\d{1,9})x(\d{1,9})(?:\+(\d{1,9})\+(\d{1,9}))?", str(text))
    if not found:
        raise UsageError(
            f"crop '{text}': expected WIDTHxHEIGHT+X+Y, or WIDTHxHEIGHT for the middle, such as 640x480+0+60"
        )
    width, height = int(found[1]), int(found[2])
    x, y = (size[0] - width) // 2, (size[1] - height) // 2
    if found[3] is not None:
        x, y = int(found[3]), int(found[4])
    if min(width, height) < 1 or min(x, y) < 0 or x + width > size[0] or y + height > size[1]:
        raise UsageError(f"crop '{text}': expected a part of the picture, which has {size[0]}x{size[1]} pixels")
    return Box(Fraction(x), Fraction(y), Fraction(width), Fraction(height))


def parse_size(size: str | Sequence[int], shape: tuple[int, int]) -> tuple[int, int, bool]:
    """Width, height and whether to stretch, of a size for pictures of the shape (width, height).  Raises UsageError."""
    text = "x".join(map(str, size)) if np.ndim(size) else str(size)
    found = re.fullmatch(r"(\d{1,9})(?:x(\d{1,9})(!)?)?", text)
    if not found:
        raise UsageError(f"size '{text}': expected WIDTH, WIDTHxHEIGHT or WIDTHxHEIGHT!, such as 346x260")
    width = int(found[1])
    height = int(found[2]) if found[2] else max(1, round(Fraction(width * shape[1], shape[0])))
    if not (1 <= width <= LARGEST and 1 <= height <= LARGEST):
        raise UsageError(f"size '{text}': {width}x{height} pixels; expected 1 to {LARGEST} along each side")
    return width, height, bool(found[3])


def of_shape(box: Box, shape: tuple[int, int]) -> Box:
    """The largest part in the middle of a box that has the shape of (width, height)."""
    width = min(box.width, box.height * shape[0] / shape[1])
    height = min(box.height, box.width * shape[1] / shape[0])
    return Box(box.x + (box.width - width) / 2, box.y + (box.height - height) / 2, width, height)


class Framed(Edit):
    """A source whose pictures are cropped, then brought to a size.  Raises UsageError."""

    def __init__(self, source: Source, crop: str | None, size: str | Sequence[int] | None):
        super().__init__(source)
        whole = (source.size[0], source.size[1])
        self._box, self._size = _part(whole, crop, size)
        self._taps: tuple[Taps, Taps] | None = None
        if (self._box.width, self._box.height) != self._size:
            rows = taps_of(whole[1], self._box.y, self._box.height, self._size[1])
            self._taps = rows, taps_of(whole[0], self._box.x, self._box.width, self._size[0])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self._size

    @property
    def framing(self) -> Framing:
        """The part of the source's pictures that is taken."""
        return _framing((self.source.size[0], self.source.size[1]), self._box, self._size)

    def edits(self) -> dict[str, Any]:
        """The part taken [px: x, y, width, height], and the size it is brought to."""
        return {"part": [float(side) for side in self._box], "resized": self._taps is not None}

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        for frame in self.source.frames(start):
            depth = None if frame.depth is None else self._depth_framed(frame.depth)
            yield replace(frame, light=self._framed(frame.light), depth=depth)

    def _framed(self, light: np.ndarray) -> np.ndarray:
        return self._cropped(light) if self._taps is None else resampled(light, *self._taps)

    def _depth_framed(self, depth_m: np.ndarray) -> np.ndarray:
        """Depth at the centres of the pixels, straight in 1 / Z on a surface, as planes are; of near and far it is one:
        in their mean there would be nothing."""
        if self._taps is None:
            return self._cropped(depth_m)
        above, share = _centres(self._box.y, self._box.height, self._size[1], depth_m.shape[0])
        rows = between(depth_m[above], depth_m[np.minimum(above + 1, depth_m.shape[0] - 1)], share[:, None])
        left, share = _centres(self._box.x, self._box.width, self._size[0], depth_m.shape[1])
        return between(rows[:, left], rows[:, np.minimum(left + 1, depth_m.shape[1] - 1)], share)

    def _cropped(self, pixels: np.ndarray) -> np.ndarray:
        x, y, width, height = map(int, self._box)
        return np.ascontiguousarray(pixels[y : y + height, x : x + width])


def framing_for(whole: tuple[int, int], crop: str | None, size: str | Sequence[int] | None) -> Framing:
    """How pictures of the size `whole` would be framed.  Raises UsageError."""
    return _framing(whole, *_part(whole, crop, size))


def framing_of(source: Source) -> Framing | None:
    """How the pictures of a source are framed; None if they are whole."""
    return source.framing if isinstance(source, Framed) else None


def _part(whole: tuple[int, int], crop: str | None, size: str | Sequence[int] | None) -> tuple[Box, tuple[int, int]]:
    """The part that is taken of pictures, and the size that it is brought to [px]."""
    box = crop_box(crop, whole) if crop is not None else Box(Fraction(0), Fraction(0), *map(Fraction, whole))
    own = int(box.width), int(box.height)
    if size is None:
        return box, own
    width, height, stretched = parse_size(size, own)
    box = box if stretched else of_shape(box, (width, height))
    if (box.width, box.height) == (width, height):  # (whole pixels stay as they are)
        box = Box(*(Fraction(math.floor(side)) for side in box))
    return box, (width, height)


def _framing(whole: tuple[int, int], box: Box, size: tuple[int, int]) -> Framing:
    x, y, width, height = map(float, box)
    return Framing(whole, (x, y), (width, height), size)


def _centres(begin: Fraction, extent: Fraction, outputs: int, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the centres of output pixels are among those of an axis of `length` pixels: the one before [int64], and the
    share of the way to the next [float32]."""
    places = [begin + (2 * i + 1) * extent / (2 * outputs) - Fraction(1, 2) for i in range(outputs)]
    within = [min(max(place, Fraction(0)), Fraction(length - 1)) for place in places]
    before = [math.floor(place) for place in within]
    shares = [float(place - below) for place, below in zip(within, before, strict=True)]
    return np.array(before, np.int64), np.array(shares, np.float32)
