"""The event camera that looks at films, and what it and the frame camera see, frame by frame."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from interp.data.chance import chance
from interp.data.sensor_ranges import SENSORS
from interp.own_codes import codes_of, curve_of
from vid2ev import Dvs, DvsSpec, Events, load_sensor, open_source
from vid2ev.rig.camera import default_rig
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import scene_behind
from vid2ev.sources import is_scene
from vid2ev.sources.source import Source
from vid2ev.toml_text import toml_value

SCENE_HZ = 240.0  # of the truth of scenes, unless told otherwise
DENSER = 4  # instants of a scene's light for each frame of the truth


class Seen(NamedTuple):
    """A frame of a film.

    codes    by the film's curve (`interp.own_codes`), uint8 [H, W, 3]
    t_us     its time
    events   since the frame before
    shot     whether a new shot has begun since then
    """

    codes: np.ndarray
    t_us: int
    events: Events
    shot: bool


@dataclass(frozen=True)
class Simulated:
    """The event camera that looks at films.

    spec      its parameters
    name      what they were found by
    seed      of its noise
    options   of `open_source`
    threads   that render scenes; None for all cores.  They change nothing but the time it takes
    """

    spec: DvsSpec
    name: str = "clean"
    seed: int = 0
    options: dict[str, Any] = field(default_factory=dict)
    threads: int | None = None

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
        options = {name: str(value) if isinstance(value, Fraction) else value for name, value in self.options.items()}
        return {"name": self.name, "seed": self.seed, "parameters": self.spec.model_dump(mode="json")} | options

    def edited(self, video: str) -> dict[str, Any]:
        """The options of `open_source` for a film."""
        return ({"fps": SCENE_HZ} if is_scene(video) else {}) | self.options

    def opened(self, video: str) -> Source:
        """A film as it is looked at."""
        film = open_source(video, colour="rgb", **self.edited(video))
        if scene := scene_behind(film):
            scene.world.threads = self.threads
        return film

    def seen(self, video: str, film: Source) -> Generator[Seen]:
        """The frames of a film that is `opened`, all originals, with the events of the light of all of them and in
        between: those that `vid2ev convert` writes."""
        edited = self.edited(video)
        denser = {"fps": DENSER * edited["fps"]} if is_scene(video) else {}
        # (where the frames are from, whatever cameras a scene comes with)
        recipe = Recipe.of(video, self.spec, seed=self.seed, rig=default_rig(), **(edited | denser))
        dvs, curve = recipe.mounts[0].dvs(), curve_of(film.describe())
        with closing(instants(recipe, threads=self.threads)) as light:
            for frame in film.frames():
                yield Seen(codes_of(frame.light, curve), frame.t_ns // 1000, *_until(frame.t_ns, light, dvs))


def _until(t_ns: int, light: Iterator[Instant], dvs: Dvs) -> tuple[Events, bool]:
    """What an event camera sends up to an instant, and whether a new shot begins before it or there."""
    sent, shot = [Events.empty()], False
    for instant in light:
        sent.append(dvs.see(instant.frames[0]))
        shot |= instant.cut
        if instant.t_ns >= t_ns:
            break
    return Events.concatenate(sent), shot
