"""What an event camera takes for light: frames of its size, linear light or codes that were promised to be such."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.light.transfer import code_table, parse_transfer


class Intake:
    """The light of sensors of `size` (width, height); `transfer` is what uint8 and uint16 are coded with, if at all.

    Raises UsageError for another.
    """

    def __init__(self, size: tuple[int, int], transfer: str | None):
        self.size, self.transfer = size, transfer
        if transfer is not None:
            parse_transfer(transfer)
        self._tables: dict[Any, np.ndarray] = {}

    def check(self, shape: tuple[int, ...]) -> None:
        """Raise UsageError for another shape than that of a frame."""
        width, height = self.size
        if shape != (height, width):
            raise UsageError(
                f"light of shape {tuple(shape)}: expected ({height}, {width}), rows and columns of this sensor"
            )

    def frames(self, light: Any) -> np.ndarray:
        """Frames of light as an array [frames, height, width]."""
        width, height = self.size
        try:
            light = np.asarray(light)
        except ValueError as error:  # (of NumPy, which takes a list of arrays of one shape)
            shapes = ", ".join(str(shape) for shape in sorted({np.shape(frame) for frame in light}))
            raise UsageError(f"frames of light of shapes {shapes}: expected ({height}, {width}) of each") from error
        if light.ndim != 3:
            raise UsageError(
                f"light of shape {light.shape}: expected (frames, {height}, {width}), rows and columns of this sensor"
            )
        self.check(light.shape[1:])
        return light

    def flat(self, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Light [..., height, width] as [frames, pixels], with the table of its codes; raises UsageError."""
        light = np.asarray(light)
        self.check(light.shape[-2:])
        pixels = self.size[0] * self.size[1]
        if light.dtype.kind == "f":
            with np.errstate(over="ignore"):  # (what is beyond float32 becomes infinite, and is mended)
                flat = np.require(light, np.float32, ["C", "A"])
            return flat.reshape(-1, pixels), np.empty(0, np.float32)
        codes = light.dtype.newbyteorder("=")
        if codes not in (np.uint8, np.uint16) or self.transfer is None:
            raise UsageError(
                f"light of type {light.dtype}: expected floating point (linear light), or uint8 or uint16 with"
                " transfer='srgb', 'bt709', 'gamma:2.2' or 'linear'"
            )
        if codes not in self._tables:
            self._tables[codes] = _table(self.transfer, 8 * codes.itemsize)
        return np.require(light, codes, ["C", "A"]).reshape(-1, pixels), self._tables[codes]


def _table(transfer: str, bits: int) -> np.ndarray:
    if transfer == "linear":
        return np.array([1.0 / ((1 << bits) - 1)], np.float32)  # one entry: a product is faster than a look-up
    return code_table(transfer, bits)
