"""What a data set is: which recordings, seen by which cameras; one frozen record, from which all of them follow.

A scene of the data set is a short recording: some frames of a frame camera, an event camera that may stand beside it,
and a third camera, in the place of the first, that sees instants without noise at many times its rate: the truth.  The
frame camera's exposures have their middles at instants of the truth.

Source of the preset `paper`: the paper, Table I and section III.B.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from interp.data.chance import chance, uniform
from interp.data.sensor_ranges import SENSORS, SensorRanges
from interp.data.video_shots import length_of
from vid2ev import CisSpec, DataError, DvsSpec, UsageError, load_cis, load_sensor, open_source
from vid2ev.errors import Vid2evError
from vid2ev.rig.camera import Camera, Rig
from vid2ev.scenes.scene_file import scene_names
from vid2ev.sources import begins_s, is_single_picture, short_name
from vid2ev.sources.cut import FASTEST, SLOWEST
from vid2ev.sources.source import LARGEST
from vid2ev.sources.times import SLOWEST_HZ
from vid2ev.terminal import counted

Side = Annotated[int, Field(ge=1, le=LARGEST)]
Layout = Literal["own", "hsergb", "bsergb"]
EDGES_S = 0.022  # of a scene's light more than its exposures take: instants may be 10 ms apart, at both ends
EDGES = 2.2  # the same of films, in frames


class DatasetSpec(BaseModel):
    """What a data set holds.  Raises `pydantic.ValidationError` for what does not go together."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    layout: Layout = Field(default="own", description="own, hsergb or bsergb")
    preset: Literal["varied", "paper"] = Field(default="varied", description="of the sensors and rates")
    count: int | None = Field(default=None, ge=1, le=10**6, description="scenes; left out, of videos all they have")
    seed: int = Field(default=0, ge=0, lt=1 << 62, description="which of all such data sets")
    size: tuple[Side, Side] = Field(default=(640, 480), description="of the frames of rendered scenes [px]")
    videos: tuple[str, ...] = Field(default=(), description="real videos, in place of rendered scenes")
    slowdown: float = Field(
        default=1.0, ge=FASTEST, le=SLOWEST, description="how many times slower than the world these play"
    )
    fps: float | None = Field(
        default=None, ge=SLOWEST_HZ, le=1e9, description="of these, in place of their own times [Hz]"
    )
    frames: int = Field(default=7, ge=2, le=10**6, description="of the frame camera, in a scene")
    cis_fps: float = Field(default=30.0, ge=0.01, le=30_000, description="of the frame camera [Hz]")

    @model_validator(mode="after")
    def _fits(self) -> DatasetSpec:
        if self.slowdown != 1 and not self.videos:
            raise ValueError(f"slowdown {self.slowdown:g} without videos; name some with --from, or leave it out")
        if self.fps is not None and not self.videos:
            raise ValueError(f"fps {self.fps:g} without videos; name some with --from, or leave it out")
        if "size" in self.model_fields_set and self.videos:
            width, height = self.size
            raise ValueError(f"size {width}x{height} of videos, which are seen as they are; leave it out")
        return self

    @property
    def multiple(self) -> int:
        """Frames of truth for each of the frame camera."""
        return 32 if self.preset == "paper" else 8

    @property
    def baseline_mm(self) -> float:
        """How far the event camera may stand from the frame camera: in the same place where nobody knows how far things
        are, or the layout has one place."""
        return 0.0 if self.videos or self.layout != "own" else 15.0

    @property
    def sensors(self) -> SensorRanges:
        """What sensors are drawn from."""
        return SENSORS["paper" if self.preset == "paper" else "default"]


@dataclass(frozen=True)
class Scene:
    """One recording of a data set: `name`, and the arguments of `vid2ev.convert`."""

    name: str
    video: str
    options: dict[str, Any]


def scenes_of(spec: DatasetSpec) -> tuple[list[Scene], dict[str, str]]:
    """All recordings of a data set; and the videos of which there are none, each with the reason.

    Raises UsageError, DataError where there is none at all.
    """
    if spec.videos:
        return _of_videos(spec)
    return [_rendered(spec, k) for k in range(spec.count or DEFAULT[spec.preset])], {}


DEFAULT = {"varied": 8, "paper": 180}  # scenes; the second as in Table I


