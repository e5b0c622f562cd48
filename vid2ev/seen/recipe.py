"""What decides a recording: a source of light, made denser in time, and the cameras that look at it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import MISSING, asdict, dataclass, fields, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, Literal

from vid2ev.errors import UsageError, check_names
from vid2ev.formats import recognise
from vid2ev.physics.bayer import check_pattern
from vid2ev.recording import exposures
from vid2ev.recording.manifest import identity, is_recording, versions
from vid2ev.requests import names_in
from vid2ev.rig.camera import ResolvedRig, Rig, default_rig
from vid2ev.rig.depth import plane_of
from vid2ev.rig.intrinsics import Framing
from vid2ev.rig.rig_file import read_rig
from vid2ev.seen.mounts import Mount, Sensors, mounts_of
from vid2ev.seen.sight import are_free, lens_of, scene_of, staged, taken_by
from vid2ev.seen.truth import USUAL_HZ, Wanted
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.devices import STEPS_OF_FLOW, Work
from vid2ev.sensors.limits import check_seed
from vid2ev.sensors.presets import PRESET
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sources import OPTIONS, SCENE_PREFIX, Source, is_scene, open_source
from vid2ev.sources.framing import framing_of
from vid2ev.stream.upload import Upload
from vid2ev.upsample import Upsampler, make_upsampler

THRESHOLD = 0.15  # nat, where there are frame cameras only

CUTS = ("restart", "keep")
OF_SOURCE = tuple(name for name in OPTIONS if name != "colour")  # (which cameras decide)
RAW = exposures.KINDS["raw"]


@dataclass(frozen=True)
class Recipe:
    """Everything that decides a recording; the same recipe, the same events and frames.

    video          what the source was opened by
    rig            where they stand
    mounts         the cameras
    depth          how far the scene is, in a text; None where no camera needs to know, and of scenes
    upsample       how light is made between frames: none, linear, flow, or what other packages add
    subframes      intervals that a source interval becomes: "auto" (by motion and contrast), or a number
    max_subframes  the most that "auto" may take
    seed           of the sensors that have none of their own, 0 ... 2**64 - 1
    labels         give each event its cause
    cuts           "restart": event cameras start afresh after a cut, and "keep": they see a step of light
    bayer          the pattern of colour filters before the pixels of event cameras; None for none: they see luminance
    truth          what is to be known for certain beside it
    """

    video: str
    source: Source
    rig: ResolvedRig
    mounts: tuple[Mount, ...]
    depth: str | None = None
    upsample: str = "flow"
    subframes: int | Literal["auto"] = "auto"
    max_subframes: int = 64
    seed: int = 0
    labels: bool = False
    cuts: Literal["restart", "keep"] = "restart"
    bayer: str | None = None
    truth: Wanted | None = None

    @classmethod
    def of(
        cls,
        video: str | Path,
        sensor: str | Path | DvsSpec = PRESET,
        overrides: Sequence[str] = (),
        *,
        cis: str | Path | CisSpec | None = None,
        frame_camera: bool = False,
        rig: str | Path | Rig | None = None,
        depth: str | Path | None = None,
        truth: str | Sequence[str] = (),
        truth_rate_hz: float = USUAL_HZ,
        **rest: Any,
    ) -> Recipe:
        """The recipe for a video and its cameras, with everything checked that can be before the first frame.

        video      a video file, a folder of images, an array file, `synthetic:NAME` or `scene:NAME`
        sensor     of event cameras that name none: a preset, a TOML file, or a specification
        overrides  `key=value` texts that change presets or files; keys of frame sensors begin with `cis.`
        cis        the same of frame cameras, of which a rig has to have some; without a rig there is then one, as with
                   `frame_camera`
        frame_camera   put a frame camera where the video was taken, if the rig has none
        rig        the cameras: a rig file, or what is in one; without it that of a scene, or else an event camera where
                   the video was taken
        depth      how far the scene is, as `rig.depth` has it; needed where cameras stand elsewhere
        truth      some of `truth.KINDS`, to be written so many times a second
        The rest are the options of `open_source` and the fields above.  Raises UsageError, DataError.
        """
        check_names(rest, cls.options())
        check_seed(seed := rest.get("seed", 0))
        if (pattern := rest.get("bayer")) is not None:
            rest["bayer"] = check_pattern(str(pattern).upper())
        refuse_recordings(Path(video), rest.get("transfer", "auto"))
        rig = _rig_of_scene(str(video)) if rig is None else rig
        asked = read_rig(rig) if isinstance(rig, str | Path) else rig or default_rig(frames=cis is not None)
        asked = asked.with_frames() if frame_camera else asked
        alone = rig is None and len(asked.cameras) == 1
        chosen = Sensors(sensor, PRESET if cis is None else cis, overrides)
        chosen.check_cameras(asked.cameras, cis is not None)
        if not truth and truth_rate_hz != USUAL_HZ:
            raise UsageError(
                f"truth at {truth_rate_hz:g} Hz: expected some to be written; add --truth, or leave it out"
            )
        of = partial(chosen.of_file, file=rig) if isinstance(rig, str | Path) else chosen.of
        sensors = [of(camera) for camera in asked.cameras]
        coloured = pattern is not None or any(each.colour for each in sensors)
        maps = None if depth is None or plane_of(depth) is not None else partial(_with_depth, str(depth), asked)
        options = {key: rest.pop(key) for key in OF_SOURCE if key in rest} | {"seen_through": maps}
        source = open_source(video, colour="rgb" if coloured else "luminance", **options)
        if source.dense:
            make_upsampler(rest.get("upsample", "flow"))  # (which is refused though it is not needed)
            rest |= {"upsample": "none"}
        scene = scene_of(source)
        resolved = asked.around(taken_by(source)).resolved(source.size, lens_of(source), framing_of(source))
        mounts = mounts_of(resolved, sensors, seed, alone)
        if scene:
            scene.watched_by(mount.view for mount in mounts)
        wanted = Wanted(names_in(truth), truth_rate_hz) if truth else None
        depth = None if depth is None else str(depth)
        recipe = cls(str(video), source, resolved, mounts, depth, truth=wanted, **rest)
        recipe.check()
        return recipe

    @classmethod
    def options(cls) -> tuple[str, ...]:
        """What `of` takes by name."""
        own = [name for name, each in signature(cls.of).parameters.items() if each.kind is each.KEYWORD_ONLY]
        return *own, *OF_SOURCE, *(each.name for each in fields(cls) if each.default is not MISSING)

    def check(self) -> None:
        """Raise UsageError for what does not go together."""
        self.upsampler()
        if self.upsample == "none" and self.subframes not in ("auto", 1):
            none = "a source that is as dense as light asks" if self.source.dense else "upsampling 'none'"
            raise UsageError(f"subframes {self.subframes} with {none}: nothing is made between frames; leave it out")
        if self.cuts not in CUTS:
            raise UsageError(f"cuts '{self.cuts}': expected one of {', '.join(CUTS)}")
        if not isinstance(self.labels, bool):
            raise UsageError(f"labels {self.labels!r}: expected True or False")
        kinds = {*self.truth.kinds} if self.truth else set()
        if "map" in kinds and len(self.mounts) == 1:
            raise UsageError("truth 'map' is of pixels in other cameras, and there is one; leave it out, or add --rig")
        if self.source.dense:
            if self.depth is not None:
                raise UsageError(f"depth '{self.depth}' of a scene, which knows its own; leave --depth out")
            if self.rendered:
                staged(self.source)
            return
        if self.plane_m is None and self.depth is not None and self.source.describe().get("kind") == "photograph":
            raise UsageError(f"depth '{self.depth}' of a photograph that moves: expected plane:METRES")
        if "flow" in kinds:
            raise UsageError("truth 'flow' of a video is known to nobody: expected a scene; leave it out")
        if self.depth is None and kinds & {"depth", "map"}:
            raise UsageError("truth 'depth' and 'map' need to know how far the video's scene is; add --depth")
        away = next((mount for mount in self.mounts if mount.pose.translation_m.any()), None)
        if self.depth is not None and away is None and not kinds & {"depth", "map"}:
            raise UsageError(
                f"depth '{self.depth}': all cameras stand where the video's does, and see the same at any depth; leave"
                " --depth out, or add --rig with a camera beside it, or --truth depth"
            )
        if self.depth is None and away is not None:
            raise UsageError(
                f"camera {away.name} stands beside the video's, and how far the scene is was not said; add --depth"
                " plane:METRES, a depth map or a folder of them"
            )

    def of_events(self) -> Recipe:
        """The recipe without frame cameras and truth: of the event cameras, which send the same."""
        both = zip(self.rig.viewpoints, self.mounts, strict=True)
        views, mounts = zip(*((view, mount) for view, mount in both if mount.kind == "dvs"), strict=True)
        return replace(self, rig=replace(self.rig, viewpoints=views), mounts=mounts, truth=None)

    def upsampler(self, upload: Upload | None = None) -> Upsampler:
        """A new upsampler, which makes light on a device if there is an `upload` to it."""
        return make_upsampler(self.upsample, self.subframes, self.max_subframes, self.threshold, upload)

    @property
    def work(self) -> Work:
        """What it takes, as far as that is known before the first frame."""
        steps = float(self.subframes) if self.subframes != "auto" else min(STEPS_OF_FLOW, self.max_subframes)
        if self.upsample == "none" or (self.upsample == "linear" and self.subframes == "auto"):
            steps = 1.0
        pixels = sum(mount.size[0] * mount.size[1] for mount in self.mounts)
        return Work(pixels, self.source.frames_expected, steps)

    @property
    def plane_m(self) -> float | None:
        """How far the scene is, if it is a plane [m]."""
        return None if self.depth is None else plane_of(self.depth)

    @property
    def threshold(self) -> float:
        """The least contrast threshold of all sensors [nat]."""
        specs = [mount.sensor.spec for mount in self.mounts]
        events = [spec for spec in specs if isinstance(spec, DvsSpec)]
        return min((min(spec.threshold_on, spec.threshold_off) for spec in events), default=THRESHOLD)

    @property
    def rendered(self) -> bool:
        """Whether a scene is rendered for each camera; with truth, a scene of which all is seen is."""
        if not self.source.dense:
            return False
        free = are_free(self.rig.source, self.mounts)
        return not free or (self.truth is not None and scene_of(self.source) is not None)

    @property
    def alone(self) -> bool:
        """Whether there is one camera, whose files lie in the folder of the recording itself."""
        return not self.mounts[0].name

    def describe(self) -> dict[str, Any]:
        """The recipe as JSON: what the manifest says of it, and by which a run is known again."""
        if self.alone:
            return self.describe_camera(self.mounts[0])
        rig = {"rig": self.rig.describe(), "depth": self.depth, "seed": self.seed}
        cameras = {mount.name: mount.describe() for mount in self.mounts}
        return plain(self._shared() | rig | {"cameras": cameras, "bayer": self.bayer, "labels": self.labels})

    def describe_camera(self, mount: Mount) -> dict[str, Any]:
        """What the manifest of a camera says."""
        name = {} if self.alone else {"camera": mount.name}
        sensor = mount.describe() | ({"bayer": self.bayer} if mount.kind == "dvs" else {})
        return plain(self._shared() | name | {"sensor": sensor, "seed": mount.seed, "labels": self.labels})

    def _shared(self) -> dict[str, Any]:
        """What is the same for all cameras."""
        path = Path(self.video)
        name = os.path.basename(os.path.abspath(path))  # (one may be in the folder that it is)
        known_by = {"path": name, **identity(path)} if os.path.exists(path) else {"path": self.video}
        upsampling = {"method": self.upsample, "subframes": self.subframes, "max_subframes": self.max_subframes}
        upsampling |= getattr(self.upsampler(), "about", {})
        truth = {"truth": asdict(self.truth)} if self.truth else {}
        return {
            "versions": versions(),
            "source": self.source.describe() | known_by,
            "upsampling": upsampling | {"cuts": self.cuts},
        } | truth


def _rig_of_scene(video: str) -> str | None:
    """The rig that a scene comes with."""
    from vid2ev.scenes.source import rig_of_scene

    return rig_of_scene(video.removeprefix(SCENE_PREFIX)) if is_scene(video) else None


def _with_depth(text: str, rig: Rig, source: Source, framing: Framing | None) -> Source:
    """A source with its depth, which may need to know how wide the source sees: as a rig says it of what is framed."""
    from vid2ev.sources.with_depth import WithDepth, parse_depth

    lens = rig.around(taken_by(source)).source.intrinsics_before(framing, source.size)
    return WithDepth(source, parse_depth(text, lens), text)


def plain(facts: dict[str, Any]) -> dict[str, Any]:
    """The facts as they come out of a JSON file."""
    return json.loads(json.dumps(facts))


def holds_adc_codes(path: Path) -> bool:
    """Whether it is the folder of a frame camera's codes."""
    folder = path.absolute()  # (one may be in it)
    return folder.name == RAW and is_recording(folder.parent)


def refuse_recordings(path: Path, transfer: str = "auto") -> None:
    """Raise UsageError for what holds events already, and for frames that would be taken for something else."""
    if is_scene(str(path)):  # (whose settings may be longer than any name of a file)
        return
    if holds_adc_codes(path) and transfer == "auto":
        raise UsageError(
            f"{path} holds codes of a sensor's ADC, not pictures; --cis-out png makes frames/, which can be converted,"
            " --transfer linear takes the codes for light"
        )
    if is_recording(path):
        if (path / "frames").is_dir():
            raise UsageError(f"{path} is a recording already; its frames can be converted: {path / 'frames'}")
        raise UsageError(
            f"{path} is a recording already; `vid2ev render` shows its events, `vid2ev reformat` turns them into"
            " another format"
        )
    if path.is_file() and (kind := recognise(path)):
        raise UsageError(
            f"{path} is an event file ({kind.name}) already; `vid2ev render` shows it, `vid2ev reformat` turns it into"
            " another format"
        )
