"""Mounts: the cameras of a recording, each with its sensor and everything settled that a rig file may leave open."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from vid2ev.errors import UsageError, Vid2evError
from vid2ev.rig.camera import Camera, ResolvedRig
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.rig.pose import Pose
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.devices import CPU, Device
from vid2ev.sensors.dvs import Dvs
from vid2ev.sensors.limits import check_sensor
from vid2ev.sensors.presets import PRESET, check_overrides, load_cis, load_sensor
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sensors.tiles import WHOLE, Part
from vid2ev.toml_text import toml_value

Spec = DvsSpec | CisSpec


class Loaded(NamedTuple):
    """A sensor: what its specification was found by, and the specification."""

    name: str
    spec: Spec

    @property
    def colour(self) -> bool:
        """Whether its pixels tell colours apart."""
        return isinstance(self.spec, CisSpec) and self.spec.colour


@dataclass(frozen=True)
class Sensors:
    """The sensors of a recording, for cameras that name none: presets, TOML files or specifications; and what is
    changed in all (`key=value`; keys of frame sensors begin with `cis.`).

    Raises UsageError for changes to a specification.
    """

    dvs: str | Path | DvsSpec = PRESET
    cis: str | Path | CisSpec = PRESET
    overrides: Sequence[str] = ()

    def __post_init__(self) -> None:
        check_overrides(self.overrides)
        for sensor, kind in ((self.dvs, "dvs"), (self.cis, "cis")):
            if isinstance(sensor, Spec) and (texts := self._changes(kind)):
                raise UsageError(f"overrides {texts}: expected a preset or file to change; change the specification")

    def of(self, camera: Camera) -> Loaded:
        """The sensor of a camera: the one that it names, or else the recording's, with the camera's changes and the
        recording's on top.  Raises UsageError, DataError."""
        sensor = camera.sensor or (self.dvs if camera.kind == "dvs" else self.cis)
        if isinstance(sensor, Spec):
            if camera.set:
                raise UsageError(
                    f"camera {camera.name} sets {', '.join(camera.set)}: expected a preset or file to change"
                )
            return Loaded("own", sensor)
        changes = [*(f"{key}={toml_value(value)}" for key, value in camera.set.items()), *self._changes(camera.kind)]
        return Loaded(str(sensor), (load_sensor if camera.kind == "dvs" else load_cis)(sensor, changes))

    def of_file(self, camera: Camera, file: str | Path) -> Loaded:
        """As `of`, for a camera of a rig file, which is named where the sensor that it asks for, or what it changes in
        it, cannot be."""
        try:
            return self.of(camera)
        except Vid2evError:
            plain = replace(self, overrides=())  # (what is changed in all of them is not the file's)
            if camera.sensor is None:
                plain.of(camera.model_copy(update={"set": {}}))  # (nor is the sensor)
            try:
                plain.of(camera)
            except Vid2evError as error:
                raise type(error)(f"{file}: camera '{camera.name}': {error}") from error
            raise

    def check_cameras(self, cameras: Iterable[Camera], cis_asked: bool) -> None:
        """Raise UsageError for sensors that are asked for, or changes, of a kind that none of the cameras has."""
        kinds = {camera.kind for camera in cameras}
        if "cis" not in kinds and (texts := self._changes("cis")):
            raise UsageError(f"setting '{texts[0]}': expected a frame camera to change; add --frames, or leave it out")
        if "dvs" not in kinds and (texts := self._changes("dvs")):
            raise UsageError(
                f"setting '{texts[0]}': expected an event camera to change; keys of frame sensors begin with cis."
            )
        if "cis" not in kinds and cis_asked:
            raise UsageError(
                f"cis{_named(self.cis)}: expected a frame camera in the rig; add --frames, or leave it out"
            )
        if "dvs" not in kinds and self.dvs != PRESET:
            raise UsageError(f"sensor{_named(self.dvs)}: expected an event camera in the rig; add one, or leave it out")

    def _changes(self, kind: str) -> list[str]:
        return [text for text in self.overrides if text.strip().startswith("cis.") == (kind == "cis")]