def _rendered(spec: DatasetSpec, number: int) -> Scene:
    """A rendered scene: the eight in turn, each time another of its kind."""
    from vid2ev.scenes.scene_file import read_scene

    draw, names = chance(spec.seed, "dataset", number), scene_names()
    name, seed = names[number % len(names)], int(draw.integers(1 << 62))
    rig, exposure_s = _rig(spec, number)
    length_s = (spec.frames - 1) / spec.cis_fps + exposure_s + EDGES_S
    duration_s = read_scene(name).resolved(seed).scene.duration_s
    if length_s > duration_s:
        asked = f"{counted(spec.frames, 'frame')} at {spec.cis_fps:g} Hz"
        raise UsageError(f"{asked}: the scene {name} is too short; ask for fewer")
    start_s = round(uniform(draw, (0.0, duration_s - length_s)), 6)
    options = {"rig": rig, "start": start_s, "stop": round(start_s + length_s, 9), "seed": int(draw.integers(1 << 62))}
    return Scene(f"{name}-{number:05d}", f"scene:{name},seed={seed},size={spec.size[0]}x{spec.size[1]}", options)


def _of_videos(spec: DatasetSpec) -> tuple[list[Scene], dict[str, str]]:
    """Parts of videos, one after the other; of more than are asked for, as even a choice as can be."""
    found, refused = list[Scene](), dict[str, Vid2evError]()
    for place, video in enumerate(spec.videos):
        try:
            found += _parts(spec, place, video)
        except (UsageError, DataError) as error:
            refused[video] = error
    if not found:
        raise next(iter(refused.values()))
    wanted = min(spec.count or len(found), len(found))
    reasons = {video: str(why).removeprefix(f"{video}: ") for video, why in refused.items()}
    return [found[k * len(found) // wanted] for k in range(wanted)], reasons


def _parts(spec: DatasetSpec, place: int, video: str) -> Iterator[Scene]:
    """Of one video."""
    if is_single_picture(Path(video)):
        raise UsageError(f"{video}: a single picture; give a video, or a folder that holds a sequence of pictures")
    source = open_source(video, fps=spec.fps)
    count, seconds = length_of(source, video)
    frame_s = seconds / max(count, 1)
    rig, exposure_s = _rig(spec, place)
    length_s = ((spec.frames - 1) / spec.cis_fps + exposure_s) * spec.slowdown + EDGES * frame_s
    if seconds < length_s:
        slower = f", or a smaller --slowdown than {spec.slowdown:g}" * (spec.slowdown > 1)
        raise UsageError(
            f"{video}: {seconds:.3g} s, expected at least {length_s:.3g} s for {counted(spec.frames, 'frame')}; give a"
            f" longer video{slower}, or leave this one out"
        )
    begin_s = begins_s(source)  # (of films cut out of others it is not 0, and start and stop are by their clock)
    for part in range(math.floor(seconds / length_s)):
        start_s = round(begin_s + part * length_s, 6)
        options = {"rig": rig, "start": start_s, "stop": round(start_s + length_s, 9)}
        options |= {"slowdown": spec.slowdown, "fps": spec.fps}
        name = f"{short_name(video)}-{place:03d}-{part:05d}"
        yield Scene(name, video, options | {"seed": int(chance(spec.seed, name).integers(1 << 62))})


def _rig(spec: DatasetSpec, number: int) -> tuple[Rig, float]:
    """The cameras of a recording, and the exposure [s] of the frame camera."""
    draw, ranges = chance(spec.seed, "rig", number), spec.sensors
    truth_fps = spec.multiple * spec.cis_fps
    halves = 2 if spec.preset == "paper" else int(draw.integers(2))  # steps of the truth in half an exposure
    clock = {"frame_rate_hz": spec.cis_fps, "burst": spec.frames}
    cis = ranges.cis(draw, 1_000_000, 2e6 * halves / truth_fps).model_copy(update=clock)
    truth = cis.sampling(truth_fps, spec.frames * spec.multiple)  # (not on to where the next exposure would be)
    distance_mm, angle = uniform(draw, (0.0, spec.baseline_mm)), draw.uniform(0, 2 * math.pi)
    place = (distance_mm * math.cos(angle), distance_mm * math.sin(angle), 0.0)
    cameras = (
        Camera(
            name="dvs", kind="dvs", translation_mm=place, sensor="paper", set=_changes(ranges.dvs(draw), load_sensor)
        ),
        Camera(name="cis", kind="cis", sensor="paper", set=_changes(cis, load_cis)),
        Camera(name="instants", kind="cis", sensor="paper", set=_changes(truth, load_cis)),
    )
    return Rig(cameras=cameras), 2 * halves / truth_fps


def _changes(spec: DvsSpec | CisSpec, load: Any) -> dict[str, Any]:
    """What of the preset `paper` has to be changed to be this sensor."""
    paper = load("paper").model_dump()
    return {key: value for key, value in spec.model_dump().items() if value != paper[key]}
