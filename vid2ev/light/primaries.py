"""Which colours red, green and blue are.

    luminance of R, G, B = the middle row of A M      M: linear RGB -> XYZ with white (1, 1, 1) at Y = 1
    RGB in BT.709        = inv(M of BT.709) A M RGB   A: Bradford adaptation of the white point to D65

M follows from the chromaticities of the primaries and of white.  Nothing is clipped: a colour that BT.709 cannot mix
has a negative component there.  White stays white, whatever its chromaticity.  Luminance is that of the RGB in BT.709:
an event camera sees the same light whether a frame camera beside it sees colours or not.

Sources: M, SMPTE RP 177; chromaticities, Rec. ITU-T H.273 table 2; adaptation, Lam, "Metamerism and colour constancy",
University of Bradford 1985, with the matrix of Lindbloom.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from vid2ev.light.tags import BT709_WEIGHTS, WEIGHTS

Place = tuple[float, float]

D65, C, E, DCI = (0.3127, 0.3290), (0.310, 0.316), (1 / 3, 1 / 3), (0.314, 0.351)
BT709 = 1
CHROMATICITIES: dict[int, tuple[Place, Place, Place, Place]] = {  # of red, green, blue and white
    BT709: ((0.640, 0.330), (0.300, 0.600), (0.150, 0.060), D65),
    4: ((0.670, 0.330), (0.210, 0.710), (0.140, 0.080), C),  # BT.470 System M
    5: ((0.640, 0.330), (0.290, 0.600), (0.150, 0.060), D65),  # BT.601, 625 lines
    6: ((0.630, 0.340), (0.310, 0.595), (0.155, 0.070), D65),  # BT.601, 525 lines
    7: ((0.630, 0.340), (0.310, 0.595), (0.155, 0.070), D65),  # SMPTE 240M
    8: ((0.681, 0.319), (0.243, 0.692), (0.145, 0.049), C),  # film
    9: ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), D65),  # BT.2020
    11: ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), DCI),  # P3 of cinemas
    12: ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), D65),  # P3-D65, of telephones
    22: ((0.630, 0.340), (0.295, 0.605), (0.155, 0.077), D65),  # EBU Tech 3213
}

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


class Primaries(NamedTuple):
    """Red, green and blue: their luminances, and the matrix [3, 3] that takes them to those of BT.709."""

    weights: tuple[float, float, float]
    to_bt709: np.ndarray


@cache
def primaries_of(tag: int) -> Primaries:
    """The primaries of a code point of H.273; unspecified and unknown ones are those of BT.709."""
    if tag not in CHROMATICITIES:
        return primaries_of(BT709)
    by_place = primaries_at(CHROMATICITIES[tag])
    return Primaries(WEIGHTS.get(tag, by_place.weights), by_place.to_bt709)


def primaries_at(places: Sequence[Place]) -> Primaries:
    """The primaries with these chromaticities (x, y): red, green, blue, white.  Raises ValueError if they mix none."""
    own, own_white = _to_xyz(places)
    bt709, d65 = _to_xyz(CHROMATICITIES[BT709])
    if np.allclose(own, bt709, atol=1e-3):
        return Primaries(BT709_WEIGHTS, np.eye(3))
    adapted = np.linalg.inv(BRADFORD) @ np.diag(BRADFORD @ d65 / (BRADFORD @ own_white)) @ BRADFORD
    seen = adapted @ own
    red, green, blue = seen[1].tolist()
    return Primaries((red, green, blue), np.linalg.inv(bt709) @ seen)


def _to_xyz(places: Sequence[Place]) -> tuple[np.ndarray, np.ndarray]:
    """The matrix to XYZ, and XYZ of white."""
    with np.errstate(all="ignore"):  # (a primary without luminance, as of XYZ itself, is in another unit)
        red, green, blue, white = (np.array([x / y, 1.0, (1 - x - y) / y] if y else [x, y, 1 - x]) for x, y in places)
        corners = np.stack([red, green, blue], axis=1)
        if not np.all(np.isfinite([red, green, blue, white])) or abs(np.linalg.det(corners)) < 1e-9 or not white[1]:
            raise ValueError(f"the chromaticities {list(places)} mix no white")
    return corners * np.linalg.solve(corners, white), white
