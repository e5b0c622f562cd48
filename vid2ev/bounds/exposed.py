"""Exposed: what a frame camera sees of a clip, and what a change of its levels counts for.

A **level** is what the ADC rounds to a code [LSB], in the mean over all noise.  Rounding moves it by up to half an LSB;
the mean square of that is 1/12 where levels are spread evenly.  Shot noise goes with the light: where that changes, so
does the noise, and codes of few electrons change by more than their levels.  In units of that square the distance of
two films is

    distance = 12 (max |change of a level|)^2         1: as much as rounding changes, in the mean

Its root obeys the triangle inequality as that of the distance of events does, so that one tolerance serves both:
0.01 lets no level of any exposure change by more than 0.029 LSB, all that is left out together.

For random effects, N independent numbers c_i of mean square m exceed `most` with a chance of 1/2000 for all of them,
and then (Bernstein) with as little chance

    1/N sum c_i^2 > m + sqrt(2 x m / N) most + x most^2 / (3 N),     x = ln 2000

Sources: W. R. Bennett, "Spectra of quantized signals", Bell System Technical Journal 27, 1948, for the 1/12;
S. Boucheron, G. Lugosi, P. Massart, *Concentration Inequalities*, 2013, section 2.8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from vid2ev.bounds.scene import Kind, Omission

ROUNDING = 12.0  # 1 / mean square of the error of rounding [1/LSB^2]
RARELY = math.log(2000)  # two such chances make 99.9 %


class Change(NamedTuple):
    """A change of all levels of all exposures, in whatever unit: the greatest, the mean square, and the share of levels
    that may be changed, where that is known."""

    most: float = 0.0
    square: float = 0.0
    near: float = 1.0

    def times(self, factor: float) -> Change:
        """The change in another unit."""
        return Change(self.most * factor, self.square * factor**2, self.near)

    @property
    def rms(self) -> float:
        """The root of the mean square."""
        return math.sqrt(self.square)


UNCHANGED = Change()


@dataclass(frozen=True)
class LevelChange(Omission):
    """What leaving an effect of a frame camera out changes; `levels` in LSB."""

    levels: Change = UNCHANGED


@dataclass(frozen=True)
class Exposed:
    """What a frame camera sees of a clip: of every value of every exposure, light behind the lens shading.

    values, rows          of an exposure
    exposures             how many were looked at
    frames, frames_each   frames of light, and those that fall into one exposure, in the mean
    light_min, light_max, light_mean    of all of it
    lit_max, lit_mean, lit_square       greatest, mean and mean square; light that is clipped whatever noise does
                          counts as 0, as there nothing changes
    changes               of light, by the name of an effect: what it is with the effect less what it is without
    speed_px_per_s        how fast things move in the source, where that was looked at
    """

    values: int
    rows: int
    exposures: int
    frames: int
    frames_each: float
    light_min: float
    light_max: float
    light_mean: float
    lit_max: float
    lit_mean: float
    lit_square: float
    changes: Mapping[str, Change]
    speed_px_per_s: float | None = None

    @property
    def draws(self) -> int:
        """How many values there are in all."""
        return self.values * self.exposures

    def moved(self, us: float) -> str:
        """How far things move in a time, in words."""
        return (
            ""
            if self.speed_px_per_s is None
            else f", in which things move up to {1e-6 * us * self.speed_px_per_s:.2g} px"
        )

    def describe(self) -> dict[str, Any]:
        """It in a few numbers, ready for JSON."""
        light = [self.light_min, self.light_mean, self.light_max]
        return {"frames": self.frames, "exposures": self.exposures, "values": self.values, "light": light}


def level_change(levels: Change, kind: Kind, why: str, replace: tuple[tuple[str, Any], ...] = ()) -> LevelChange:
    """The omission that changes levels [LSB] so much."""
    figure = f"max {levels.most:.2g}, rms {levels.rms:.2g} LSB"
    return LevelChange(ROUNDING * levels.most**2, kind, figure, why, replace, levels)


def surely_square(square: float, most: float, number: int) -> Change:
    """The 99.9 % bound on `number` random changes that exceed `most` with a chance of 1/2000; 0 of none."""
    if number == 0:
        return Change()
    spread = math.sqrt(2 * RARELY * square / number) * most
    return Change(most, min(square + spread + RARELY * most**2 / (3 * number), most**2))


def normal_most(number: int) -> float:
    """What none of so many standard normal numbers exceeds, but with a chance of 1/2000."""
    return math.sqrt(2 * (RARELY + math.log(max(number, 1))))


def poisson_most(mean: float, number: int) -> float:
    """How far none of so many numbers of Poisson's, of means up to `mean`, is from it; but for a chance of 1/2000."""
    rare = RARELY + math.log(2 * max(number, 1))
    return rare / 3 + math.sqrt(rare**2 / 9 + 2 * mean * rare)
