"""Pictures held as arrays: codes or light, grey or RGB, to luminance in linear light."""

from __future__ import annotations

import numpy as np

from vid2ev.sources.luminance import luminance_of_rgb
from vid2ev.sources.tags import BT709_WEIGHTS
from vid2ev.sources.transfer import code_table, parse_transfer

TYPES = "uint8, uint16 or floating point"


class PictureReader:
    """Turns arrays [H, W] or [H, W, 3 (red, green, blue)] to luminance with the weights of BT.709.

    uint8 and uint16 are full-range codes of `transfer`; floating point is the signal of `transfer`, 1.0 at
    full code, so that "linear" is light as it stands, with NaN and negative values left to the sensor, which
    counts them.
    """

    def __init__(self, transfer: str):
        self.transfer = transfer
        self._curve = parse_transfer(transfer)
        self._tables: dict[int, np.ndarray] = {}

    def light(self, picture: np.ndarray) -> np.ndarray:
        """Light [float32, H x W, new memory]."""
        if picture.dtype.kind == "f":
            return self._light_of_signal(picture)
        bits = 8 * picture.dtype.itemsize
        if bits not in self._tables:
            self._tables[bits] = code_table(self.transfer, bits)
        table = self._tables[bits]
        if picture.ndim == 2:
            return table[picture]
        height, width, _ = picture.shape
        channels = (picture[..., 0], picture[..., 1], picture[..., 2])
        return luminance_of_rgb(channels, (width, height), table, BT709_WEIGHTS)

    def _light_of_signal(self, picture: np.ndarray) -> np.ndarray:
        light = picture if self.transfer == "linear" else self._curve.to_light(picture)
        if light.ndim == 3:
            light = light @ np.asarray(BT709_WEIGHTS, light.dtype)
        return np.array(light, np.float32, order="C")
