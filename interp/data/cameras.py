"""The cameras that look at a clip, drawn for its number, and when they look.

The key frames are at 0 and at the gap, in the middle of their exposures.  The light is known at even steps, finer where
more moves.  The event camera watches from an eighth of the gap before the first key frame on at least, so that its
poles have the lag that motion gives them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from interp.data.chance import Range, chance, uniform
from interp.data.sensor_ranges import SensorRanges
from interp.data.settings import ClipSettings
from interp.data.shot import AHEAD, Beside, Shot
from interp.representation.dead_time import DeadTime
from vid2ev import CisSpec, DvsSpec

BRIGHT_PERCENTILE = 95.0
GAIN: Range = (1e-2, 1e3)  # of the aperture


@dataclass(frozen=True, slots=True)
class Cameras:
    """What looks at a shot.

    cis, dvs   sensors, of one seed
    white      light that the brightest twentieth of a picture begins at, by the aperture; None: as it is
    size       width and height of the frames [px]
    gap_us     from key frame to key frame [us]
    multiple   K: frames to rebuild per key frame
    steps      of the light in the gap, a multiple of K
    half       half an exposure, in steps
    """

    cis: CisSpec
    dvs: DvsSpec
    seed: int
    white: float | None
    size: tuple[int, int]
    beside: Beside
    gap_us: int
    multiple: int
    steps: int
    half: int = 0

    @property
    def first(self) -> int:
        """The step that the event camera watches from, before 0."""
        return -max(self.half, self.steps // AHEAD, 1)

    @property
    def last(self) -> int:
        """The last step that is looked at."""
        return self.steps + self.half

    @property
    def size_of_events(self) -> tuple[int, int]:
        """Width and height of the event camera [px]."""
        return self.size[0] // self.beside.coarser, self.size[1] // self.beside.coarser

    @property
    def dead_time(self) -> DeadTime | None:
        """Of the event camera's pixels, if there is any."""
        return DeadTime.of(self.dvs.model_dump())

    def t_ns(self, j: int) -> int:
        """When step j is [ns]; times are not negative."""
        return 1000 * self.gap_us * (j + self.steps) // self.steps

    def gain(self, frame: np.ndarray) -> np.float32:
        """What light is multiplied by, for both cameras, after the first frame [H, W, 3]."""
        if self.white is None:
            return np.float32(1.0)
        bright = float(np.percentile(frame.max(axis=2), BRIGHT_PERCENTILE))
        return np.float32(np.clip(self.white / max(bright, 1e-9), *GAIN) if bright > 0 else 1.0)

    def about(self, shot: Shot, gain: np.float32) -> dict[str, Any]:
        """What a clip says of itself."""
        return shot.about | {
            "moved_px": round(shot.moved_px, 3), "pictures": self.last - self.first + 1, "gain": float(gain),
            "exposure_us": self.cis.exposure_us, "effects": self.dvs.effects(),
            "beside_m": [self.beside.right_m, self.beside.down_m], "coarser": self.beside.coarser,
        }  # fmt: skip


def cameras_of(
    shot: Shot, settings: ClipSettings, seed: int, number: int, multiple: int, gap_us: int, beside: Beside
) -> Cameras:
    """The cameras that look at the shot of a number."""
    draw, ranges = chance(seed, "sensors", number), settings.sensors
    steps = steps_for(shot.moved_px, settings, multiple)
    half = 0 if shot.exposed else _half_exposure(draw, ranges, steps)
    dvs = ranges.dvs(draw)
    cis = ranges.cis(draw, gap_us, 2 * half * gap_us / steps)
    white, sensor_seed = uniform(draw, ranges.white), int(draw.integers(1 << 62))
    exposed = None if shot.exposed else white
    return Cameras(cis, dvs, sensor_seed, exposed, settings.size, beside, gap_us, multiple, steps, half)


def steps_for(moved_px: float, settings: ClipSettings, multiple: int) -> int:
    """How many pictures the gap takes: so many that things move by `step_px`, from one per frame to one per bin."""
    steps = multiple
    while steps < settings.bins and moved_px > steps * settings.step_px:
        steps *= 2
    return steps


def _half_exposure(draw: np.random.Generator, ranges: SensorRanges, steps: int) -> int:
    """Half an exposure, in steps."""
    share = uniform(draw, ranges.exposure)
    return round(share / 2 * steps) if draw.random() < ranges.exposed else 0
