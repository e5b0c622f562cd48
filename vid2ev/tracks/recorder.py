"""What grows while a recording is made: a track for every camera; all with one checkpoint, so that whatever is
interrupted fits together again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.recording.folder import Folder
from vid2ev.recording.preview import rate_for
from vid2ev.rig.rig_file import is_file, rig_text, write_text
from vid2ev.seen.instants import Instant, pictures
from vid2ev.seen.mounts import Mount
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import sees_nothing
from vid2ev.sensors.devices import CPU, Device
from vid2ev.sensors.presets import sensor_file_text
from vid2ev.sensors.tiles import WHOLE, Part
from vid2ev.sources.framing import framing_of
from vid2ev.terminal import counted
from vid2ev.tracks import Track
from vid2ev.tracks.cis import CisTrack
from vid2ev.tracks.dvs import DvsTrack, dvs_files
from vid2ev.tracks.outputs import Outputs
from vid2ev.tracks.parts import Made
from vid2ev.tracks.truth import TruthTrack, truth_files
from vid2ev.untrusted import json_of

RIG = "rig.toml"


def growing(recipe: Recipe, outputs: Outputs) -> list[str]:
    """The files that a folder is to be made with."""
    events = [mount.within for mount in recipe.mounts if mount.kind == "dvs"]
    truth = [mount.within for mount in recipe.mounts if recipe.truth]
    files = [name for within in events for name in dvs_files(within, recipe.labels, outputs)]
    return files + [name for within in truth for name in truth_files(within)]


def rig_files(recipe: Recipe) -> list[str]:
    """The files that say where several cameras stand, and what those sensors are that are no presets."""
    return [RIG, *_sensor_files(recipe).values()]


def _sensor_files(recipe: Recipe) -> dict[str, str]:
    """The files of the latter, by the name of the camera."""
    cameras = [view.camera for view in recipe.rig.viewpoints]
    return {each.name: f"rig.{each.name}.toml" for each in cameras if each.sensor is not None and is_file(each.sensor)}


@dataclass
class Progress:
    """How far a conversion is."""

    warmed: int = 0  # frames of the source before the recording began
    frames: int = 0  # of the source
    subframes: int = 0  # made between them
    limited: int = 0  # source intervals that hit max_subframes
    events: int = 0  # of all cameras
    start_ns: int = 0  # the first frame
    end_ns: int = 0  # the last frame
    cuts_us: list[int] = field(default_factory=list)  # the first frames of new shots, on the source's clock
    seconds: float = 0.0  # of work, in all runs
    looked: int = 0  # instants that the plans go by
    ended: bool = False  # and whether they are all
    finished: bool = False
    by_hand: bool = False  # ended before the source did
    warnings: list[str] = field(default_factory=list)

    def add(self, instant: Instant) -> None:
        """Count an instant."""
        self.frames += instant.original
        self.subframes += not instant.original
        self.start_ns = instant.t_ns if self.frames == 1 and instant.original else self.start_ns
        self.end_ns = instant.t_ns
        self.cuts_us += [instant.t_ns // 1000] * instant.cut


def progress_of(folder: Folder) -> Progress:
    """How far the recording of a folder is, at its last checkpoint."""
    saved = folder.saved()
    with folder.taking_up():
        return Progress(**checked(json_of(str(saved["progress"])))) if saved else Progress()


def checked(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a `Progress`, each of the kind that it has there.  Raises TypeError, ValueError."""
    fresh = asdict(Progress())
    if values.keys() != fresh.keys() or any(type(values[key]) is not type(value) for key, value in fresh.items()):
        raise TypeError("progress of another kind")
    if any(isinstance(value, int | float) and not abs(value) < 1 << 62 for value in values.values()):
        raise ValueError("progress beyond all numbers")
    if not all(type(cut) is int for cut in values["cuts_us"]) or not all(type(t) is str for t in values["warnings"]):
        raise TypeError("progress of another kind")
    return values


