"""The cameras of a rig: what each is, what it sees with, and where it stands.

    X_rig = R X_camera + t

The coordinates of the rig are those of the camera that took the video: x to the right, y down, z forwards.  A camera
that says nothing of its lens has the field of view of the video at its own size; one that says nothing of its place
stands where the video was taken.

Source of the conventions: those of `rig.pose` and `rig.intrinsics`, which are OpenCV's.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from vid2ev.errors import UsageError
from vid2ev.rig.intrinsics import COUNTS, SHORTEST_PX, DistortionModel, Framing, Intrinsics
from vid2ev.rig.pose import Pose, rotation_of

FARTHEST = 1e12  # of numbers: what is made of them stays finite
Number = Annotated[float, Field(strict=True, ge=-FARTHEST, le=FARTHEST)]
Side = Annotated[int, Field(strict=True, ge=1, le=65535)]
Focal = Annotated[float, Field(strict=True, ge=SHORTEST_PX, le=FARTHEST)]
Angle = Annotated[float, Field(strict=True, ge=0.01, le=179)]
Row = tuple[Number, Number, Number]
Value = bool | int | float | str

ASSUMED_FOV_DEG = 60.0
NEARLY_A_ROTATION = 1e-3  # how far R'R may be from 1: matrices of files have few digits
LATEST_US = 10**15  # thirty years; what is added to an instant stays far within 64 bits

# A camera's name is the name of its folder, on every system, and no other file of a recording.
NAME = re.compile(r"[^\W_][\w-]{0,63}")
RESERVED = {"source", "truth", "rig", "frames", "whole", "replaced", "lock", "con", "prn", "aux", "nul"}
DEVICES = re.compile(r"(com|lpt)\d")  # (names that Windows keeps for itself)


class Optics(BaseModel):
    """Size, field of view and distortion of a camera, as far as they are stated."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    size: tuple[Side, Side] | None = Field(default=None, description="width and height [px]; left out: the video's")
    fov_deg: Angle | None = Field(
        default=None, description="horizontal field of view [deg] through the lens, with the centre in the middle"
    )
    focal_px: tuple[Focal, Focal] | None = Field(
        default=None, description="focal lengths across and down [px], in place of fov_deg"
    )
    centre_px: tuple[Number, Number] | None = Field(
        default=None, description="the principal point, from the centre of the first pixel [px]; left out: the middle"
    )
    distortion_model: DistortionModel | None = Field(default=None, description="none, radtan or equidistant")
    distortion: tuple[Number, ...] = Field(default=(), description="its coefficients, in OpenCV's order")

    @model_validator(mode="after")
    def _go_together(self) -> Optics:
        if self.fov_deg is not None and self.focal_px is not None:
            raise ValueError("fov_deg and focal_px both say how wide it sees: keep one of them")
        if self.centre_px is not None and self.focal_px is None:
            raise ValueError("centre_px needs focal_px beside it")
        if self.distortion and self.distortion_model is None:
            raise ValueError("distortion needs distortion_model beside it, to say what its coefficients mean")
        if len(self.distortion) not in COUNTS[self.distortion_model or "none"]:
            wanted = " or ".join(map(str, COUNTS[self.distortion_model or "none"]))
            raise ValueError(
                f"distortion_model '{self.distortion_model}' takes {wanted} coefficients of distortion, not"
                f" {len(self.distortion)}"
            )
        if self.fov_deg is not None:
            self.lens((1, 1))  # (raises if the lens does not see so far)
        return self

    def lens(self, size: tuple[int, int]) -> Intrinsics | None:
        """The intrinsics at a size, where a focal length or a field of view is stated."""
        width, height = size
        own: dict[str, Any] = {"model": self.distortion_model or "none", "distortion": self.distortion}
        if self.focal_px is not None:
            centre = self.centre_px or ((width - 1) / 2, (height - 1) / 2)
            return Intrinsics(size=size, focal_px=self.focal_px, centre_px=centre, **own)
        return None if self.fov_deg is None else Intrinsics.of_field(size, self.fov_deg, **own)


