"""From a shot to a clip: the sensors of `vid2ev convert` look at it.

The key frames are at 0 and at the gap, in the middle of their exposures.  Pictures are made at even steps, finer where
more moves: to sensors light is a straight line between two.  The event camera watches from an eighth of the gap before
the first key frame on at least, so that its poles have the lag that motion gives them; events count from the key frame
on.

What few pictures cost, against 32 a gap, with motion of 4 to 14 px, an ideal event sensor and K = 8: sums of events up
to the frames to rebuild differ by so many nats (rms), and so many of the events are others.

    steps of     photographs          scenes
    1.5 px       0.013 nat, 1.8 %     0.024 nat, 5.6 %
    0.75 px      0.006 nat, 0.5 %     0.014 nat, 2.0 %

That thresholds are 0.15 nat apart alone makes 0.043 nat.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from interp.data.chance import Range, chance, uniform
from interp.data.clip import Clip
from interp.data.sensor_ranges import SensorRanges
from interp.data.settings import ClipSettings
from interp.data.shot import AHEAD, Beside, Shot
from interp.representation.event_counts import count_events
from vid2ev import Cis, CisSpec, Dvs, DvsSpec, Events

BRIGHT_PERCENTILE = 95.0
GAIN: Range = (1e-2, 1e3)  # of the aperture
MOST = 255  # events that are counted in a pixel, sub-interval and polarity


def simulated(
    shot: Shot, settings: ClipSettings, seed: int, number: int, multiple: int, gap_us: int, beside: Beside
) -> Clip:
    """The clip of a shot; its sensors are drawn for its number."""
    draw, ranges = chance(seed, "sensors", number), settings.sensors
    steps = steps_for(shot.moved_px, settings, multiple)
    half = 0 if shot.exposed else _half_exposure(draw, ranges, steps)
    dvs_spec = ranges.dvs(draw)
    cis_spec = ranges.cis(draw, gap_us, 2 * half * gap_us / steps)
    white, sensor_seed = uniform(draw, ranges.white), int(draw.integers(1 << 62))
    ahead = max(half, steps // AHEAD, 1)
    light = Light(cis_spec, dvs_spec, settings, sensor_seed, beside, gap_us, multiple, steps, half)
    for j, (frame, luminance) in enumerate(shot.pictures(steps, -ahead, steps + half), -ahead):
        if j == -ahead:
            gain = np.float32(1.0 if shot.exposed else _aperture(frame, white))
        light.add(j, frame * gain, luminance * gain)
    about = shot.about | {
        "moved_px": round(shot.moved_px, 3), "pictures": steps + half + ahead + 1, "gain": float(gain),
        "exposure_us": cis_spec.exposure_us, "effects": dvs_spec.effects(),
        "beside_m": [beside.right_m, beside.down_m], "coarser": beside.coarser,
    }  # fmt: skip
    return light.clip(about)


def steps_for(moved_px: float, settings: ClipSettings, multiple: int) -> int:
    """How many pictures the gap takes: so many that things move by `step_px`, from one per frame to one per bin."""
    steps = multiple
    while steps < settings.bins and moved_px > steps * settings.step_px:
        steps *= 2
    return steps


class Light:
    """The sensors of a clip, fed a picture at a time."""

    def __init__(
        self,
        cis: CisSpec,
        dvs: DvsSpec,
        settings: ClipSettings,
        seed: int,
        beside: Beside,
        gap_us: int,
        multiple: int,
        steps: int,
        half: int,
    ):
        width, height = settings.size
        self._size = width // beside.coarser, height // beside.coarser
        self._settings, self._gap_us, self._steps, self._half = settings, gap_us, steps, half
        self._each = steps // multiple
        self._dvs_spec, self._codes = dvs, cis.picture_codes()
        self._dvs = Dvs(dvs, self._size, seed)
        self._cis = Cis(cis, settings.size, seed)
        self._sampler = Cis(cis.sampling(1e6 * multiple / gap_us), settings.size, seed)
        self._keys: list[np.ndarray] = []
        self._truth: list[np.ndarray] = []
        self._events: list[Events] = []

    def add(self, j: int, frame: np.ndarray, luminance: np.ndarray) -> None:
        """The light at j / steps of the gap."""
        t_ns = 1000 * self._gap_us * (j + self._steps) // self._steps  # (times are not negative)
        events = self._dvs.step(luminance, t_ns)
        if 0 < j <= self._steps:
            self._events.append(events)
        if min(abs(j), abs(j - self._steps)) <= self._half:
            self._keys += [self._codes[each.codes] for each in self._cis.step(frame, t_ns)]
        if 0 <= j <= self._steps and j % self._each == 0:
            if self._settings.light == "linear":
                self._truth.append(np.clip(frame, 0, 65504).astype(np.float16))
            else:
                self._truth += [self._codes[each.codes] for each in self._sampler.step(frame, t_ns)]

    def clip(self, about: dict[str, Any]) -> Clip:
        """What the sensors made of it."""
        spec, start_us = self._dvs_spec, self._gap_us
        events = Events.concatenate([*self._events, self._dvs.flush()])
        counted = count_events(events, self._size, start_us, 2 * start_us, self._settings.bins).off_on[0].numpy()
        return Clip(
            np.stack(self._truth),
            np.stack(self._keys),
            np.minimum(counted, MOST).astype(np.uint8),
            (spec.threshold_off, spec.threshold_on),
            self._gap_us,
            about,
        )


def _half_exposure(draw: np.random.Generator, ranges: SensorRanges, steps: int) -> int:
    """Half an exposure, in steps."""
    share = uniform(draw, ranges.exposure)
    return round(share / 2 * steps) if draw.random() < ranges.exposed else 0


def _aperture(frame: np.ndarray, white: float) -> float:
    """What light is multiplied by, for both cameras, so that the brightest twentieth of a picture begins at `white`."""
    bright = float(np.percentile(frame.max(axis=2), BRIGHT_PERCENTILE))
    return float(np.clip(white / max(bright, 1e-9), *GAIN)) if bright > 0 else 1.0
