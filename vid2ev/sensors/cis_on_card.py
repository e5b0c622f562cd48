"""CisOnCard: `Cis` on a GPU."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.kernels.cuda.row_values import Added, Read, Taken
from vid2ev.kernels.exposures import ReadOut
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_readout import Frozen
from vid2ev.sensors.cis_spec import CisSpec


class CisOnCard(Cis):
    """A frame camera as `Cis` is, with its rows on a device: the same exposures, the same state.

    memory    the device (`vid2ev.kernels.cuda.memory`)

    Light may be a tensor of torch, on the device or not.  Exposures are arrays of numpy.
    """

    def __init__(
        self,
        spec: CisSpec,
        size: tuple[int, int],
        seed: int = 0,
        *,
        memory: Any,
        camera: int = 0,
        linear: bool = False,
    ):
        super().__init__(spec, size, seed, camera=camera, linear=linear)
        shape, numbers, frozen = self._rows.shape, self._numbers, self._rows.frozen
        self._rows = RowsOnCard(memory, shape, numbers, frozen, colour=spec.colour, linear=linear)

    def _light(self, light: Any) -> Any:
        if not hasattr(light, "is_floating_point"):
            return super()._light(light)
        self._check(tuple(light.shape), light.dtype, light.is_floating_point())
        return light.reshape(self._rows.shape)


class RowsOnCard:
    """`Rows` on a device."""

    def __init__(
        self, memory: Any, shape: tuple[int, int], numbers: ReadOut, frozen: Frozen, *, colour: bool, linear: bool
    ):
        self.shape, self.frozen = shape, frozen
        self._memory, self._numbers, self._colour, self._linear = memory, numbers, colour, linear
        self._kernels = memory.module("vid2ev.kernels.cuda.exposures")
        self._planes = Frozen(*(memory.put(plane) for plane in frozen.padded()))
        self._mended = memory.zeros(1, np.int64)
        self.before, self.after = memory.zeros(shape, np.float32), memory.zeros(shape, np.float32)
        self._codes = memory.zeros(shape, np.uint16)
        self._light = memory.zeros(shape if linear else (1, 1), np.float32)

    @property
    def mended(self) -> int:
        return int(self._mended[0])

    @mended.setter
    def mended(self, count: int) -> None:
        self._mended[:] = count

    def sums(self) -> Any:
        return self._memory.zeros(self.shape, np.float64)

    def put(self, array: np.ndarray) -> Any:
        return self._memory.put(array)

    def get(self, rows: Any) -> np.ndarray:
        return self._memory.get(rows)  # type: ignore[no-any-return]

    def take(self, light: Any) -> None:
        taken = Taken(self._memory.light(light), self.after, self._mended)
        self._launch("take_values", taken, self._colour)

    def pass_on(self) -> None:
        self.before, self.after = self.after, self.before

    def add(self, total: Any, before: np.ndarray, after: np.ndarray) -> None:
        self._launch("add_values", Added(total, self.before, self.after, self.put(before), self.put(after)))

    def read(self, total: Any, index: int) -> tuple[np.ndarray, np.ndarray | None]:
        self._launch("read_values", Read(total, *self._planes, self._light, self._codes), index, self._numbers)
        total[:] = 0.0
        codes = self.get(self._codes).view(np.uint16)
        return codes, self.get(self._light) if self._linear else None

    def _launch(self, kernel: str, *arguments: Any) -> None:
        self._memory.launch(getattr(self._kernels, kernel), self.shape[0] * self.shape[1], *arguments)
