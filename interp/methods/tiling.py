"""Large frames in tiles that overlap, so that memory is bounded whatever the size of the frames.

    a tile begins at a whole multiple of what its network takes: all it computes lies on the same grid as in the whole
    w(d) = s((d / overlap - 1/4) / (1/2)),  s(u) = u^2 (3 - 2 u), u within 0 ... 1

d [px] is how far a pixel lies within the overlap; the tile that begins there weighs w, the one that ends 1 - w.  The
outer quarter of each tile's overlap, of which a network sees least around, does not count at all.  What sees so many
pixels around it and no more, as closed forms do, needs no weights: cells lie side by side, each made with a halo.

What a tile cannot know by itself is found in the whole frames before: see `interp.networks.around`.

Frames of up to `WHOLE_PX` pixels are not divided unless asked for, larger ones into tiles of about as many.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Any

import torch

from interp.candidates.guided import SEES_PX
from interp.methods.gap import Gap, Method
from interp.representation.carried import footprint_over, over
from vid2ev.errors import UsageError

WHOLE_PX = 1 << 20
SIDE = 1024  # px of tiles, unless asked for
OVERLAP = 128  # px
LEAST = 64  # px
STRIP_PX = 1 << 20  # (in smaller ones threads wait for each other)


@dataclass(frozen=True, slots=True)
class Tile:
    """A part of the frames [px]: from left and top up to, not including, right and bottom."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def within(self) -> tuple[slice, slice]:
        """Its rows and columns."""
        return self.within_coarser(1)

    def within_coarser(self, k: int) -> tuple[slice, slice]:
        """Its rows and columns where k x k pixels are one."""
        return slice(self.top // k, self.bottom // k), slice(self.left // k, self.right // k)

    def part_of(self, state: torch.Tensor, height: int) -> torch.Tensor:
        """The part of [..., h / k, w / k] in it, of frames of this height [px]."""
        return state[(..., *self.within_coarser(height // state.shape[-2]))]


@dataclass(frozen=True, slots=True)
class Tiling:
    """How frames of a size are divided.

    across, down   where tiles begin and end on each axis
    """

    across: tuple[tuple[int, int], ...]
    down: tuple[tuple[int, int], ...]

    def __len__(self) -> int:
        return len(self.across) * len(self.down)

    def __iter__(self) -> Iterator[Tile]:
        return (Tile(left, top, right, bottom) for top, bottom in self.down for left, right in self.across)

    def weights(self, tile: Tile) -> torch.Tensor:
        """How much each of a tile's pixels counts, [h, w]; those of all tiles add up to 1."""
        rows = _weights(self.down, (tile.top, tile.bottom))
        return rows[:, None] * _weights(self.across, (tile.left, tile.right))

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of the frames [px]."""
        return self.down[-1][1], self.across[-1][1]

    def continued(self, width: int, height: int) -> Tiling:
        """The same of frames that go on to the right and below: so do the last tiles."""
        return Tiling((*self.across[:-1], (self.across[-1][0], width)), (*self.down[:-1], (self.down[-1][0], height)))

    def cells(self, law: Callable[[Tile], torch.Tensor], halo_px: int = 0) -> torch.Tensor:
        """What `law` makes of tiles [..., h, w], side by side [..., H, W]; of each the halo is cut away."""
        (whole,) = self.all_cells(lambda tile: (law(tile),), halo_px)
        return whole

    def all_cells(self, law: Callable[[Tile], Sequence[torch.Tensor]], halo_px: int = 0) -> tuple[torch.Tensor, ...]:
        """The same of all that `law` makes of a tile, [..., h / k, w / k] with a k of its own each.

        The halo, half of overlaps, and where tiles begin and end, are whole multiples of each k.
        """
        (height, width), wholes = self.size, list[torch.Tensor]()
        for top, bottom in _side_by_side(self.down):
            for left, right in _side_by_side(self.across):
                wide = Tile(
                    max(left - halo_px, 0),
                    max(top - halo_px, 0),
                    min(right + halo_px, width),
                    min(bottom + halo_px, height),
                )
                own = Tile(left, top, right, bottom)
                inner = Tile(left - wide.left, top - wide.top, right - wide.left, bottom - wide.top)
                for n, made in enumerate(law(wide)):
                    k = (wide.bottom - wide.top) // made.shape[-2]
                    if n == len(wholes):
                        wholes.append(made.new_empty(*made.shape[:-2], height // k, width // k))
                    wholes[n][(..., *own.within_coarser(k))] = made[(..., *inner.within_coarser(k))]
        return tuple(wholes)

    def describe(self) -> str:
        """For people, and for JSON."""
        if len(self) == 1:
            return "none"
        width, height = (max(stop - start for start, stop in axis) for axis in (self.across, self.down))
        return f"{len(self)} tiles of {width}x{height}"


def undivided(width: int, height: int) -> Tiling:
    """The tiling of frames into one tile."""
    return Tiling(((0, width),), ((0, height),))


def strips(width: int, height: int) -> Tiling:
    """The tiling of frames for what looks at single pixels: rows side by side."""
    rows = max(1, STRIP_PX // width)
    return Tiling(((0, width),), tuple((top, min(top + rows, height)) for top in range(0, height, rows)))


def parse_tiling(text: str, size: tuple[int, int], multiple: int, sees_px: int = 0) -> Tiling:
    """The tiling of frames of a size (width, height): none, auto, or WxH; tiles begin at whole multiples.

    sees_px   what a pixel must have around it: a quarter of overlaps, if that is not more than half a tile

    Raises UsageError for a text that says none of these, or for tiles smaller than `LEAST`.
    """
    if text == "none" or (text == "auto" and size[0] * size[1] <= WHOLE_PX):
        return undivided(*size)
    asked = re.fullmatch(r"(\d{1,9})x(\d{1,9})", str(text))
    sides = (SIDE, SIDE) if text == "auto" else tuple(map(int, asked.groups())) if asked else (0, 0)
    if min(sides) < LEAST:
        raise UsageError(f"tile '{text}': expected none, auto, or WIDTHxHEIGHT of at least {LEAST}, such as 512x512")
    across, down = (_parts(length, side, multiple, sees_px) for length, side in zip(size, sides, strict=True))
    return Tiling(across, down)


def tiling_of(method: Method, size: tuple[int, int], tile: str = "auto", footprint: int = 1) -> Tiling:
    """The tiling that a method takes of frames of a size (width, height); see `parse_tiling`.

    footprint   pixels across of the frames that a pixel of the event camera looks at
    """
    network: Any = getattr(method, "network", None)
    if network is None:
        return parse_tiling(tile, size, 2)
    guided = getattr(network.spec, "guided", False)
    return parse_tiling(tile, size, network.multiple, SEES_PX * footprint * guided)


def tiling_for(method: Method, gap: Gap, tile: str = "auto") -> Tiling:
    """The tiling that a method takes of the frames of a gap; see `tiling_of`."""
    height, width = gap.frame_0.shape[-2:]
    footprint = 1 if gap.events is None else footprint_over(gap.events, (height, width))
    return tiling_of(method, (width, height), tile, footprint)


def part(gap: Gap, tile: Tile) -> Gap:
    """The part of a gap in a tile; events of another resolution are laid over the frames first."""
    frames = [frame[(..., *tile.within)] for frame in (gap.frame_0, gap.frame_1)]
    height, width = gap.frame_0.shape[-2:]
    events = None if gap.events is None else over(gap.events, (height, width), tile.within)
    return replace(gap, frame_0=frames[0], frame_1=frames[1], events=events)


def _parts(length: int, side: int, multiple: int, sees_px: int) -> tuple[tuple[int, int], ...]:
    """Where tiles of about a side begin and end on an axis."""
    overlap = _up(max(min(OVERLAP, side // 4), min(4 * sees_px, side // 2)), multiple)
    if length <= max(side, overlap):
        return ((0, length),)
    count = ceil((length - overlap) / max(side - overlap, multiple))
    step = _up(ceil((length - overlap) / count), multiple)
    starts = range(0, length - overlap, step)
    return tuple((start, min(start + step + overlap, length)) for start in starts)


def _side_by_side(parts: tuple[tuple[int, int], ...]) -> list[tuple[int, int]]:
    """Where the cells of an axis begin and end: in the middle of the overlaps."""
    inner = [(start + before_stop) // 2 for (_, before_stop), (start, _) in pairwise(parts)]
    return list(pairwise([0, *inner, parts[-1][1]]))


def _weights(parts: tuple[tuple[int, int], ...], own: tuple[int, int]) -> torch.Tensor:
    at = parts.index(own)
    weights = torch.ones(own[1] - own[0])
    if at > 0:
        rising = _ramp(parts[at - 1][1] - own[0])
        weights[: len(rising)] = rising
    if at + 1 < len(parts):
        falling = 1 - _ramp(own[1] - parts[at + 1][0])
        weights[len(weights) - len(falling) :] = falling
    return weights


def _ramp(overlap: int) -> torch.Tensor:
    u = (2 * ((torch.arange(overlap) + 0.5) / overlap - 0.25)).clamp(0, 1)
    return u * u * (3 - 2 * u)


def _up(value: int, multiple: int) -> int:
    return -(-value // multiple) * multiple