class Source(Optics):
    """The camera that took the video."""

    @classmethod
    def of(cls, lens: Intrinsics) -> Source:
        """One with these intrinsics.  Raises ValueError for numbers beyond those of rig files."""
        return cls(**_stated(lens))

    def intrinsics(self, size: tuple[int, int], framing: Framing | None = None) -> Intrinsics:
        """Of a video of this size, which may be that of `size` made smaller or larger, or framed out of pictures of
        `size`; without a `size` it is the lens of those pictures.  Raises UsageError."""
        stated = self.size or size
        same_field = self.size is None and self.focal_px is None and framing is not None and framing.is_whole
        if framing is not None and self._is_before(framing) and not same_field:
            return framing.lens_of_part(self.intrinsics(framing.whole))
        lens = self.lens(stated) or self._assumed_lens(stated)
        if abs(stated[0] * size[1] - stated[1] * size[0]) > max(*stated, *size):  # (more than a pixel is rounded off)
            raise UsageError(
                f"the rig's [source] size {stated[0]}x{stated[1]} is of another shape than the video,"
                f" {size[0]}x{size[1]}; give size, focal_px and centre_px of the video as it is or as it is read"
            )
        return lens.scaled_to(size) if stated != size else lens

    def intrinsics_before(self, framing: Framing | None, size: tuple[int, int]) -> Intrinsics:
        """Of the pictures of `size` out of which a video is framed, if it is.  Raises UsageError."""
        if framing is None or self._is_before(framing):
            return self.intrinsics(size)
        return framing.lens_of_whole(self.intrinsics(framing.size))

    def _assumed_lens(self, size: tuple[int, int]) -> Intrinsics:
        """The lens at a size where nobody says how wide it sees; raises UsageError if it does not see so far."""
        try:
            own: dict[str, Any] = {"model": self.distortion_model or "none", "distortion": self.distortion}
            return Intrinsics.of_field(size, ASSUMED_FOV_DEG, **own)
        except ValueError as error:
            raise UsageError(
                "the rig's [source] says nothing of how wide it sees, and its distortion lets it see less than the"
                f" {ASSUMED_FOV_DEG:g} degrees that are assumed then; state fov_deg or focal_px, or correct distortion"
            ) from error

    def _is_before(self, framing: Framing) -> bool:
        """Whether it says what the lens of the whole pictures is, not of what is framed out of them."""
        return self.size in (None, framing.whole)

    @property
    def assumed(self) -> bool:
        """Whether nobody said how wide the video sees."""
        return self.fov_deg is None and self.focal_px is None


