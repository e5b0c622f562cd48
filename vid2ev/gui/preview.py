"""A preview: what each camera of a setup sends within a short time, as pictures and numbers.

Its sensors begin a little before the preview begins, so that they remember what came just before.  All else is as in a
conversion: the same light, sensors, seeds and views.  What takes long is shown roughly first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from vid2ev.compare.statistics import Gathering, Statistics
from vid2ev.cores import usable_cores
from vid2ev.gui.light import SIDE, Light, LightTable, duration_s
from vid2ev.gui.setup import Setup
from vid2ev.gui.stand_in import Kernels
from vid2ev.kernels.layout import Flags
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.plan.plan import TOLERANCE, Plan
from vid2ev.plan.recordings import Look
from vid2ev.seen.mounts import Mount
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.course import Course, course_of
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.terminal import counted
from vid2ev.views.requests import parse_representation

VIEWS = {"polarity": "counts", "event frame": "frame:2", "time surface": "time-surface:10ms", "light": "light"}
PATIENCE_S = 0.8  # until a picture is shown without the events of a sensor that is compiled
TICK_S = 0.05


@dataclass(frozen=True)
class Request:
    """What is to be shown: from `start_s` on, for `length_s` or as long as an exposure takes.

    view    one of `VIEWS`
    pixel   the number of a camera and x, y, whose course is asked for, as pixels of the picture
    number  by which the answer is known
    ready   the kernels that need not be compiled (`gui.stand_in`)
    """

    setup: Setup
    start_s: float = 0.0
    length_s: float = 0.03
    view: str = "polarity"
    pixel: tuple[int, int, int] | None = None
    number: int = 0
    side: int = SIDE
    ready: frozenset[Flags] = frozenset()


@dataclass(frozen=True)
class Shown:
    """What one camera sends: `picture` is a PNG; `statistics` are those of events, None of frame cameras."""

    name: str
    kind: str
    size: tuple[int, int]
    picture: bytes
    caption: str
    statistics: Statistics | None = None


@dataclass(frozen=True)
class Answer:
    """A preview; `start_s` and `pixel` are what was asked for, `course` that of the pixel, `duration_s` how long the
    whole source lasts.  One that is not `whole` is made of fewer instants than it will be."""

    number: int
    start_s: float
    span_s: tuple[float, float]
    duration_s: float | None
    cameras: tuple[Shown, ...]
    pixel: tuple[int, int, int] | None = None
    course: Course | None = None
    notes: tuple[str, ...] = ()
    whole: bool = True


@dataclass(frozen=True)
class Plans:
    """The plans of the preview's cameras, by name, for the light of the preview."""

    number: int
    plans: dict[str, Plan] = field(default_factory=dict)


