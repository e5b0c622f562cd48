"""A setup: what a page is about to convert - a source, a rig of cameras with their sensors, perhaps a changed scene.

A setup is frozen; what a person does makes another one, or is refused with one sentence.  Everything in it is what
files and the command line say, so that a setup is a command and a command is a setup (`gui.command`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vid2ev.errors import UsageError
from vid2ev.gui import files
from vid2ev.rig.camera import Camera, Rig, Source, default_rig
from vid2ev.rig.rig_file import made, read_rig
from vid2ev.scenes.scene import Scene
from vid2ev.scenes.source import Request, parse_request, rig_of_scene
from vid2ev.seen.recipe import refuse_recordings
from vid2ev.sensors.presets import CIS, DVS, PRESET, Kind, SensorFile
from vid2ev.sources import SCENE_PREFIX, check_there, is_live, is_scene
from vid2ev.toml_text import toml_value


@dataclass(frozen=True)
class Setup:
    """What is converted, and with what.

    source    as on the command line: a video, or scene:NAME
    rig       the cameras; each camera's sensor is a preset (or file) and what is changed of it
    own_rig   whether `rig` is what the command line takes without --rig
    scene     of scenes: what was made of it, every number settled; None where it is as its file says
    options   other options of `convert` by name, such as seed, depth, start and stop
    """

    source: str
    rig: Rig
    own_rig: bool = True
    scene: Scene | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_scene(self) -> bool:
        """Whether the source is a scene."""
        return is_scene(self.source)

    @property
    def request(self) -> Request:
        """Of a scene: its name, seed and settings."""
        return parse_request(self.source.removeprefix(SCENE_PREFIX))

    def settled(self) -> Scene:
        """The scene with every number settled: as it was changed, or else as its file says."""
        return self.scene or files.settled(self.request)

    def sensor(self, camera: int) -> SensorFile:
        """The preset, or file, of a camera's sensor, with the source of each of its numbers."""
        return files.sensor_file(self.preset(camera), self.kind(camera))

    def check(self) -> None:
        """Raise UsageError, DataError, for files that are none by now."""
        for camera in range(len(self.rig.cameras)):
            self.spec(camera)
        if self.is_scene:
            self.with_scene(None).settled()

    def kind(self, camera: int) -> Kind:
        """Event sensor or frame sensor."""
        return DVS if self.rig.cameras[camera].kind == "dvs" else CIS

    def preset(self, camera: int) -> str:
        """The name of a camera's sensor."""
        return self.rig.cameras[camera].sensor or PRESET

    def spec(self, camera: int) -> Any:
        """The specification of a camera's sensor, `DvsSpec` or `CisSpec`."""
        return spec_of(self.kind(camera), self.preset(camera), self.rig.cameras[camera].set)

    def base(self, camera: int) -> Any:
        """The specification that it has before anything is changed."""
        return spec_of(self.kind(camera), self.preset(camera), {})

    def with_sensor_values(self, camera: int, values: Mapping[str, Any]) -> Setup:
        """Values of a camera's sensor.  Raises UsageError for what cannot be."""
        changes = {**self.rig.cameras[camera].set, **{key: _plain(value) for key, value in values.items()}}
        changed = spec_of(self.kind(camera), self.preset(camera), changes)
        base = self.base(camera)
        kept = {
            name: _plain(getattr(changed, name)) for name in changes if getattr(changed, name) != getattr(base, name)
        }
        return self.with_camera_values(camera, {"set": kept})

    def with_preset(self, camera: int, name: str) -> Setup:
        """Another sensor for a camera, as it comes.  Raises UsageError, DataError."""
        spec_of(self.kind(camera), name, {})
        return self.with_camera_values(camera, {"sensor": None if name == PRESET else name, "set": {}})

    def with_spec(self, camera: int, spec: Any) -> Setup:
        """A camera's sensor as a whole, said by what differs from its preset."""
        base = self.base(camera)
        changes = {key: _plain(value) for key, value in spec if value != getattr(base, key)}
        return self.with_camera_values(camera, {"set": changes})

    def with_camera_values(self, camera: int, values: Mapping[str, Any]) -> Setup:
        """Values of a camera of the rig.  Raises UsageError for what cannot be."""
        before = self.rig.cameras[camera]
        table = {key: value for key, value in {**before.model_dump(), **values}.items() if value is not None}
        changed = made(Camera, table, f"camera {before.name}")
        cameras = tuple(changed if k == camera else each for k, each in enumerate(self.rig.cameras))
        return self.with_rig(cameras, own="sensor" in values or "set" in values)

    def with_video_camera(self, values: Mapping[str, Any]) -> Setup:
        """Values of the camera that took the video.  Raises UsageError for what cannot be."""
        table = {key: value for key, value in {**self.rig.source.model_dump(), **values}.items() if value is not None}
        return replace(self, rig=Rig(source=made(Source, table, "[source]"), cameras=self.rig.cameras), own_rig=False)

    def with_rig(self, cameras: tuple[Camera, ...], own: bool = False) -> Setup:
        """Other cameras; `own` says that they stand where they stood.  Raises UsageError for what cannot be."""
        try:
            rig = Rig(source=self.rig.source, cameras=cameras)
        except ValidationError as error:
            raise UsageError(f"rig: {error.errors()[0]['msg'].removeprefix('Value error, ')}") from error
        return replace(self, rig=rig, own_rig=self.own_rig and own)

    def with_scene(self, scene: Scene | None) -> Setup:
        """Another scene in the place of the settled one; None for that of its file."""
        return replace(self, scene=scene)

    def with_option(self, name: str, value: Any) -> Setup:
        """An option of `convert`; None takes it back."""
        options = {key: kept for key, kept in self.options.items() if key != name}
        return replace(self, options=options if value is None else options | {name: value})


def setup_of(source: str, rig: str | None = None) -> Setup:
    """The setup of a source, with the cameras of a rig file, or those that it has without one, with a frame camera
    beside the event camera of the default.  Raises UsageError, DataError, for a source that is not there, too; that one
    needs other options is not seen here."""
    if not source:
        raise UsageError("no source is named; enter a video, a folder of images, or a scene such as scene:room")
    if is_live(source):
        raise UsageError(f"{source} passes once and cannot be looked at here and there; give a file")
    check_there(source)
    named = rig_of_scene(source.removeprefix(SCENE_PREFIX)) if is_scene(source) else None
    if rig is not None:
        setup = Setup(source, read_rig(rig), own_rig=False)
    else:
        setup = Setup(source, read_rig(named) if named else default_rig(frames=True))
    if setup.is_scene:
        setup.settled()
    else:
        refuse_recordings(Path(source))
    return setup


def texts_of(changes: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Changes as `key=value` texts."""
    return [f"{prefix}{key}={toml_value(value)}" for key, value in changes.items()]


def spec_of(kind: Kind, name: str, changes: Mapping[str, Any]) -> Any:
    """The specification of a sensor and changes to it.  Raises UsageError, DataError."""
    return files.specification(kind, name, tuple(texts_of(changes)))


def _plain(value: Any) -> Any:
    """As TOML has it."""
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value
