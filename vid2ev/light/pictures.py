"""Pictures held as arrays: codes or light, grey or RGB, to linear light."""

from __future__ import annotations

from typing import Any

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.light.colour import rgb_of_rgb
from vid2ev.light.luminance import luminance_of_rgb
from vid2ev.light.primaries import BT709, Primaries, primaries_of
from vid2ev.light.transfer import KNOWN, parse_transfer
from vid2ev.stream.frames import Colour

TYPES = "uint8, uint16 or floating point"
UNIT = "bit"  # of `linear:10bit`
MOST = 16  # bits of codes
IDENTITY = np.eye(3)
SENSORS = 12  # bits of sensors whose codes are stored as they are, at the most; 10 of many
OF_CODES = f"{KNOWN}; or linear:10bit, of codes that do not fill 16 bits"


class PictureReader:
    """Turns arrays [H, W] or [H, W, 3 (red, green, blue)] to luminance, or to RGB of BT.709.

    uint8 and uint16 are full-range codes of `transfer`; floating point is the signal of `transfer`, 1.0 at
    full code, so that "linear" is light as it stands, with NaN and negative values left to the sensor, which
    counts them.

    transfer  a name of `parse_transfer`, with the bits of codes that do not fill 16 behind it: `linear:10bit`
    white     the code that is white, where `transfer` does not say it; None for the largest that 8 or 16 bits hold
    Raises UsageError for either that cannot be meant.
    """

    def __init__(self, transfer: str, colour: Colour = "luminance", white: int | None = None):
        self.transfer, bits = with_bits(transfer)
        self.white, self.colour = white_of(bits) if bits else white, colour
        self._curve = parse_transfer(self.transfer, f"auto, {OF_CODES}")
        self._tables: dict[int, np.ndarray] = {}

    def light(self, picture: np.ndarray, primaries: Primaries | None = None) -> np.ndarray:
        """Light [float32, H x W or H x W x 3, new memory]; the primaries are those of BT.709 if not given."""
        weights, to_bt709 = primaries or primaries_of(BT709)
        if picture.dtype.kind == "f":
            return self._light_of_signal(picture, weights, to_bt709)
        table = self._table(8 * picture.dtype.itemsize)
        if picture.ndim == 2:
            return self._grey(table[picture])
        picture = picture.astype(picture.dtype.newbyteorder("="), copy=False)  # (the kernels take no other)
        height, width, _ = picture.shape
        channels = (picture[..., 0], picture[..., 1], picture[..., 2])
        if self.colour == "rgb":
            return rgb_of_rgb(channels, (width, height), table, to_bt709)
        return luminance_of_rgb(channels, (width, height), table, weights)

    def about(self) -> dict[str, Any]:
        """The curve, and of how many bits codes are that do not fill theirs, and which is white, if that is not their
        largest, for JSON."""
        if not self.white:
            return {"transfer": self.transfer}
        bits = self.white.bit_length()
        white = {"white": self.white} if self.white < white_of(bits) else {}
        return {"transfer": self.transfer, "bits": bits, **white}

    def remarks_on(self, first: np.ndarray) -> list[str]:
        """That 16-bit codes look like those of a sensor of fewer bits, where nobody has said that they are.

        Raises UsageError for pixels that are not of so many bits as somebody has said."""
        kind, bits = first.dtype, (self.white or 0).bit_length()
        if bits and (kind.kind == "f" or bits > 8 * kind.itemsize):
            raise UsageError(f"{bits} bits of {kind} pixels: expected uint16; leave ':{bits}{UNIT}' out")
        most = 0 if bits or kind.kind == "f" else int(first.max(initial=0))
        if not 2**8 <= most < 2**SENSORS:
            return []
        return [
            f"16-bit codes, but none of the first picture's is above {most}: if they are those of a sensor of 10 or"
            f" {SENSORS} bits, light comes out too dark; --transfer linear:10{UNIT} or linear:{SENSORS}{UNIT} says so"
        ]

    def _table(self, held: int) -> np.ndarray:
        """Light [float32] of each code that so many bits hold; those above the full one go on as the curve does."""
        if held not in self._tables:
            full = self.white or white_of(held)
            self._tables[held] = self._curve.to_light(np.arange(2**held) / full).astype(np.float32)
        return self._tables[held]

    def _light_of_signal(self, picture: np.ndarray, weights: object, to_bt709: np.ndarray) -> np.ndarray:
        light = picture if self.transfer == "linear" else self._curve.to_light(picture)
        light = light if light.dtype.itemsize > 2 else light.astype(np.float32)  # (half floats would round the sum)
        with np.errstate(over="ignore", invalid="ignore"):  # (infinite light is counted, too)
            if light.ndim == 2:
                return self._grey(np.array(light, np.float32, order="C"))
            if self.colour == "rgb" and np.array_equal(to_bt709, IDENTITY):
                return np.array(light, np.float32, order="C")
            mix = np.asarray(weights if self.colour == "luminance" else to_bt709.T, light.dtype)
            mixed = np.array(light @ mix, np.float32, order="C")
        if self.colour == "rgb":  # (of which infinite - infinite and infinite x 0 would be no number)
            endless = np.isposinf(light).any(axis=-1)
            mixed[endless] = light[endless]
        return mixed

    def _grey(self, light: np.ndarray) -> np.ndarray:
        return light if self.colour == "luminance" else np.repeat(light[..., None], 3, axis=-1)


def with_bits(transfer: str) -> tuple[str, int | None]:
    """A curve's name, and the bits of codes that stand behind it, as in `linear:10bit`.  Raises UsageError."""
    name, colon, said = str(transfer).rpartition(":")
    if not colon or not said.endswith(UNIT):
        return transfer, None
    number = said.removesuffix(UNIT)
    try:
        return name, bits_of(int(number) if number.isdecimal() else number)
    except ValueError:
        raise UsageError(f"transfer '{transfer}': expected 1 to {MOST} bits, such as linear:10{UNIT}") from None


def white_of(bits: int) -> int:
    """The largest code of so many bits."""
    return int(2**bits) - 1


def bits_of(number: object) -> int:
    """Bits that codes can be of.  Raises ValueError."""
    if type(number) is not int or not 1 <= number <= MOST:
        raise ValueError(f"codes of {number!r} bits")
    return number
