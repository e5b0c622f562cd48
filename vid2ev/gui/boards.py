"""Where the values of a page's panels are: a camera's sensor, a camera of the rig, a part of the scene, the options."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.gui.controls import Control, controls_of
from vid2ev.gui.scene_edit import PLACE, Thing, thing_named, value_of, with_values
from vid2ev.gui.session import Session
from vid2ev.gui.setup import Setup
from vid2ev.rig.camera import Camera, Source
from vid2ev.rig.pose import rotation_vector_deg
from vid2ev.sensors.presets import Kind, load

BARE = ("name", "kind", "sensor", "set", "rotation")  # of a camera: elsewhere on the page, or another way to say it


WORDS = {  # options of the conversion
    "depth": "how far a video's scene is: plane:2.5, a map or a folder of maps",
    "crop": "part of the picture: 640x480+0+60",
    "size": "pixels to bring it to: 346x260",
    "upsample": "light between frames: none, linear, flow or net",
    "motion": "of a camera over a photograph: pan, saccade, zoom",
}
NUMBERS = {
    "start": ("s", "begin at this second of the source's own clock"),
    "stop": ("s", "end there"),
    "slowdown": ("", "the footage plays so many times slower than the world went"),
    "fps": ("1/s", "frames per second, in place of the source's own times"),
}


class _Board:
    """Values that are refused wait for others, with which they may be possible: a model of distortion, say, for its
    coefficients."""

    def __init__(self, session: Session):
        self.session = session
        self.waiting: dict[str, Any] = {}

    def origin(self, key: str) -> str:
        """Nothing is known."""
        return ""

    def seen(self, key: str) -> Iterable[Any]:
        """The base alone."""
        return [self.base(key)]

    def base(self, key: str) -> Any:
        """What a reset brings back."""
        raise NotImplementedError

    def changed(self, values: Mapping[str, Any]) -> Setup:
        """The setup with these values.  Raises UsageError for what cannot be."""
        raise NotImplementedError

    def put(self, key: str, value: Any) -> None:
        """Use a value, alone or with those that wait.  Raises UsageError for what cannot be."""
        self.waiting.pop(key, None)
        waiting, self.waiting = self.waiting, {}
        if waiting and self.session.change(lambda: self.changed(waiting | {key: value})) is None:
            return
        self.waiting = waiting
        if why := self.session.change(lambda: self.changed({key: value})):
            self.waiting[key] = value
            raise UsageError(why)


class SensorBoard(_Board):
    """The sensor of a camera of the rig."""

    def __init__(self, session: Session, camera: int):
        super().__init__(session)
        self.camera = camera

    @property
    def controls(self) -> tuple[Control, ...]:
        """One for each value of its specification."""
        return controls_of(self.session.setup.kind(self.camera).spec)

    def value(self, key: str) -> Any:
        """The value in use."""
        return getattr(self.session.setup.spec(self.camera), key)

    def base(self, key: str) -> Any:
        """That of the preset."""
        return getattr(self.session.setup.base(self.camera), key)

    def origin(self, key: str) -> str:
        """What the preset says of it."""
        setup = self.session.setup
        said = setup.sensor(self.camera).sources.get(key)
        return f"{setup.preset(self.camera)}: {said}" if said else "default"

    def seen(self, key: str) -> Iterable[Any]:
        """The value of the preset, or if that is 0 those of all presets."""
        known = [getattr(spec, key) for spec in _presets(self.session.setup.kind(self.camera))]
        return [self.base(key)] if self.base(key) else known

    def changed(self, values: Mapping[str, Any]) -> Setup:
        """The setup with these values."""
        return self.session.setup.with_sensor_values(self.camera, values)


class CameraBoard(_Board):
    """A camera of the rig; `None` for that which took the video."""

    def __init__(self, session: Session, camera: int | None):
        super().__init__(session)
        self.camera = camera

    @property
    def controls(self) -> tuple[Control, ...]:
        """One for each value that is not elsewhere on the page."""
        return controls_of(Source if self.camera is None else Camera, without=BARE)

    def value(self, key: str) -> Any:
        """The value in use; of a camera whose rotation is said by a matrix, the vector that says the same."""
        rig = self.session.setup.rig
        camera = rig.source if self.camera is None else rig.cameras[self.camera]
        if key == "rotation_deg" and isinstance(camera, Camera) and camera.rotation is not None:
            return tuple(float(f"{angle:.9g}") for angle in rotation_vector_deg(camera.pose.rotation))
        return getattr(camera, key)

    def base(self, key: str) -> Any:
        """The default."""
        return Camera.model_fields[key].default

    def changed(self, values: Mapping[str, Any]) -> Setup:
        """The setup with these values."""
        setup = self.session.setup
        if self.camera is None:
            return setup.with_video_camera(values)
        matrix = {"rotation": None} if "rotation_deg" in values else {}
        return setup.with_camera_values(self.camera, {**values, **matrix})


class SceneBoard(_Board):
    """A part of the scene, by its name."""

    def __init__(self, session: Session, name: str):
        super().__init__(session)
        self.name = name

    @property
    def thing(self) -> Thing:
        """The part as it is."""
        return thing_named(self.session.setup.settled(), self.name)

    @property
    def controls(self) -> tuple[Control, ...]:
        """Its place, and one for each of its values."""
        thing = self.thing
        place: tuple[Control, ...] = ()
        if thing.has_place:
            from vid2ev.scenes.trajectory import Fixed

            place = tuple(each for each in controls_of(Fixed) if each.key in PLACE)
        return (*place, *controls_of(thing.model, without=("name", "rig")))

    def value(self, key: str) -> Any:
        """The value in use."""
        return value_of(self.session.setup.settled(), self.name, key)

    def base(self, key: str) -> Any:
        """As the scene's file has it; as it is, of a part that a scene has that was loaded in its place."""
        file = self.session.setup.with_scene(None).settled()
        return value_of(file, self.name, key) if thing_named(file, self.name).name == self.name else self.value(key)

    def changed(self, values: Mapping[str, Any]) -> Setup:
        """The setup with these values."""
        setup, whole = self.session.setup, self.session.setup.with_scene(None)
        scene = with_values(setup.settled(), self.name, values)
        return whole if scene == whole.settled() else setup.with_scene(scene)  # (all is as it was: nothing to save)


class OptionBoard(_Board):
    """Options of the conversion."""

    controls = (
        *(Control(key, "word", "", "", meaning, optional=True) for key, meaning in WORDS.items()),
        *(Control(key, "number", "", unit, meaning, optional=True) for key, (unit, meaning) in NUMBERS.items()),
        Control("seed", "whole", "", "", "another seed is another camera of the same kind", low=0, optional=True),
    )

    def value(self, key: str) -> Any:
        """The value in use, None where it is left out."""
        return self.session.setup.options.get(key)

    def base(self, key: str) -> Any:
        """Left out."""
        return None

    def changed(self, values: Mapping[str, Any]) -> Setup:
        """The setup with these values."""
        setup = self.session.setup
        for key, value in values.items():
            setup = setup.with_option(key, value)
        return setup


@lru_cache(maxsize=4)
def _presets(kind: Kind) -> tuple[Any, ...]:
    return tuple(load(kind, name) for name in kind.names())
