"""The course of a pixel: what it saw, what it had inside, and what it sent, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from vid2ev.sensors.dvs import Dvs
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame


class Course(NamedTuple):
    """A pixel at N frames, and its events.

    t_ns       int64 [N]
    light      float64 [N]; 1 is white
    filtered, signal, level_on, level_off   float64 [N, nat], as in `sensors.inside.Inside`, after each frame
    events     those of the pixel
    """

    t_ns: np.ndarray
    light: np.ndarray
    filtered: np.ndarray
    signal: np.ndarray
    level_on: np.ndarray
    level_off: np.ndarray
    events: Events

    def since(self, first: int) -> Course:
        """From frame `first` on."""
        events = self.events.select(self.events.t > self.t_ns[first] // 1000)
        return Course(*(column[first:] for column in self[:-1]), events)  # type: ignore[call-arg, arg-type]


def course_of(dvs: Dvs, frames: Iterable[Frame], pixel: tuple[int, int] = (0, 0)) -> Course:
    """The course of a pixel (x, y) of a sensor over frames of luminance, which the sensor sees as it does."""
    x, y = pixel
    place = np.array([y * dvs.size[0] + x], np.int64)
    instants, rows, sent = [], [], []
    for frame in frames:
        events = dvs.see(frame)
        sent.append(events.select((events.x == x) & (events.y == y)))
        instants.append(frame.t_ns)
        rows.append([float(frame.light[y, x]), *(float(column[0]) for column in dvs.inside(place))])
    light, filtered, signal, level_on, level_off = np.array(rows, np.float64).reshape(-1, 5).T
    t_ns = np.array(instants, np.int64)
    return Course(t_ns, light, filtered, signal, level_on, level_off, Events.concatenate(sent))
