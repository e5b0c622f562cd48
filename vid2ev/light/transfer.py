"""Transfer curves: codes <-> linear light.

A file stores codes; a code stands for a signal V, and that for light L; both are 1.0 at full code (diffuse white):

    full range      V = code / (2**bits - 1)
    limited range   V = (code / 2**(bits - 8) - 16) / 219

    linear     L = V
    srgb       L = V / 12.92                     V <= 0.04045
               L = ((V + 0.055) / 1.055)**2.4    above
    bt709      L = V / 4.5                       V <= 4.5 b
               L = ((V + a - 1) / a)**(1/0.45)   above
    smpte240m  like bt709, with 4 for 4.5 and constants of its own
    st428      L = 52.37/48 V**2.6
    gamma:G    L = V**G

PQ, HLG and the logarithmic curves are in `hdr.py`.

`bt709` is the inverse of the camera's curve (OETF), not the curve of a display (BT.1886): an event camera looks at the
scene, not at a screen.  Its constants a and b are the exact ones, for which the curve and its slope are continuous;
the three-digit ones of BT.709 itself (1.099, 0.018) leave a step, by which a brighter code could be darker light.
The same curve serves BT.601 and BT.2020 (10 and 12 bit).  `st428` is that of digital cinema.

Signals and light below 0 count as 0; above 1 the curves go on.  NaN stays NaN.

Sources: sRGB, IEC 61966-2-1:1999; BT.709, Rec. ITU-R BT.709-6 item 1.2, with the constants of Rec. ITU-T H.273 table 3,
value 1; SMPTE 240M and ST 428, the same table, values 7 and 17; ranges, Rec. ITU-T H.273 section 8.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vid2ev.errors import UsageError, nearest
from vid2ev.light import hdr
from vid2ev.light.hdr import Curve
from vid2ev.requests import number_of

KNOWN = "srgb, bt709, linear, pq, hlg, smpte240m, st428, log100, log316 or gamma:G (such as gamma:2.2)"
STEEPEST_GAMMA = 10.0

SRGB_KNEE, SRGB_SLOPE, SRGB_OFFSET, SRGB_POWER = 0.04045, 12.92, 0.055, 2.4
BT709_ALPHA, BT709_BETA, BT709_SLOPE, BT709_POWER = 1.09929682680944, 0.018053968510807, 4.5, 0.45
SMPTE240M_ALPHA, SMPTE240M_BETA, SMPTE240M_SLOPE = 1.11157219592173, 0.022821585529445, 4.0
ST428_PEAK, ST428_POWER = 52.37 / 48, 2.6


@dataclass(frozen=True, slots=True)
class Transfer:
    """A curve in closed form, both ways; arrays of any shape, computed and returned in float64."""

    name: str
    to_light: Curve
    to_signal: Curve


def parse_transfer(name: str, known: str = KNOWN) -> Transfer:
    """The curve of a name: one of `CURVES`, or `gamma:G` with 0.1 <= G <= 10.  Raises UsageError for others; who takes
    other words as well says what is `known`."""
    if name in CURVES:
        return Transfer(name, *CURVES[name])
    if str(name).startswith("gamma:"):
        gamma = _gamma(name)
        return Transfer(
            name,
            lambda signal: _not_negative(signal) ** gamma,
            lambda light: _not_negative(light) ** (1 / gamma),
        )
    raise UsageError(f"transfer '{name}'{nearest(str(name).lower(), CURVES)}: expected {known}")


def signal_of_codes(codes: np.ndarray, bits: int, full_range: bool = True) -> np.ndarray:
    """Signal V [float64] of integer codes of a luma or RGB channel with `bits` bits."""
    if full_range:
        return np.asarray(codes, np.float64) / (2**bits - 1)
    return (np.asarray(codes, np.float64) / 2.0 ** (bits - 8) - 16.0) / 219.0


def code_table(transfer: str, bits: int, full_range: bool = True) -> np.ndarray:
    """Light [float32, 2**bits entries] of every code of a channel with `bits` bits."""
    signal = signal_of_codes(np.arange(2**bits), bits, full_range)
    return parse_transfer(transfer).to_light(signal).astype(np.float32)


def _gamma(name: str) -> float:
    gamma = number_of(name.removeprefix("gamma:"))
    if not 1 / STEEPEST_GAMMA <= gamma <= STEEPEST_GAMMA:
        raise UsageError(f"transfer '{name}': expected a number from 0.1 to 10 after 'gamma:', such as gamma:2.2")
    return gamma


def _not_negative(values: np.ndarray) -> np.ndarray:
    return np.maximum(np.asarray(values, np.float64), 0.0)  # (maximum, unlike a comparison, lets NaN through)


def _srgb_to_light(signal: np.ndarray) -> np.ndarray:
    v = _not_negative(signal)
    power = ((v + SRGB_OFFSET) / (1 + SRGB_OFFSET)) ** SRGB_POWER
    return np.where(v <= SRGB_KNEE, v / SRGB_SLOPE, power)


def _srgb_to_signal(light: np.ndarray) -> np.ndarray:
    x = _not_negative(light)
    root = (1 + SRGB_OFFSET) * x ** (1 / SRGB_POWER) - SRGB_OFFSET
    return np.where(x <= SRGB_KNEE / SRGB_SLOPE, x * SRGB_SLOPE, root)


def _camera(alpha: float, beta: float, slope: float) -> tuple[Curve, Curve]:
    """The power 0.45 with a straight toe below `beta`: to light, and to signal."""

    def to_light(signal: np.ndarray) -> np.ndarray:
        v = _not_negative(signal)
        power = ((v + (alpha - 1)) / alpha) ** (1 / BT709_POWER)
        return np.where(v <= slope * beta, v / slope, power)

    def to_signal(light: np.ndarray) -> np.ndarray:
        x = _not_negative(light)
        root = alpha * x**BT709_POWER - (alpha - 1)
        return np.where(x <= beta, x * slope, root)

    return to_light, to_signal


def _st428_to_light(signal: np.ndarray) -> np.ndarray:
    return ST428_PEAK * _not_negative(signal) ** ST428_POWER


def _st428_to_signal(light: np.ndarray) -> np.ndarray:
    return (_not_negative(light) / ST428_PEAK) ** (1 / ST428_POWER)


CURVES: dict[str, tuple[Curve, Curve]] = {
    "linear": (_not_negative, _not_negative),
    "srgb": (_srgb_to_light, _srgb_to_signal),
    "bt709": _camera(BT709_ALPHA, BT709_BETA, BT709_SLOPE),
    "pq": (hdr.pq_to_light, hdr.pq_to_signal),
    "hlg": (hdr.hlg_to_light, hdr.hlg_to_signal),
    "smpte240m": _camera(SMPTE240M_ALPHA, SMPTE240M_BETA, SMPTE240M_SLOPE),
    "st428": (_st428_to_light, _st428_to_signal),
    "log100": hdr.logarithmic(2),
    "log316": hdr.logarithmic(2.5),
}
