"""A pass: a conversion of which nothing is written, and what its cameras send.

What is timed is all of it: the source opened and decoded, light made between the frames, views formed and, where
effects are chosen by them, measured; sensors run, again if the choice was wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vid2ev.compare.by_pixel import ByPixel, by_pixel
from vid2ev.cost.rung import Rung
from vid2ev.errors import UsageError
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.plan.planner import Planner
from vid2ev.plan.recordings import planned
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.mounts import Mount
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.dvs import Dvs
from vid2ev.stream.events import Events

MOST_EVENTS = 1 << 26  # of all cameras in a pass: 0.9 GB
PICTURES = 8  # of each view, kept for comparison


class Float64Dvs(Dvs):
    """An event sensor that takes all pixels' lags to be too steep for float32 (`kernels.steep.refine`)."""

    def __init__(self, *arguments: Any, **options: Any):
        super().__init__(*arguments, **options | {"skip": False})
        numbers = self._pixels.numbers
        self._pixels.numbers = numbers._replace(curve=numbers.curve._replace(floor=-math.inf))


@dataclass
class Sent:
    """What a camera sent in a pass: events in blocks, codes of exposures; and what it saw, some pictures of 8 bits."""

    mount: Mount
    events: list[Events] = field(default_factory=list)
    codes: list[np.ndarray] = field(default_factory=list)
    views: list[np.ndarray] = field(default_factory=list)

    def by_pixel(self, size: tuple[int, int], coarse: int = 1) -> ByPixel:
        """The events, as if each pixel were `coarse` by `coarse` pixels of a sensor of `size` (width, height)."""
        return by_pixel((repeated(events, coarse) for events in self.events), size[0], range(size[1]))


@dataclass
class Pass:
    """What came of a pass: what was sent, how long the clip is [ns], from the first light on, and how many events."""

    sent: list[Sent]
    span_ns: tuple[int, int]
    events: int


def run(options: Mapping[str, Any], rung: Rung, threads: int, *, keep: bool = False, views: bool = False) -> Pass:
    """One pass of a setting; `keep` what the cameras send, and `views`: some of what they see.

    Raises UsageError for more events than memory should hold, DataError as the source does.
    """
    rest = rung.applied(options)
    effects, tolerance = rest.pop("effects", "all"), rest.pop("tolerance")
    recipe = Recipe.of(**rest)
    if effects != "auto":
        recipe = planned(recipe, effects, tolerance)[0]
        return _passed(recipe, None, rung, threads, keep=keep, views=views)  # type: ignore[return-value]
    planner, done = Planner(recipe, tolerance, threads), None
    planner.begin()
    while done is None:
        done = _passed(planner.left, planner, rung, threads, keep=keep, views=views)
    return done


def _passed(
    recipe: Recipe, planner: Planner | None, rung: Rung, threads: int, *, keep: bool, views: bool
) -> Pass | None:
    """One pass of a recipe; None where there are new plans for it."""
    sensors = [_sensor(mount, rung, threads) for mount in recipe.mounts]
    done = Pass([Sent(mount) for mount in recipe.mounts], (0, 0), 0)
    first_ns, last_ns, originals = None, 0, 0
    every = max(1, (recipe.source.frames_expected or PICTURES) // PICTURES)
    with closing(planner.instants() if planner else instants(recipe, threads=threads)) as coming:
        for index, instant in enumerate(coming):
            if planner and planner.see(instant, index):
                return None
            first_ns, last_ns = instant.t_ns if first_ns is None else first_ns, instant.t_ns
            _sense(sensors, instant, done, keep)
            if views and instant.original and originals % every == 0:
                for sent, frame in zip(done.sent, instant.frames, strict=True):
                    sent.views.append(srgb_codes(frame.luminance))
            originals += instant.original
    if planner and planner.finish():
        return None
    for sensor, sent in zip(sensors, done.sent, strict=True):
        if isinstance(sensor, Dvs):
            _take(sensor.flush(), sent, done, keep)
    done.span_ns = (first_ns or 0, last_ns)
    return done


def repeated(events: Events, coarse: int) -> Events:
    """Events of pixels as large as coarse by coarse, of each of the small ones; in the same order of time."""
    if coarse == 1:
        return events
    across, down = np.tile(np.arange(coarse), coarse), np.repeat(np.arange(coarse), coarse)
    many = coarse * coarse
    x = (events.x[:, None].astype(np.uint32) * coarse + across).astype(np.uint16).ravel()
    y = (events.y[:, None].astype(np.uint32) * coarse + down).astype(np.uint16).ravel()
    return Events(np.repeat(events.t, many), x, y, np.repeat(events.p, many), None)


def _sensor(mount: Mount, rung: Rung, threads: int) -> Dvs | Cis:
    if mount.kind == "cis":
        return mount.cis(threads)
    return mount.dvs(threads=threads, kind=Float64Dvs if rung.float64 else Dvs)


def _sense(sensors: list[Dvs | Cis], instant: Instant, done: Pass, keep: bool) -> None:
    """An instant for all cameras."""
    for sensor, sent, frame in zip(sensors, done.sent, instant.frames, strict=True):
        if isinstance(sensor, Dvs):
            _take(sensor.see(frame), sent, done, keep)
            continue
        for exposure in sensor.exposures(frame):
            if keep:
                sent.codes.append(exposure.codes)


def _take(events: Events, sent: Sent, done: Pass, keep: bool) -> None:
    done.events += len(events)
    if keep and len(events):
        if done.events > MOST_EVENTS:
            raise UsageError(f"more than {MOST_EVENTS:,} events: expected to hold them in memory; shorten --duration")
        sent.events.append(events)