class Camera(Optics):
    """One virtual camera.  `rotation` [3, 3] may stand in place of `rotation_deg`."""

    name: str = Field(description="what its folder is called")
    kind: Literal["dvs", "cis"] = Field(description="dvs: events; cis: frames")
    rotation_deg: Row | None = Field(default=None, description="rotation vector, from camera to rig [deg]")
    rotation: tuple[Row, Row, Row] | None = Field(default=None, description="rotation matrix, from camera to rig")
    translation_mm: Row = Field(default=(0.0, 0.0, 0.0), description="where the camera stands in the rig [mm]")
    clock_offset_us: Annotated[int, Field(strict=True, ge=-LATEST_US, le=LATEST_US)] = Field(
        default=0, description="what the camera's own clock reads when the rig's reads 0 [us]"
    )
    sensor: str | None = Field(default=None, description="a preset or a TOML file; left out: the recording's")
    set: dict[str, Value | list[Value]] = Field(default={}, description="values of the sensor to change")
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**63)] | None = Field(
        default=None, description="which camera of its kind; left out: the recording's"
    )

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, name: str) -> str:
        if not NAME.fullmatch(name):
            raise ValueError("a name is a folder's: up to 64 letters, digits, _ and -, a letter or digit before others")
        if name.casefold() in RESERVED or DEVICES.fullmatch(name.casefold()):
            raise ValueError("that name is taken by a recording or an operating system; choose another")
        return name

    @field_validator("sensor")
    @classmethod
    def _names_a_sensor(cls, sensor: str | None) -> str | None:
        if sensor == "":
            raise ValueError("it must not be empty")
        return sensor

    @field_validator("set", mode="before")
    @classmethod
    def _is_a_table(cls, values: Any) -> Any:
        held = list(values.values()) if isinstance(values, dict) else [None]
        singles = [one for value in held for one in (value if isinstance(value, list | tuple) else [value])]
        if not all(isinstance(one, Value) for one in singles):
            raise ValueError("it must be a table of numbers, texts, true and false, or lists of those")
        return values

    @field_validator("rotation")
    @classmethod
    def _turns(cls, rotation: tuple[Row, Row, Row] | None) -> tuple[Row, Row, Row] | None:
        if rotation is not None:
            nearest_rotation(np.array(rotation))
        return rotation

    @model_validator(mode="after")
    def _one_place(self) -> Camera:
        if self.rotation_deg is not None and self.rotation is not None:
            raise ValueError("rotation_deg and rotation both say how it is turned: keep one of them")
        if self.focal_px is not None and self.size is None:
            raise ValueError("focal_px needs size beside it, to say in which pixels it counts")
        return self

    @property
    def pose(self) -> Pose:
        """From the camera's coordinates to the rig's."""
        if self.rotation is not None:
            turn = nearest_rotation(np.array(self.rotation))
        else:
            turn = rotation_of(np.radians(self.rotation_deg or (0.0, 0.0, 0.0)))
        return Pose(turn, np.array(self.translation_mm) / 1000)

    def intrinsics(self, source: Intrinsics) -> Intrinsics:
        """The camera's own, or the source's field at the camera's size."""
        size = self.size or source.size
        lens = self.lens(size)
        if lens is not None:
            return lens
        seen = source.scaled_to(size) if size != source.size else source
        own = {"model": self.distortion_model, "distortion": self.distortion}
        return seen.model_copy(update=own) if self.distortion_model is not None else seen


class Rig(BaseModel):
    """The camera of the video, and the virtual cameras around it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    source: Source = Source()
    cameras: tuple[Camera, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _differ(self) -> Rig:
        seen: dict[str, str] = {}
        for camera in self.cameras:
            folded = camera.name.casefold()  # (folders of some systems know no capitals)
            if folded in seen:
                other = f", as {seen[folded]} is on some systems" if seen[folded] != camera.name else ""
                raise ValueError(f"two cameras are called {camera.name}{other}: give each a name of its own")
            seen[folded] = camera.name
        return self

    def with_frames(self) -> Rig:
        """The rig with a frame camera: its own, or else one where the video was taken, of a name that none has."""
        if any(camera.kind == "cis" for camera in self.cameras):
            return self
        taken = {camera.name.casefold() for camera in self.cameras}
        names = ["cis", *(f"cis_{number}" for number in range(2, len(taken) + 2))]
        added = Camera(name=next(name for name in names if name not in taken), kind="cis")
        return Rig(source=self.source, cameras=(*self.cameras, added))

    def around(self, source: Source | None) -> Rig:
        """The rig around a video that comes with what took it, as far as [source] does not say how that sees."""
        if source is None or not self.source.assumed:
            return self
        if self.source.distortion_model is not None:
            bent = {"distortion_model": self.source.distortion_model, "distortion": self.source.distortion}
            source = source.model_copy(update=bent)
        return self.model_copy(update={"source": source})

    def resolved(
        self, source_size: tuple[int, int], known: Intrinsics | None = None, framing: Framing | None = None
    ) -> ResolvedRig:
        """The rig around a video of this size, which may be framed out of larger pictures, with every number known; or
        around a camera that is `known`, such as that of a scene, whatever the rig says of it.  Raises UsageError where
        they do not fit."""
        source = _statable("the source's", known or self.source.intrinsics(source_size, framing))
        viewpoints = [
            Viewpoint(camera, _statable(f"camera {camera.name}'s", camera.intrinsics(source)), camera.pose)
            for camera in self.cameras
        ]
        return ResolvedRig(source, known is None and self.source.assumed, tuple(viewpoints))


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera in its place: how it maps directions to pixels, and its pose in the rig."""

    camera: Camera
    intrinsics: Intrinsics
    pose: Pose


