"""Pictures held as arrays: codes or light, grey or RGB, to linear light."""

from __future__ import annotations

import numpy as np

from vid2ev.light.colour import rgb_of_rgb
from vid2ev.light.luminance import luminance_of_rgb
from vid2ev.light.primaries import BT709, Primaries, primaries_of
from vid2ev.light.transfer import code_table, parse_transfer
from vid2ev.stream.frames import Colour

TYPES = "uint8, uint16 or floating point"


class PictureReader:
    """Turns arrays [H, W] or [H, W, 3 (red, green, blue)] to luminance, or to RGB of BT.709.

    uint8 and uint16 are full-range codes of `transfer`; floating point is the signal of `transfer`, 1.0 at
    full code, so that "linear" is light as it stands, with NaN and negative values left to the sensor, which
    counts them.
    """

    def __init__(self, transfer: str, colour: Colour = "luminance"):
        self.transfer, self.colour = transfer, colour
        self._curve = parse_transfer(transfer)
        self._tables: dict[int, np.ndarray] = {}

    def light(self, picture: np.ndarray, primaries: Primaries | None = None) -> np.ndarray:
        """Light [float32, H x W or H x W x 3, new memory]; the primaries are those of BT.709 if not given."""
        weights, to_bt709 = primaries or primaries_of(BT709)
        if picture.dtype.kind == "f":
            return self._light_of_signal(picture, weights, to_bt709)
        bits = 8 * picture.dtype.itemsize
        if bits not in self._tables:
            self._tables[bits] = code_table(self.transfer, bits)
        table = self._tables[bits]
        if picture.ndim == 2:
            return self._grey(table[picture])
        picture = picture.astype(picture.dtype.newbyteorder("="), copy=False)  # (the kernels take no other)
        height, width, _ = picture.shape
        channels = (picture[..., 0], picture[..., 1], picture[..., 2])
        if self.colour == "rgb":
            return rgb_of_rgb(channels, (width, height), table, to_bt709)
        return luminance_of_rgb(channels, (width, height), table, weights)

    def _light_of_signal(self, picture: np.ndarray, weights: object, to_bt709: np.ndarray) -> np.ndarray:
        light = picture if self.transfer == "linear" else self._curve.to_light(picture)
        light = light if light.dtype.itemsize > 2 else light.astype(np.float32)  # (half floats would round the sum)
        with np.errstate(over="ignore", invalid="ignore"):  # (infinite light is counted, too)
            if light.ndim == 2:
                return self._grey(np.array(light, np.float32, order="C"))
            mix = np.asarray(weights if self.colour == "luminance" else to_bt709.T, light.dtype)
            return np.array(light @ mix, np.float32, order="C")

    def _grey(self, light: np.ndarray) -> np.ndarray:
        return light if self.colour == "luminance" else np.repeat(light[..., None], 3, axis=-1)
