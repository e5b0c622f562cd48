"""From a shot to a clip: the sensors of `vid2ev convert` look at it.

What few pictures cost, against 32 a gap, with motion of 4 to 14 px, an ideal event sensor and K = 8: sums of events up
to the frames to rebuild differ by so many nats (rms), and so many of the events are others.

    steps of     photographs          scenes
    1.5 px       0.013 nat, 1.8 %     0.024 nat, 5.6 %
    0.75 px      0.006 nat, 0.5 %     0.014 nat, 2.0 %

That thresholds are 0.15 nat apart alone makes 0.043 nat.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from interp.data.cameras import Cameras
from interp.data.clip import Clip
from interp.data.settings import ClipSettings
from interp.data.shot import Shot
from interp.representation.event_counts import EventCounts, count_events
from vid2ev import Cis, CisSpec, Dvs, Events
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS
from vid2ev.stream.upload import as_array

MOST = 255  # that events of a pixel, sub-interval and polarity count for


def simulated(shot: Shot, cameras: Cameras, settings: ClipSettings) -> Clip:
    """The clip that cameras make of a shot; events count from the first key frame on, for what dead time hid, too."""
    light, gain = Light(cameras, settings), np.float32(1.0)
    pictures = shot.pictures(cameras.steps, cameras.first, cameras.last)
    for j, (frame, luminance) in enumerate(pictures, cameras.first):
        if j == cameras.first:
            gain = cameras.gain(frame)
        light.add(j, frame * gain, luminance * gain)
    return light.clip(cameras.about(shot, gain))


class Light:
    """The sensors of a clip, fed a picture at a time."""

    def __init__(self, cameras: Cameras, settings: ClipSettings):
        self._cameras, self._settings = cameras, settings
        self._frames = Frames(cameras, settings)
        self._dvs = Dvs(cameras.dvs, cameras.size_of_events, cameras.seed)
        self._events: list[Events] = []

    def add(self, j: int, frame: np.ndarray, luminance: np.ndarray) -> None:
        """The light at step j of the gap."""
        events = self._dvs.step(luminance, self._cameras.t_ns(j))
        if j <= self._cameras.steps:  # (those before the gap tell what the first ones in it hid: `counts_of`)
            self._events.append(events)
        self._frames.add(j, frame)

    def clip(self, about: dict[str, Any]) -> Clip:
        """What the sensors made of it."""
        off_on = counts_of(self._cameras, [*self._events, self._dvs.flush()], self._settings)
        return clip_of(self._cameras, self._frames, off_on, about)


class Frames:
    """The frame camera of a clip, fed a picture at a time: key frames, and the truth; `make` makes a `Cis`."""

    def __init__(self, cameras: Cameras, settings: ClipSettings, make: Callable[[CisSpec, Any, int], Cis] = Cis):
        sampling = cameras.cis.sampling(1e6 * cameras.multiple / cameras.gap_us)
        self._cameras, self._linear, self._codes = cameras, settings.light == "linear", cameras.cis.picture_codes()
        self._cis, self._sampler = (make(spec, cameras.size, cameras.seed) for spec in (cameras.cis, sampling))
        self._each = cameras.steps // cameras.multiple
        self.keys: list[np.ndarray] = []
        self.truth: list[np.ndarray] = []

    def add(self, j: int, frame: Any) -> None:
        """The light at step j of the gap, an array, or a tensor if the camera takes those."""
        steps, t_ns = self._cameras.steps, self._cameras.t_ns(j)
        if min(abs(j), abs(j - steps)) <= self._cameras.half:
            self.keys += [self._codes[each.codes] for each in self._cis.step(frame, t_ns)]
        if not 0 <= j <= steps or j % self._each:
            return
        if self._linear:
            light = np.nan_to_num(as_array(frame), nan=0.0)  # (as sensors take it)
            self.truth.append(np.clip(light, 0, MOST_OF_HALF_FLOATS).astype(np.float16))
        else:
            self.truth += [self._codes[each.codes] for each in self._sampler.step(frame, t_ns)]


def counts_of(cameras: Cameras, events: list[Events], settings: ClipSettings) -> np.ndarray:
    """`off_on` of a clip: of the events of its gap, and any before."""
    start_us, stop_us = cameras.gap_us, 2 * cameras.gap_us
    together, size = Events.concatenate(events), cameras.size_of_events
    counted = count_events(together, size, start_us, stop_us, settings.bins, dead_time=cameras.dead_time)
    return kept_counts(counted)


def kept_counts(counted: EventCounts) -> np.ndarray:
    """`off_on` of a clip: counts of B = 1, up to MOST."""
    return counted.off_on[0].clamp(max=MOST).half().numpy()


def clip_of(cameras: Cameras, frames: Frames, off_on: np.ndarray, about: dict[str, Any]) -> Clip:
    """The clip of what the frame camera saw, and counts of events."""
    contrast = cameras.dvs.threshold_off, cameras.dvs.threshold_on
    return Clip(np.stack(frames.truth), np.stack(frames.keys), off_on, contrast, cameras.gap_us, about)
