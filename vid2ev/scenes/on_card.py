"""Pictures of worlds on a GPU, several at a time, by the text of `render`: the same bits in the simulator.

On a card, what is not rounded alike everywhere (angles, powers) may differ in the last bits of a float64.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np

from vid2ev.kernels.cuda.build import Build
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.lens import bent_tensor, pixel_grid
from vid2ev.scenes.flow import Flow, flow_to
from vid2ev.scenes.lens import rays_of_pixels
from vid2ev.scenes.rays.cuda.easel import STILL, Carried, Easel, Listed, Measured
from vid2ev.scenes.rays.layout import World
from vid2ev.scenes.rays.tiles import TILE
from vid2ev.scenes.render import Picture, cells_of, tiles_of

AT_A_TIME = 16  # pictures
PIXELS = 1 << 24  # of all that are painted together, half a gigabyte: of large ones, fewer
MEASURED = 1 << 26  # numbers of pixels that are measured together, half a gigabyte
LISTS = 1 << 25  # numbers of things in the lists of all tiles, a quarter of a gigabyte: of many things, fewer pictures
CARD, BUILT_ANEW = {"vid2ev.scenes.rays.compiler": "vid2ev.scenes.rays.cuda.device_compiler"}, ("vid2ev.scenes.rays",)
SIMULATED = {"vid2ev.kernels.cuda.machine": "vid2ev.kernels.cuda.simulated_machine"}


class WorldsOnCard:
    """The numbers of worlds on a device; what stays the same from one to the next is uploaded once."""

    def __init__(self, memory: Any):
        self._memory = memory
        self._still: dict[str, tuple[np.ndarray, Any]] = {}

    def put(self, worlds: Sequence[World]) -> World:
        """All of them, as `easel.world_of` takes them."""
        still = {name: self._kept(name, getattr(worlds[0], name)) for name in STILL}
        moving = {name: np.stack([getattr(one, name) for one in worlds]) for name in World._fields if name not in STILL}
        return World(**still, **self._together(moving))

    def _kept(self, name: str, array: np.ndarray) -> Any:
        host, there = self._still.get(name, (None, None))
        if host is not array:
            there = self._memory.put(array)
            self._still[name] = array, there
        return there

    def _together(self, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
        """Arrays on the device, those of a type in one transfer."""
        placed: dict[str, Any] = {}
        for dtype in (np.int64, np.float64):
            ours = {name: array for name, array in arrays.items() if array.dtype == dtype}
            flat, first = self._memory.put(np.concatenate([array.reshape(-1) for array in ours.values()])), 0
            for name, array in ours.items():
                placed[name] = flat[first : first + array.size].reshape(array.shape)
                first += array.size
        return placed


class PainterOnCard:
    """Paints what a camera sees, on a device (`vid2ev.kernels.cuda.memory`).

    samples  as of `render`
    """

    def __init__(self, memory: Any, intrinsics: Intrinsics, samples: int):
        self._memory, self._intrinsics, self._size, self._samples = memory, intrinsics, intrinsics.size, samples
        self._kernels = _kernels(memory.name)
        self._worlds, self._rays = WorldsOnCard(memory), memory.put(rays_of_pixels(intrinsics))

    def at_a_time(self, things: int) -> int:
        """How many pictures of so many things are painted at a time."""
        (width, height), (down, across) = self._size, tiles_of(self._size)
        return max(1, min(AT_A_TIME, PIXELS // (width * height), LISTS // max(1, down * across * things)))

    def paint(self, worlds: Sequence[World], details: Sequence[np.ndarray]) -> list[Picture]:
        """The pictures of some worlds, with their `places_of_details`, as arrays of the device.

        The worlds have as many things and lamps each, and the same textures and meshes.
        """
        count = len(worlds)
        easel, listed = self._easel(details), self._lists(count, len(worlds[0].kind))
        there, tiles = self._worlds.put(worlds), len(worlds) * tiles_of(self._size)[0] * tiles_of(self._size)[1]
        kernels, pixels = self._kernels, tiles * TILE * TILE
        self._memory.launch(kernels.listing, tiles, there, easel, listed)
        self._memory.launch(kernels.trace, pixels, there, easel, listed)
        if self._samples > 1:
            self._memory.launch(kernels.mixing, pixels, there, easel, listed)
            mixed, (usual, fine) = listed.mixed[: self._count(listed.total, 0)], cells_of(self._samples)
            for finer in self._smooth(mixed, usual, usual == fine, there, easel, listed):
                for _ in self._smooth(finer, fine, True, there, easel, listed):
                    pass
        return [Picture(easel.light[k], easel.depth[k, 1:-1, 1:-1], easel.thing[k]) for k in range(count)]

    def _smooth(
        self, pixels: Any, cells: int, finest: bool, there: World, easel: Easel, listed: Listed
    ) -> Iterator[Any]:
        """Smooth pixels in which things meet, some at a time; gives those of them that are to be cut finer."""
        corners, sides, kernels = (cells + 1) ** 2, 2 * cells * (cells + 1), self._kernels
        at_once = max(1, MEASURED // (2 * corners + 2 * sides + 3 * cells**2))
        for first in range(0, len(pixels), at_once):
            measured = self._measured(easel, listed, pixels[first : first + at_once], cells, finest)
            n, given = len(measured.pixels), (there, measured)
            self._memory.launch(kernels.corner, n * corners, *given)
            self._memory.launch(kernels.part, n, *given)
            self._memory.launch(kernels.change, self._count(measured.totals, 0), *given)
            self._memory.launch(kernels.middle, self._count(measured.totals, 1), *given)
            self._memory.launch(kernels.mix, n, *given)
            yield measured.finer[: 0 if finest else self._count(measured.totals, 2)]

    def flow(self, picture: Picture, then: World, motions: np.ndarray) -> Flow:
        """Where the points of one of these pictures are in a world at another instant, after `flow.motions_between`.

        Tensors of torch, on the device.
        """
        import torch

        (width, height), memory = self._size, self._memory
        plane, seen = memory.zeros((height, width, 2), np.float64), memory.zeros((height, width), np.uint8)
        carried = Carried(self._rays, memory.light(picture.depth), picture.thing, memory.put(motions), plane, seen)
        memory.launch(self._kernels.carry, width * height, self._worlds.put([then]), carried)
        there = bent_tensor(torch.as_tensor(plane), self._intrinsics)
        grid = torch.as_tensor(pixel_grid(self._size)).to(there)
        return flow_to(there, torch.as_tensor(seen), grid)

    def _easel(self, details: Sequence[np.ndarray]) -> Easel:
        """What as many pictures are painted on, their details marked."""
        (width, height), count, zeros = self._size, len(details), self._memory.zeros
        large = count, height + 2, width + 2
        easel = Easel(
            self._rays, zeros((count, height, width, 3), np.float32), zeros(large, np.float32),
            zeros((count, height, width), np.int32), zeros(large, np.int64), zeros(large, np.uint8),
        )  # fmt: skip
        rows = [large[2] * (large[1] * k + spots[:, 1]) + spots[:, 0] for k, spots in enumerate(details)]
        easel.details.reshape(-1)[self._memory.put(np.concatenate(rows))] = 1
        return easel

    def _measured(self, easel: Easel, listed: Listed, pixels: Any, cells: int, finest: bool) -> Measured:
        zeros, n, sides, f64, i64 = self._memory.zeros, len(pixels), 2 * cells * (cells + 1), np.float64, np.int64
        corners = n, cells + 1, cells + 1
        return Measured(
            easel.rays, easel.light, easel.details, listed.things, listed.counts, pixels, int(finest),
            zeros(corners, i64), zeros((n, cells + 1, cells), f64), zeros((n, cells, cells + 1), f64),
            zeros((n, cells, cells, 2), f64), zeros(corners, f64), zeros(n, f64) + math.inf, zeros(n, i64),
            zeros(n * (sides + cells**2), i64), zeros(n, i64), zeros(3, i64),
        )  # fmt: skip

    def _count(self, totals: Any, place: int) -> int:
        return int(self._memory.get(totals)[place])

    def _lists(self, count: int, things: int) -> Listed:
        (width, height), (down, across), zeros = self._size, tiles_of(self._size), self._memory.zeros
        return Listed(
            zeros((count, down * across, max(things, 1)), np.int64), zeros((count, down * across), np.int64),
            zeros(count * width * height, np.int64), zeros(1, np.int64),
        )  # fmt: skip


@cache
def _kernels(kind: str) -> Any:
    """The kernels of a kind of memory; a simulated GPU calls the laws as they are compiled for a CPU."""
    build = Build(SIMULATED, ()) if kind == "simulated" else Build(CARD, BUILT_ANEW)
    return build.module("vid2ev.scenes.rays.cuda.kernels").all_kernels()