def _named(sensor: str | Path | Spec) -> str:
    return "" if isinstance(sensor, Spec) else f" '{sensor}'"


@dataclass(frozen=True, eq=False)
class Mount:
    """A camera of a recording.

    name             "" for the only one, whose files lie in the folder of the recording itself
    number           its place in the rig, from 0; cameras of one seed differ by it
    sensor           its sensor
    seed             of the sensor
    intrinsics       of the view, `size` among them
    pose             where it is, from the camera to the source's camera
    clock_offset_us  what its own clock reads when that of the source reads 0
    """

    name: str
    number: int
    sensor: Loaded
    seed: int
    intrinsics: Intrinsics
    pose: Pose
    clock_offset_us: int = 0

    @property
    def kind(self) -> Literal["dvs", "cis"]:
        """What it sends: events or frames."""
        return "dvs" if isinstance(self.sensor.spec, DvsSpec) else "cis"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.intrinsics.size

    @property
    def view(self) -> tuple[Intrinsics, Pose]:
        """What it sees with, and from where."""
        return self.intrinsics, self.pose

    @property
    def within(self) -> str:
        """The camera's part of the recording's folder, with a slash at its end."""
        return f"{self.name}/" if self.name else ""

    def dvs(
        self,
        labels: bool = False,
        threads: int = 1,
        skip: bool = True,
        device: Device = CPU,
        part: Part = WHOLE,
        kind: type[Dvs] = Dvs,
    ) -> Dvs:
        """The event sensor, before its first frame; on a CPU of a part of its pixels, or of another kind."""
        assert isinstance(self.sensor.spec, DvsSpec)
        spec, number = self.sensor.spec, self.number
        origin_ns = 1000 * self.clock_offset_us  # 0 of the source's clock
        if device.name != "cpu":
            from vid2ev.sensors.dvs_on_card import DvsOnCard

            return DvsOnCard(
                spec, self.size, self.seed, camera=number, labels=labels, memory=device.memory, origin_ns=origin_ns
            )
        return kind(
            spec, self.size, self.seed, camera=number, threads=threads, labels=labels, skip=skip, part=part,
            origin_ns=origin_ns,
        )  # fmt: skip

    def cis(self, threads: int = 1, device: Device = CPU) -> Cis:
        """The frame sensor, before its first frame."""
        assert isinstance(self.sensor.spec, CisSpec)
        if device.name != "cpu":
            from vid2ev.sensors.cis_on_card import CisOnCard

            return CisOnCard(self.sensor.spec, self.size, self.seed, memory=device.memory, camera=self.number)
        return Cis(self.sensor.spec, self.size, self.seed, camera=self.number, threads=threads)

    def describe(self) -> dict[str, Any]:
        """The sensor, ready for JSON."""
        return {
            "kind": self.kind,
            "name": self.sensor.name,
            "size": list(self.size),
            "parameters": self.sensor.spec.model_dump(mode="json"),
            "effects": self.sensor.spec.effects(),
        }


def mounts_of(rig: ResolvedRig, sensors: Sequence[Loaded], seed: int, alone: bool) -> tuple[Mount, ...]:
    """The cameras of a rig with their sensors; `seed` is of those that have none of their own.  `alone`: the only
    camera, which has no name.  Raises UsageError for one that has more pixels than a sensor may have."""
    for view in rig.viewpoints:
        check_sensor(view.intrinsics.size, seed, 0, 1)
    return tuple(
        Mount(
            "" if alone else view.camera.name,
            number,
            sensor,
            seed if view.camera.seed is None else view.camera.seed,
            view.intrinsics,
            view.pose,
            view.camera.clock_offset_us,
        )
        for number, (view, sensor) in enumerate(zip(rig.viewpoints, sensors, strict=True))
    )