@dataclass(frozen=True, eq=False)
class ResolvedRig:
    """A rig around a video: the intrinsics of the video, whether its field of view was assumed, and the cameras."""

    source: Intrinsics
    source_assumed: bool
    viewpoints: tuple[Viewpoint, ...]

    def settled(self, framing: Framing | None = None) -> Rig:
        """The rig with every number in it, so that it means the same around any video of this size; also where it is
        framed out of pictures of this size, whose lens a lens of this size is taken for."""
        cameras = [view.camera.model_copy(update=_stated(view.intrinsics)) for view in self.viewpoints]
        lens = self.source
        if framing is not None and framing.whole == framing.size:
            lens = framing.lens_of_whole(lens)
        return Rig(source=Source.of(lens), cameras=tuple(cameras))

    def describe(self) -> dict[str, Any]:
        """All of it, ready for JSON; reading it again gives the same light."""
        return {
            "source": self.source.model_dump(mode="json") | {"assumed": self.source_assumed},
            "cameras": [
                view.camera.model_dump(mode="json", include=OF_THE_CAMERA)
                | {"intrinsics": view.intrinsics.model_dump(mode="json")}
                | {"rotation": view.pose.rotation.tolist(), "translation_m": view.pose.translation_m.tolist()}
                for view in self.viewpoints
            ],
        }


def _statable(whose: str, lens: Intrinsics) -> Intrinsics:
    """The lens, which a rig file can state, so that a recording's says what was seen through; raises UsageError."""
    try:
        Source.of(lens)
    except ValueError as error:
        focal, centre = (f"{across:g}, {down:g} px" for across, down in (lens.focal_px, lens.centre_px))
        raise UsageError(
            f"{whose} lens at {lens.size[0]}x{lens.size[1]} has the focal lengths {focal} and the centre {centre}; rigs"
            f" have focal lengths of {SHORTEST_PX:g} to {FARTHEST:g} px, and centres within {FARTHEST:g} px"
        ) from error
    return lens


def _stated(lens: Intrinsics) -> dict[str, Any]:
    """The keys of `Optics` that mean these intrinsics."""
    model = None if lens.model == "none" else lens.model
    stated = {"size": lens.size, "fov_deg": None, "focal_px": lens.focal_px, "centre_px": lens.centre_px}
    return stated | {"distortion_model": model, "distortion": lens.distortion}


OF_THE_CAMERA = {"name", "kind", "clock_offset_us", "sensor", "set", "seed"}


def default_rig(frames: bool = False) -> Rig:
    """The rig of a recording without a rig file: an event camera, and with `frames` a frame camera, where the video was
    taken."""
    cameras = Camera(name="dvs", kind="dvs"), Camera(name="cis", kind="cis")
    return Rig(cameras=cameras if frames else cameras[:1])


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation nearest to a matrix [3, 3] of few digits.  Raises ValueError for what is no rotation.

    Source: the orthogonal Procrustes problem, P. Schoenemann, Psychometrika 1966.
    """
    near = np.abs(matrix).max() < 2 and np.abs(matrix.T @ matrix - np.eye(3)).max() < NEARLY_A_ROTATION
    if not near or np.linalg.det(matrix) < 0:
        raise ValueError("its rows must be of length 1 and at right angles, as a rotation's are, without a mirror")
    left, _, right = np.linalg.svd(matrix)
    return left @ right