class Recorder:
    """Puts what cameras see into a folder; `done` is how far it is.

    `take_up` comes first, then `begin` with the first instant (or the last source frame before the checkpoint), `add`
    for each that follows and now and then `checkpoint`, and in the end `finish` and `write`.

    part   pixels of the event cameras that are simulated
    made   the event cameras' events, where they were made before, in parts
    """

    def __init__(
        self,
        recipe: Recipe,
        outputs: Outputs,
        folder: Folder,
        threads: int,
        skip: bool = True,
        device: Device = CPU,
        part: Part = WHOLE,
        made: Made | None = None,
    ):
        self.recipe, self.outputs, self.folder = recipe, outputs, folder
        self.device, self.threads = device, threads
        self._part, self._made = part, made
        self.done = Progress()
        self.tracks: Sequence[Track] = [self._track(mount, skip) for mount in recipe.mounts]
        self._truths = [TruthTrack(mount, folder) for mount in recipe.mounts if recipe.truth]

    @property
    def seen(self) -> Recipe:
        """The recipe by whose light the recording is made."""
        return self.recipe if self._made is None else self._made.seen(self.recipe, self.outputs.preview)

    def take_up(self) -> None:
        """Bring everything to the point of the folder's last checkpoint, if there is one."""
        saved = self.folder.saved()
        if saved:
            with self.folder.taking_up():
                for mount, track in zip(self.recipe.mounts, self.tracks, strict=True):
                    name = f"track{mount.number}."
                    track.restore(
                        {key.removeprefix(name): array for key, array in saved.items() if key.startswith(name)}
                    )
            self.done = progress_of(self.folder)

    def warm(self, instant: Instant) -> None:
        """Show event cameras what was before the recording, of which nothing is kept."""
        self.done.warmed += instant.original
        for track, frame in zip(self.tracks, instant.frames, strict=True):
            if isinstance(track, DvsTrack):
                track.dvs.see(frame)

    def begin(self, instant: Instant) -> None:
        """The first instant of the recording; after `take_up`, the last source frame before the checkpoint."""
        with self.folder.writing():
            for track, frame in zip(self.tracks, instant.frames, strict=True):
                track.begin(frame)
                if self.done.warmed and not self.done.frames and isinstance(track, DvsTrack):
                    track.dvs.forget_counts()
            if not self.done.frames:
                self._add_truth(instant)
                self.done.add(instant)

    def add(self, instant: Instant) -> None:
        """The next instant, and what the sensors make of it."""
        with self.folder.writing():
            for track, frame in zip(self.tracks, instant.frames, strict=True):
                track.add(frame)
            self._add_truth(instant)
        self.done.add(instant)
        self.done.events = sum(track.events for track in self.tracks)

    def finish(self) -> None:
        """What the sensors held back, and the last checkpoint."""
        with self.folder.writing():
            for track in self.tracks:
                track.finish()
        self.done.finished = True
        if self._made:
            self.done.subframes, self.done.limited = self._made.subframes
        self.checkpoint()

    def checkpoint(self) -> None:
        """Make this the point from which an interrupted recording goes on; one of a source that passes once cannot, so
        that nothing of it is to be left."""
        state: dict[str, np.ndarray] = {}
        with self.folder.writing():
            for mount, track in zip(self.recipe.mounts, self.tracks, strict=True):
                track.close()
                state |= {f"track{mount.number}.{name}": array for name, array in track.state().items()}
            self.done.events = sum(track.events for track in self.tracks)
            if self.recipe.source.rewindable:
                self.folder.checkpoint(state | {"progress": np.array(json.dumps(asdict(self.done)))})

    def give_up(self) -> None:
        """Make nothing more of this recording, and forget what was made."""
        with self.folder.writing():
            for track in self.tracks:
                track.close()
            self.folder.begin_again()

    def write(self, whole: Path) -> None:
        """The files of all cameras, but for the manifests."""
        for place, (mount, track) in enumerate(zip(self.recipe.mounts, self.tracks, strict=True)):
            (whole / mount.within).mkdir(exist_ok=True)
            track.write(whole / mount.within, *self.span_us(place))
        for mount, truth in zip(self.recipe.mounts, self._truths, strict=False):
            truth.write(whole / mount.within)
        if not self.recipe.alone:
            self._write_rig(whole)

    def _write_rig(self, whole: Path) -> None:
        """The rig file, and files of those sensors that are no presets, as they were."""
        rig, cameras = self.recipe.rig.settled(framing_of(self.recipe.source)), []
        files = _sensor_files(self.recipe)
        for camera, mount in zip(rig.cameras, self.recipe.mounts, strict=True):
            if name := files.get(camera.name):
                title = f"{Path(str(camera.sensor)).stem}, as {camera.name} had it"
                write_text(whole / name, sensor_file_text(mount.kind, mount.sensor.spec, title), overwrite=True)
                camera = camera.model_copy(update={"sensor": name})
            cameras.append(camera)
        rig = rig.model_copy(update={"cameras": tuple(cameras)})
        write_text(whole / RIG, rig_text(rig), overwrite=True)

    def span_us(self, place: int) -> tuple[int, int]:
        """Start and length of the recording of the camera at a place in the recipe, on its own clock: from the first
        frame to the last, or to the last thing that it sent where its readout makes it later."""
        offset_us = self.recipe.mounts[place].clock_offset_us
        start_us = self.done.start_ns // 1000 + offset_us
        return start_us, max(self.done.end_ns // 1000 + offset_us, self.tracks[place].last_us) - start_us

    def _add_truth(self, instant: Instant) -> None:
        for track, truth in zip(self._truths, instant.truth, strict=False):
            track.add(truth)

    def slept(self) -> dict[str, Any]:
        """Of each event camera, by name ("" if it is the only one): how many of its strips' intervals were slept
        through in this run, of how many."""
        tracks = zip(self.recipe.mounts, self.tracks, strict=True)
        return {mount.name: list(track.dvs.slept) for mount, track in tracks if isinstance(track, DvsTrack)}

    def _track(self, mount: Mount, skip: bool) -> Track:
        if mount.kind == "cis":
            return CisTrack(mount.cis(self.threads, self.device), self.folder, self.outputs, within=mount.within)
        source, labels, made = self.recipe.source, self.recipe.labels, self._made
        return DvsTrack(
            made.sensor(mount, labels) if made else mount.dvs(labels, self.threads, skip, self.device, self._part),
            self.folder,
            self.outputs,
            within=mount.within,
            rate=rate_for(source.frames_expected, source.duration_expected_s),
            pictures=partial(pictures, self.recipe, mount) if source.rewindable else None,
            probed=partial(made.probed, mount, self.outputs.probe) if made else None,
        )

    def outcome(self, place: int) -> dict[str, Any]:
        """What came out of the camera at a place in the recipe, for its manifest."""
        done, track, mount = self.done, self.tracks[place], self.recipe.mounts[place]
        start_us, duration_us = self.span_us(place)
        counts = {"frames": done.frames, "subframes": done.subframes, "limited_intervals": done.limited}
        return {
            "start_us": start_us,
            "duration_us": duration_us,
            "counts": counts | track.counts(),
            "cuts_us": [cut_us + mount.clock_offset_us for cut_us in done.cuts_us],
            "warnings": done.warnings + _remarks(done, mount.kind) + self._unseen(mount) + track.remarks(),
        }

    def _unseen(self, mount: Mount) -> list[str]:
        """A remark on a camera that sees nothing of the video: its light is made up."""
        recipe = self.recipe
        if recipe.source.dense or not sees_nothing(recipe.rig.source, mount, recipe.plane_m):
            return []
        return [
            f"camera {mount.name} sees nothing of the video, all of its light is made up; correct its rotation and"
            " translation_mm, or --depth"
        ]


def _remarks(done: Progress, kind: str) -> list[str]:
    """What a person should know about the light of the recording, of a camera of a kind."""
    remarks, events = [], kind == "dvs"
    if events and done.frames == 1:
        remarks.append("one frame only: nothing changes, so there are no events")
    if events and done.cuts_us:
        remarks.append(
            f"{counted(len(done.cuts_us), 'cut')}: the sensor starts afresh there; --cuts keep takes"
            " a cut for a step of light"
        )
    if done.limited:
        remarks.append(
            f"{done.limited} of {done.frames - 1} intervals asked for more sub-frames than --max-subframes allows"
        )
    return remarks
