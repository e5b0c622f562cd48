"""A scene: objects, lights and a camera that move, with every number settled.

A scene file says the same in TOML, and may have ranges instead of numbers (`ranges.py`):

    [about]       title, text
    [scene]       how long, what is around, how densely it is sampled
    [camera]      the reference camera: its size, its lens, its trajectory
    [[objects]]   shapes with surfaces and trajectories; `count` of each
    [[lights]]    lamps; `count` of each

The axes of the world are those of a camera that is not turned: x to the right, y down, z forwards.  Light is relative:
a white, diffuse surface under ambient light of 1.0 has light 1.0.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from vid2ev.rig.intrinsics import DistortionModel, Intrinsics
from vid2ev.scenes.part import Colour, Degrees, Direction, Length, Light, Part, Turn
from vid2ev.scenes.textures import Pattern
from vid2ev.scenes.trajectory import Trajectory


def _threefold(value: object) -> object:
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


Even = BeforeValidator(_threefold)  # one number for three that are equal
Picture = str | Pattern  # the name of a bundled photograph, a file, or a pattern


class About(Part):
    """What the scene says of itself."""

    title: str = Field(default="", description="on one line")
    text: str = Field(default="", description="what it is for")


class Setting(Part):
    """How long, what is around, and how densely it is sampled."""

    duration_s: float = Field(default=2.0, ge=1e-6, le=1e5, description="from the first instant to the last [s]")
    background: Annotated[Colour, Even] = Field(
        default=(0.0, 0.0, 0.0), description="the light from where there is nothing; it lights the objects, too"
    )
    environment: Picture | None = Field(
        default=None, description="a picture of all that is around, by latitude and longitude, instead of a background"
    )
    environment_gain: Light = Field(default=1.0, description="times its light")
    environment_rotation_deg: Turn = Field(default=(0.0, 0.0, 0.0), description="how it is turned [deg]")
    ambient: Annotated[Colour, Even] = Field(default=(0.0, 0.0, 0.0), description="light from everywhere")
    max_shift_px: float = Field(
        default=0.5, ge=1e-3, le=100, description="the most that anything moves between two instants [px]"
    )
    max_light_step: float = Field(
        default=0.2,
        ge=1e-4,
        le=10,
        description="the most that lamps and shadows change light between two instants, but for few pixels and deep"
        " flicker [nat]",
    )
    samples_per_period: float = Field(default=32.0, ge=2, le=1e4, description="instants in one period of a flicker")
    min_fps: float = Field(default=100.0, ge=1e-3, le=1e6, description="instants per second, at least [1/s]")
    max_fps: float = Field(default=20_000.0, ge=1e-3, le=1e6, description="instants per second, at most [1/s]")
    samples: int = Field(default=2, ge=1, le=16, description="of a pixel at an edge, across and down")
    rig: str | None = Field(default=None, description="a rig file: cameras around the reference camera")

    @model_validator(mode="after")
    def _fits(self) -> Setting:
        if self.min_fps > self.max_fps:
            raise ValueError(f"min_fps = {self.min_fps:g} is above max_fps = {self.max_fps:g}")
        return self


class Camera(Part):
    """The reference camera."""

    size: tuple[int, int] = Field(default=(640, 480), description="width and height [px]")
    fov_deg: float | None = Field(
        default=None, ge=1, le=170, description="horizontal field of view [deg] through the lens; 60 if not given"
    )
    focal_px: tuple[float, float] | None = Field(default=None, description="focal lengths instead of fov_deg [px]")
    centre_px: tuple[float, float] | None = Field(
        default=None, description="principal point; the middle if not given [px]"
    )
    model: DistortionModel = Field(default="none", description="of distortion: none, radtan or equidistant")
    distortion: tuple[float, ...] = Field(default=(), description="its coefficients")
    trajectory: Trajectory = Field(default=(), description="camera to world")

    @model_validator(mode="after")
    def _fits(self) -> Camera:
        if self.fov_deg is not None and self.focal_px is not None:
            raise ValueError("fov_deg and focal_px say the same; give one of them")
        if max(self.size) > 16384 or min(self.size) < 1:
            raise ValueError(f"size {self.size[0]}x{self.size[1]} must be 1 to 16384 pixels each way")
        self.intrinsics  # noqa: B018 (raises if they do not fit)
        return self

    @property
    def intrinsics(self) -> Intrinsics:
        """The lens and the pixels."""
        own: dict[str, Any] = {"model": self.model, "distortion": self.distortion}
        fov_deg, middle = self.fov_deg or 60.0, ((self.size[0] - 1) / 2, (self.size[1] - 1) / 2)
        if self.focal_px is None:
            plain = Intrinsics.of_field(self.size, fov_deg, **own)
            return plain.model_copy(update={"centre_px": self.centre_px or middle})
        return Intrinsics(size=self.size, focal_px=self.focal_px, centre_px=self.centre_px or middle, **own)


class Flicker(Part):
    """Light that swings: times 1 + depth sin(2 pi frequency t + phase)."""

    frequency_hz: float = Field(ge=1e-3, le=1e5, description="periods per second [Hz]")
    depth: float = Field(default=1.0, ge=0, le=1, description="0: steady; 1: down to darkness")
    phase_deg: Degrees = Field(default=0.0, description="where in its period it begins [deg]")

    def gain(self, t_s: float) -> float:
        """Times how much, at an instant [s]."""
        turns = math.fmod(self.frequency_hz * t_s + self.phase_deg / 360, 1.0)
        return 1 + self.depth * math.sin(2 * math.pi * turns)


class Object(Part):
    """A shape with a surface, and where it is."""

    name: str = Field(min_length=1, description="by which draws and --set know it")
    kind: Literal["plane", "box", "sphere", "cylinder", "mesh"] = Field(description="the shape")
    file: str | None = Field(default=None, description="of a mesh: OBJ, PLY, STL, glTF or GLB")
    size_m: Annotated[tuple[Length, Length, Length], Even] = Field(
        default=(1.0, 1.0, 1.0), description="full extents x, y, z; of a mesh: that of the longest side is kept [m]"
    )
    texture: Picture | None = Field(default=None, description="a bundled photograph, a file, a folder or a pattern")
    colour: Annotated[Colour, Even] = Field(default=(1.0, 1.0, 1.0), description="times the texture")
    repeat: tuple[float, float] = Field(
        default=(1.0, 1.0), description="how often the texture stands on it, across and down; below 0 mirrored"
    )
    specular: Light = Field(default=0.0, description="height of the highlight")
    shininess: float = Field(default=32.0, ge=1, le=1e5, description="exponent of the highlight")
    emission: Light = Field(default=0.0, description="light of its own, times its colour; above 1 for lamps")
    flicker: Flicker | None = Field(default=None, description="of its own light")
    trajectory: Trajectory = Field(default=(), description="object to world")

    @model_validator(mode="after")
    def _fits(self) -> Object:
        if (self.kind == "mesh") != (self.file is not None):
            raise ValueError("a mesh needs a file" if self.kind == "mesh" else f"a {self.kind} takes no file")
        return self


class LightSource(Part):
    """A lamp."""

    name: str = Field(min_length=1, description="by which draws and --set know it")
    kind: Literal["ambient", "point", "sun"] = Field(description="from everywhere, from a point, or from afar")
    colour: Annotated[Colour, Even] = Field(
        default=(1.0, 1.0, 1.0), description="the light of a white surface that faces it; of a point, reach_m away"
    )
    reach_m: float = Field(default=1.0, ge=1e-3, le=1e5, description="where a point has the light of its colour [m]")
    direction: Direction = Field(default=(0.0, 1.0, 0.0), description="in which the light of a sun goes")
    shadows: bool = Field(default=False, description="whether objects stand in its light")
    flicker: Flicker | None = Field(default=None, description="how it swings")
    trajectory: Trajectory = Field(default=(), description="where a point is; turns the direction of a sun")

    @model_validator(mode="after")
    def _fits(self) -> LightSource:
        if self.kind == "sun" and sum(abs(part) for part in self.direction) < 1e-9:
            raise ValueError(f"direction {list(self.direction)} is none; give one such as [0, 1, 0]")
        return self


class Scene(Part):
    """A scene with every number settled."""

    about: About = Field(default=About(), description="what it says of itself")
    scene: Setting = Field(default=Setting(), description="how long, what is around, how densely it is sampled")
    camera: Camera = Field(default=Camera(), description="the reference camera")
    objects: tuple[Object, ...] = Field(default=(), description="what there is to see")
    lights: tuple[LightSource, ...] = Field(default=(), description="what lights it")

    def tables(self) -> dict[str, Any]:
        """The scene as the tables of its file: what was given, ready for TOML."""
        return self.model_dump(mode="json", exclude_unset=True)