class Previewer:
    """Makes previews; `check` is called now and then, and may raise."""

    def __init__(self, check: Callable[[], None] = lambda: None):
        self._check = check
        self._table = LightTable(check)
        self._threads = usable_cores()
        self._kernels = Kernels()

    def answer(self, request: Request) -> Answer:
        """The preview that is asked for.  Raises UsageError, DataError."""
        *_, answer = self.answers(request)
        return answer

    def answers(self, request: Request) -> Iterator[Answer]:
        """The same; before it, where it takes long, a rough one."""
        missing = False
        for light in self._table.lights(request.setup, request.start_s, request.length_s, request.side):
            self._check()
            sensors = self._sensors(light, request)
            missing = not all(self._kernels.there(spec, PATIENCE_S) for spec in sensors.values())
            yield self._answer(light, request, sensors, light.whole and not missing)
        while missing:
            self._check()
            missing = not all(self._kernels.there(spec, TICK_S) for spec in sensors.values())
            if not missing:
                yield self._answer(light, request, sensors, True)

    def light(self, request: Request) -> Light:
        """The light of a preview; that of the last one is known.  Raises UsageError, DataError."""
        return self._table.light(request.setup, request.start_s, request.length_s, request.side)

    def _sensors(self, light: Light, request: Request) -> dict[int, DvsSpec]:
        """What simulates each event camera, by its number."""
        specs = [(number, mount.sensor.spec) for number, mount in enumerate(light.recipe.mounts)]
        return {
            number: self._kernels.choose(spec, request.ready) for number, spec in specs if isinstance(spec, DvsSpec)
        }

    def _answer(self, light: Light, request: Request, sensors: Mapping[int, DvsSpec], whole: bool) -> Answer:
        notes = [*light.notes] if light.whole else ["a rough picture; the fine one follows"]
        cameras = []
        for number, mount in enumerate(light.recipe.mounts):
            frames = [instant.frames[number] for instant in light.instants]
            if mount.kind == "cis":
                cameras.append(self._frame(mount, frames[light.lead :], notes))
            elif self._kernels.there(sensors[number], 0.0):
                cameras.append(self._events(_with(mount, sensors[number]), frames, light.lead, request))
            else:
                picture = _png(_lit(frames[-1].light))
                cameras.append(Shown(mount.name, mount.kind, mount.size, picture, "light"))
                notes.append(f"{mount.name}: its effects are compiled, once; its events follow within a minute")
        ends = light.instants[light.lead].t_ns, light.instants[-1].t_ns
        return Answer(
            request.number,
            request.start_s,
            (1e-9 * ends[0], 1e-9 * ends[1]),
            duration_s(request.setup),
            tuple(cameras),
            request.pixel,
            self._course(light, request, sensors),
            tuple(notes),
            whole,
        )

    def _events(self, mount: Mount, frames: list[Frame], lead: int, request: Request) -> Shown:
        sent = [*mount.dvs(threads=self._threads).run(frames)]
        events = Events.concatenate(sent[lead + 1 :])
        span_us = frames[lead].t_ns // 1000, max(frames[-1].t_ns // 1000, int(events.t[-1]) if len(events) else 0)
        gathering = Gathering(mount.size)
        gathering.add(events)
        found = gathering.statistics(span_us)
        picture = _lit(frames[-1].light) if request.view == "light" else _drawn(events, mount, request.view, span_us)
        caption = counted(len(events), "event") + (
            "" if found.rate_hz is None else f", {found.rate_hz:.3g} per pixel and s"
        )
        return Shown(mount.name, mount.kind, mount.size, _png(picture), caption, found)

    def _frame(self, mount: Mount, frames: list[Frame], notes: list[str]) -> Shown:
        spec = mount.sensor.spec
        assert isinstance(spec, CisSpec)
        exposures = list(mount.cis(self._threads).run(frames))
        caption = f"{spec.exposure_us / 1000:g} ms, {spec.frame_rate_hz:g} frames a second"
        if not exposures:
            notes.append(f"{mount.name} has no frame here: an exposure takes longer than the preview")
            return Shown(
                mount.name, mount.kind, mount.size, _png(_lit(frames[-1].light)), f"light; no frame of {caption}"
            )
        return Shown(mount.name, mount.kind, mount.size, _png(spec.picture_codes()[exposures[-1].codes]), caption)

    def _course(self, light: Light, request: Request, sensors: Mapping[int, DvsSpec]) -> Course | None:
        number, x, y = request.pixel or (-1, 0, 0)
        if number not in sensors or not self._kernels.there(sensors[number], 0.0):
            return None
        mount = _with(light.recipe.mounts[number], sensors[number])
        if x >= mount.size[0] or y >= mount.size[1]:
            return None
        frames = [instant.frames[number] for instant in light.instants]
        return course_of(mount.dvs(threads=self._threads), frames, (x, y)).since(light.lead)


def plans_of(light: Light, number: int, check: Callable[[], None]) -> Plans:
    """What of its sensors the light of a preview calls for; `check` may raise."""
    look = Look(light.recipe, usable_cores())
    for instant in light.instants:
        check()
        look.see(instant)
    return Plans(number, look.plans("auto", TOLERANCE))


def _with(mount: Mount, spec: DvsSpec) -> Mount:
    return replace(mount, sensor=mount.sensor._replace(spec=spec))


def _drawn(events: Events, mount: Mount, view: str, span_us: tuple[int, int]) -> np.ndarray:
    shown = parse_representation(VIEWS[view])(mount.size)
    shown.add(events, *span_us)
    return shown.picture(shown.take(span_us[1]))


def _lit(light: Any) -> np.ndarray:
    return srgb_codes(np.asarray(light))


def _png(picture: np.ndarray) -> bytes:
    """R'G'B' or gray uint8 as PNG."""
    done, coded = cv2.imencode(".png", picture[..., ::-1] if picture.ndim == 3 else picture)
    assert done
    return coded.tobytes()
