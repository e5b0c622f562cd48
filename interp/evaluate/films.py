"""Videos and rendered scenes as footage: frames are dropped, and the event camera sees the light of all of them.

Truth are original frames and nothing else; light between them, for the event camera, is carried along the motion, as
`vid2ev convert` does it.  A video is gone through once, a group at a time.

Source of 240 frames a second: those of the data that the field is scored on, HS-ERGB (150 and more) and GoPro (240).
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interp.data.chance import chance
from interp.data.sensor_ranges import SENSORS
from interp.evaluate.group import Cameras, Group
from interp.evaluate.identity import contents
from interp.evaluate.protocol import Protocol
from interp.representation.event_counts import count_events
from vid2ev import Dvs, DvsSpec, Events, load_sensor, open_source
from vid2ev.errors import DataError
from vid2ev.instants import Instant, instants
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.recipe import Recipe
from vid2ev.sources import is_scene
from vid2ev.toml_text import toml_value

SLOW_HZ = 240.0
DENSER = 4  # instants of a scene's light for each frame of the truth


@dataclass(frozen=True)
class Simulated:
    """The event camera that looks at films.

    spec      its parameters
    name      what they were found by
    seed      of its noise
    options   of `open_source`
    """

    spec: DvsSpec
    name: str = "clean"
    seed: int = 0
    options: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, sensor: str | Path, overrides: Sequence[str] = (), seed: int = 0, **options: Any) -> Simulated:
        """The sensor of a name: `clean` and `noisy` of `interp.data.sensor_ranges`, and those of `load_sensor`.

        Raises UsageError, DataError.
        """
        if str(sensor) not in ("clean", "noisy"):
            return cls(load_sensor(sensor, overrides), str(sensor), seed, options)
        values = SENSORS[str(sensor)].dvs(chance(0, "sensor")).model_dump()
        plain = [f"{key}={toml_value(value)}" for key, value in values.items()]
        return cls(load_sensor("paper", [*plain, *overrides]), str(sensor), seed, options)

    def describe(self) -> dict[str, Any]:
        """It as JSON."""
        return {"name": self.name, "seed": self.seed, "parameters": self.spec.model_dump(mode="json")} | self.options


class Film:
    """A video, or `scene:NAME`, of which frames are dropped.

    name    by which it is called
    limit   groups that are scored, from the first on; None for all
    Raises UsageError for a source that is not there, or is a recording, DataError for one that cannot be read.
    """

    def __init__(self, video: str, protocol: Protocol, name: str, simulated: Simulated, limit: int | None = None):
        self.name, self.video, self._protocol, self._limit = name, video, protocol, limit
        self.multiple = protocol.multiple
        self._simulated, self._options = simulated, dict(simulated.options)
        self._scene = is_scene(video)
        if self._scene:
            self._options.setdefault("fps", SLOW_HZ)
        truth = open_source(video, colour="rgb", **self._options)
        self.size, self.frames = truth.size, truth.frames_expected or 0
        count = max(self.frames - 1, 0) // protocol.multiple
        self.expected = count if limit is None else min(count, limit)
        path = Path(video)
        self.identity = {"video": path.name, **contents(path)} if path.exists() else {"video": video}
        self._known: dict[str, Any] = {}

    def groups(self) -> Iterator[Group]:
        """See `interp.evaluate.group.Footage`; groups across a cut are counted."""
        multiple, unscored, number, first = self._protocol.multiple, dict[str, int](), 0, 0
        codes, times_us, remarks = list[np.ndarray](), list[int](), list[str]()
        waiting, shots, scored, seen = Events.empty(), 0, 0, 0
        try:
            with closing(self._seen()) as stream:
                for picture, t_us, events, shot in stream:
                    codes.append(picture)
                    times_us.append(t_us)
                    seen += 1
                    if len(codes) > 1:
                        waiting, shots = Events.concatenate([waiting, *events]), shots + shot
                    if len(codes) <= multiple:
                        continue
                    if shots:
                        unscored["a cut between the key frames"] = unscored.get("a cut between the key frames", 0) + 1
                    else:
                        yield self._group(number, first, codes, times_us, waiting)
                        scored += 1
                    later = waiting.t > times_us[-1]
                    waiting = Events(*(getattr(waiting, column)[later] for column in ("t", "x", "y", "p")))
                    number, first, shots = number + 1, first + multiple, 0
                    codes, times_us = codes[-1:], times_us[-1:]
                    if scored == self._limit:
                        remarks.append(f"limited to the first {self._limit} groups")
                        break
        except DataError as error:
            remarks.append(f"ended early: {error}")
        if left := len(codes) - 1:
            remarks.append(f"{left} frames after the last complete group of {multiple} are not rebuilt")
        self._known = {"frames": seen, "groups": scored, "not_scored": unscored, "remarks": remarks}

    def about(self) -> dict[str, Any]:
        """See `interp.evaluate.group.Footage`."""
        source = open_source(self.video, **self._options)
        rate_hz = (self.frames - 1) / source.duration_expected_s if source.duration_expected_s else 0.0
        known = dict(self._known)
        if 0 < rate_hz < 0.98 * SLOW_HZ:
            known["remarks"] = [
                f"{rate_hz:.4g} frames a second, and frames that are dropped are scored: expected at least"
                f" {SLOW_HZ:g}, as between slower ones light is made up; give --slowdown if it plays slower than the"
                " world went",
                *known["remarks"],
            ]
        facts = {"kind": "scene" if self._scene else "video", "size": list(self.size), "rate_hz": round(rate_hz, 3)}
        return facts | {"event_size": list(self.size), "sensor": self._simulated.name} | known

    def _group(self, number: int, first: int, codes: list[np.ndarray], times_us: list[int], events: Events) -> Group:
        protocol, spec = self._protocol, self._simulated.spec
        start_us, stop_us = times_us[0], times_us[-1]
        contrast = spec.threshold_off, spec.threshold_on
        counts = count_events(events, self.size, start_us, stop_us, protocol.steps, contrast)
        keys, truth = np.stack([codes[0], codes[-1]]), np.stack([codes[k] for k in protocol.positions])
        cameras = Cameras(disparity_px=0.0, offset_us=0.0)  # (one place, one clock; how it was exposed, nobody knows)
        return Group(number, first, keys, protocol.positions, truth, np.array(times_us), counts, cameras)

    def _seen(self) -> Generator[tuple[np.ndarray, int, list[Events], bool]]:
        """Each frame of the truth in codes, its time [us], the events since the one before, and whether there was a
        cut."""
        options = dict(self._options)
        if self._scene:
            options["fps"] = DENSER * options["fps"]
        recipe = Recipe.of(self.video, self._simulated.spec, seed=self._simulated.seed, **options)
        dvs = recipe.mounts[0].dvs()
        with closing(instants(recipe)) as light:
            for frame in open_source(self.video, colour="rgb", **self._options).frames():
                events, shot = _until(frame.t_ns, light, dvs)
                yield srgb_codes(frame.light), frame.t_ns // 1000, events, shot


def _until(t_ns: int, light: Iterator[Instant], dvs: Dvs) -> tuple[list[Events], bool]:
    """What an event camera sends up to an instant, and whether a new shot begins before it or there."""
    events, shot = list[Events](), False
    for instant in light:
        events.append(dvs.see(instant.frames[0]))
        shot |= instant.cut
        if instant.t_ns >= t_ns:
            break
    return events, shot
