"""What decides a recording: a source of light, made denser in time, and the cameras that look at it."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

from vid2ev.errors import UsageError
from vid2ev.formats import recognise
from vid2ev.formats.event_file import Picture
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.mounts import Mount
from vid2ev.physics.bayer import check_pattern, mosaic
from vid2ev.recording.manifest import identity, versions
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.sensors.presets import load_sensor
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sources import OPTIONS, Source, open_source
from vid2ev.stream.events import Events
from vid2ev.stream.frames import Frame
from vid2ev.upsample import Interval, Upsampler, make_upsampler
from vid2ev.upsample.cuts import CutDetector
from vid2ev.upsample.none import NoUpsampling

FRAMES_AHEAD = 4  # made in advance, while the sensor works
INTERVALS_AHEAD = 2  # whose motion is known in advance

CUTS = ("restart", "keep")

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Instant:
    """What the cameras see at one instant of the source's clock: a frame for each, on its own clock.

    `original` and `cut` are those of the source's frame.  `limited` is the number of source intervals so far that hit
    `max_subframes`.
    """

    frames: tuple[Frame, ...]
    t_ns: int
    original: bool
    cut: bool
    limited: int


@dataclass(frozen=True)
class Recipe:
    """Everything that decides a recording; the same recipe, the same events and frames.

    video          what the source was opened by
    mounts         the cameras
    upsample       how light is made between frames: none, linear or flow
    subframes      intervals that a source interval becomes: "auto" (by motion and contrast), or a number
    max_subframes  the most that "auto" may take
    seed           of the sensors that have none of their own, 0 ... 2**64 - 1
    labels         give each event its cause
    cuts           "restart": event cameras start afresh after a cut, and "keep": they see a step of light
    bayer          the pattern of colour filters before the pixels; None for none: they see luminance
    """

    video: str
    source: Source
    mounts: tuple[Mount, ...]
    upsample: str = "flow"
    subframes: int | Literal["auto"] = "auto"
    max_subframes: int = 64
    seed: int = 0
    labels: bool = False
    cuts: Literal["restart", "keep"] = "restart"
    bayer: str | None = None

    @classmethod
    def of(
        cls,
        video: str | Path,
        sensor: str | Path | DvsSpec = "paper",
        overrides: Sequence[str] = (),
        **rest: Any,
    ) -> Recipe:
        """The recipe for a video and a sensor, with everything checked that can be before the first frame.

        video      a video file, a folder of images, an array file, or `synthetic:NAME`
        sensor     a preset, a TOML file, or a specification
        overrides  `key=value` texts that change a preset or file
        The rest are the options of `open_source` and the fields above.  Raises UsageError, DataError.
        """
        if isinstance(sensor, DvsSpec) and overrides:
            raise UsageError(
                f"overrides {list(overrides)}: expected a preset or file to change; change the specification"
            )
        spec = sensor if isinstance(sensor, DvsSpec) else load_sensor(sensor, overrides)
        name = "own" if isinstance(sensor, DvsSpec) else str(sensor)
        seed = rest.get("seed", 0)
        if not 0 <= seed < 1 << 64:
            raise UsageError(f"seed {seed}: expected a whole number from 0 to 2**64 - 1")
        if rest.get("bayer"):
            rest["colour"], rest["bayer"] = "rgb", check_pattern(rest["bayer"].upper())
        refuse_recordings(Path(video))
        source = open_source(video, **{key: rest.pop(key) for key in OPTIONS if key in rest})
        mounts = (Mount("", 0, name, spec, seed, Intrinsics.of_field(source.size)),)
        recipe = cls(str(video), source, mounts, **rest)
        recipe.upsampler()  # (refuses what cannot be)
        if recipe.cuts not in CUTS:
            raise UsageError(f"cuts '{recipe.cuts}': expected one of {', '.join(CUTS)}")
        return recipe

    def upsampler(self) -> Upsampler:
        """A new upsampler."""
        return make_upsampler(self.upsample, self.subframes, self.max_subframes, self._threshold)

    @property
    def _threshold(self) -> float:
        """The least contrast threshold of all sensors [nat]."""
        return min(
            threshold for mount in self.mounts for threshold in (mount.spec.threshold_on, mount.spec.threshold_off)
        )

    def instants(self, start: int = 0) -> Generator[Instant]:
        """What is seen at source frame `start`, and at all frames after it, those in between too.  Two threads make the
        frames, a little in advance: one looks for motion, the other carries light along it."""
        return _ahead(self._instants(start), FRAMES_AHEAD)

    def _instants(self, start: int) -> Generator[Instant]:
        limited = 0
        with closing(_ahead(self._intervals(start), INTERVALS_AHEAD)) as intervals:
            for interval in intervals:
                limited += interval.limited
                for frame in interval:
                    yield Instant((self._filtered(frame),), frame.t_ns, frame.original, frame.cut, limited)

    def _filtered(self, frame: Frame) -> Frame:
        return frame if self.bayer is None else replace(frame, light=mosaic(frame.light, self.bayer))

    def _intervals(self, start: int) -> Generator[Interval]:
        """The frame `start` by itself, and each interval after it."""
        upsampler, straight = self.upsampler(), NoUpsampling()
        cuts = CutDetector(self._threshold)
        before: Frame | None = None
        # (whether there is a cut after frame `start` depends on the frame before it, too)
        for index, frame in enumerate(self.source.frames(max(start - 1, 0)), max(start - 1, 0)):
            cut = before is not None and cuts.begins_shot(before, frame) and self.cuts == "restart"
            if index == start:
                yield Interval(iter([frame]))
            elif before is not None and index > start:
                method = straight if cuts.unrelated else upsampler
                yield method.between(before, replace(frame, cut=cut))
            before = frame

    def pictures(self) -> Iterator[Picture]:
        """The frames of the source, read again, in 8 bits of sRGB: to be kept beside the events."""
        for frame in self.source.frames():
            yield Picture(frame.t_ns // 1000, srgb_codes(frame.light))

    def describe(self) -> dict[str, Any]:
        """The recipe as JSON: what the manifest says of it, and by which a run is known again."""
        path = Path(self.video)
        known_by = {"path": path.name, **identity(path)} if path.exists() else {"path": self.video}
        return json.loads(
            json.dumps(
                {
                    "versions": versions(),
                    "source": self.source.describe() | known_by,
                    "upsampling": {
                        "method": self.upsample,
                        "subframes": self.subframes,
                        "max_subframes": self.max_subframes,
                        "cuts": self.cuts,
                    },
                    "sensor": self.mounts[0].describe() | {"bayer": self.bayer},
                    "seed": self.seed,
                    "labels": self.labels,
                }
            )
        )


def refuse_recordings(path: Path) -> None:
    """Raise UsageError for what holds events already, and no frames."""
    if (path / "manifest.json").is_file():
        what = "a recording"
    elif path.is_file() and (kind := recognise(path)):
        what = f"an event file ({kind.name})"
    else:
        return
    raise UsageError(
        f"{path} is {what} already; `vid2ev render` shows it, `vid2ev reformat` turns it into another format"
    )


def events_of(
    video: str | Path,
    sensor: str | Path | DvsSpec = "paper",
    overrides: Sequence[str] = (),
    *,
    threads: int = 1,
    **rest: Any,
) -> Iterator[Events]:
    """The events of a video, those that `convert` writes: one Events for each frame and sub-frame, the empty ones too.

    The arguments are those of `Recipe.of`, and the `threads` of the sensor.  What is impossible is refused at once.
    """
    recipe = Recipe.of(video, sensor, overrides, **rest)
    dvs = recipe.mounts[0].dvs(recipe.labels, threads)
    return dvs.run(instant.frames[0] for instant in recipe.instants())


def _ahead(items: Generator[T], depth: int) -> Generator[T]:
    """The items, made by a second thread up to `depth` in advance; an error comes out in the place of its item."""
    with ThreadPoolExecutor(1) as pool, closing(items):
        end = object()
        pending = deque(pool.submit(next, items, end) for _ in range(depth))
        try:
            while (item := pending.popleft().result()) is not end:
                pending.append(pool.submit(next, items, end))
                yield item  # type: ignore[misc]
        finally:
            pool.shutdown(cancel_futures=True)
