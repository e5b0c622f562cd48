"""A world at one instant: what renderers are given.

    X_world = thing.pose.apply(X_thing)           all lengths in metres
    light   = albedo (sum of E cos(turn) + emission) + specular (sum of E cos(turn) cos(half)^shininess)
    albedo  = colour * texture(repeat * (u, v))          with 1 more of u or v where its repeat is negative

E is the light that a lamp sends to the point, relative: a white diffuse surface under ambient light of 1.0 has light
1.0, and so has one that faces a sun of 1.0, or a point lamp of 1.0 from a distance of `reach_m`.

**Pictures on shapes.** (0, 0) is the outer corner of the picture's first pixel, (1, 1) that of its last.  Coordinates
of a world may be those of a camera (x right, y down, z forwards): then what faces the camera shows its picture upright.

    plane      (u, v) = (x, y) / size + 1/2, seen from -z; both sides show the same
    box        each side as a plane, upright and not mirrored from outside
    sphere     u = 1/2 + atan2(x, -z) / 2 pi,  v = acos(-y) / pi, of the unit sphere before it is scaled
    cylinder   around its axis z: u = 1/2 - atan2(y, x) / 2 pi,  v = z / size + 1/2; its ends as planes
    mesh       (u, v) of its corners
    environment  u = 1/2 + atan2(x, z) / 2 pi,  v = acos(-y) / pi, of the direction in which one looks

A picture is repeated where (u, v) leaves 0 ... 1; on planes, boxes and along v of spheres and cylinders, a `repeat` of
-1 to 1 holds its border's colour instead.  A negative `repeat` shows the picture mirrored.

Source of the law of light: J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977,
with the highlight weighted by cos(turn), so that it fades where the lamp sets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS
from vid2ev.rig.pose import IDENTITY, Pose

if TYPE_CHECKING:
    from vid2ev.scenes.mesh_numbers import MeshNumbers

Colour = tuple[float, float, float]
Point = tuple[float, float, float]
Kind = Literal["plane", "box", "sphere", "cylinder", "mesh"]
LampKind = Literal["ambient", "point", "sun"]

KINDS: tuple[Kind, ...] = ("plane", "box", "sphere", "cylinder", "mesh")
LAMP_KINDS: tuple[LampKind, ...] = ("ambient", "point", "sun")
WHITE: Colour = (1.0, 1.0, 1.0)


class Levels(NamedTuple):
    """A picture and its halvings: `pixels` float32 [all, 3]; `sizes` int64 [levels, 3], first pixel, width, height."""

    pixels: np.ndarray
    sizes: np.ndarray


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface or around the world: float32 [H, W, 3], linear light, 1.0 white (an environment: any)."""

    pixels: np.ndarray

    def __post_init__(self) -> None:
        shape = np.shape(self.pixels)
        if len(shape) != 3 or shape[2] != 3 or 0 in shape:
            raise UsageError(f"a texture of shape {shape} must be [height, width, 3 (red, green, blue)]")
        pixels = np.ascontiguousarray(self.pixels, np.float32)
        object.__setattr__(self, "pixels", np.nan_to_num(pixels, nan=0.0, posinf=MOST_OF_HALF_FLOATS, neginf=0.0))

    @cached_property
    def levels(self) -> Levels:
        """The picture and its halvings by area, down to one pixel."""
        import cv2

        all_levels = [self.pixels]
        while max(all_levels[-1].shape[:2]) > 1:
            height, width = (max(1, length // 2) for length in all_levels[-1].shape[:2])
            all_levels.append(cv2.resize(all_levels[-1], (width, height), interpolation=cv2.INTER_AREA))
        counts = [level.shape[0] * level.shape[1] for level in all_levels]
        firsts = np.cumsum([0, *counts[:-1]])
        sizes = [(first, level.shape[1], level.shape[0]) for first, level in zip(firsts, all_levels, strict=True)]
        return Levels(np.concatenate([level.reshape(-1, 3) for level in all_levels]), np.array(sizes, np.int64))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: `vertices` [n, 3] float64 m, `triangles` [m, 3] int32, counter-clockwise seen from outside.

    uv       [n, 2] of each vertex, or None
    normals  [n, 3] of each vertex for smooth shading, or None: each triangle is flat
    colours  [n, 3] of each vertex, linear, or None
    texture  the picture that came with the mesh, used where the surface has none
    """

    vertices: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray | None = None
    normals: np.ndarray | None = None
    colours: np.ndarray | None = None
    texture: Texture | None = None

    def __post_init__(self) -> None:
        _hold(self, "vertices", np.float64, 3)
        _hold(self, "triangles", np.int32, 3)
        for name, across in (("uv", 2), ("normals", 3), ("colours", 3)):
            if getattr(self, name) is not None:
                _hold(self, name, np.float64, across)
                if len(getattr(self, name)) != len(self.vertices):
                    raise UsageError(f"a mesh has {len(self.vertices)} vertices and {len(getattr(self, name))} {name}")
        if len(self.triangles) == 0:
            raise UsageError("a mesh must have a triangle")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise UsageError(f"triangles of a mesh must name vertices 0 to {len(self.vertices) - 1}")
        if not np.isfinite(self.vertices).all():
            raise UsageError("vertices of a mesh must be finite numbers")

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """The least and the greatest x, y, z [3] of its triangles; vertices of none do not count."""
        spots = self.vertices[self.triangles.reshape(-1)]
        return spots.min(axis=0), spots.max(axis=0)

    @property
    def size_m(self) -> np.ndarray:
        """The full extents [3]."""
        return self.box[1] - self.box[0]

    @cached_property
    def ball(self) -> tuple[np.ndarray, float]:
        """The centre [3] and radius of a ball around it."""
        low, high = self.box
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2

    @cached_property
    def numbers(self) -> MeshNumbers:
        """The triangles in a hierarchy of boxes, as rays meet them."""
        from vid2ev.scenes.mesh_numbers import numbers_of

        return numbers_of(self)


@dataclass(frozen=True, eq=False)
class Shape:
    """A form around its own origin.

    size_m  full extents x, y, z [m], >= 0: of a plane x and y, in its own z = 0, seen from both sides; of a sphere the
            axes of the ellipsoid; of a cylinder the axes of its ellipse and its length along z, with closed ends;
            of a mesh nothing (its vertices are in metres, in its own coordinates)
    """

    kind: Kind
    size_m: Point = (1.0, 1.0, 1.0)
    mesh: Mesh | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(f"a shape of kind '{self.kind}' must be one of {', '.join(KINDS)}")
        if (self.kind == "mesh") != (self.mesh is not None):
            raise UsageError(f"a shape of kind '{self.kind}' {'needs a' if self.kind == 'mesh' else 'takes no'} mesh")
        if len(self.size_m) != 3 or not all(0 <= length < math.inf for length in self.size_m):
            raise UsageError(f"the size {tuple(self.size_m)} of a shape must be three lengths of at least 0 m")


@dataclass(frozen=True, eq=False)
class Surface:
    """What a thing looks like.

    texture    a picture, times `colour`; repeated `repeat` = (u, v) times over the shape
    specular   the highlight's height, 0 ... ; `shininess` its exponent (Blinn-Phong)
    emission   light of its own, times the albedo; above 1 for lamps
    """

    texture: Texture | None = None
    colour: Colour = WHITE
    repeat: tuple[float, float] = (1.0, 1.0)
    specular: float = 0.0
    shininess: float = 32.0
    emission: float = 0.0


@dataclass(frozen=True, eq=False)
class Thing:
    """A shape with a surface, somewhere: `pose` leads from its own coordinates to those of the world."""

    name: str
    shape: Shape
    surface: Surface = field(default_factory=Surface)
    pose: Pose = IDENTITY


@dataclass(frozen=True, eq=False)
class Lamp:
    """Light from everywhere (`ambient`), from a point (falling with the square of the distance), or from afar (`sun`).

    colour       linear; ambient and sun: the light of a white surface that faces them; point: that from `reach_m` away
    position_m   of a point lamp, in the world
    direction    in which the light of a sun goes, in the world; of any length > 0
    reach_m      where a point lamp has the light of its colour [m]; nearer than 1 % of it, light grows no more
    shadows      whether things cast (hard) shadows in its light
    """

    kind: LampKind
    colour: Colour = WHITE
    position_m: Point = (0.0, 0.0, 0.0)
    direction: Point = (0.0, 1.0, 0.0)
    reach_m: float = 1.0
    shadows: bool = False

    def __post_init__(self) -> None:
        if self.kind not in LAMP_KINDS:
            raise UsageError(f"a lamp of kind '{self.kind}' must be one of {', '.join(LAMP_KINDS)}")
        if not self.reach_m > 0:
            raise UsageError(f"a lamp's reach of {self.reach_m} m must be greater than 0")
        if self.kind == "sun" and not np.linalg.norm(self.direction) > 0:
            raise UsageError("a sun's direction must have a length greater than 0")


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Things and lamps at one instant.

    environment   the light around, by latitude and longitude: the background, and ambient light of every surface by its
                  average over each half of all directions (second-order spherical harmonics); None: black
    """

    things: Sequence[Thing] = ()
    lamps: Sequence[Lamp] = ()
    environment: Texture | None = None
    environment_gain: float = 1.0
    environment_pose: Pose = IDENTITY


def _hold(mesh: Mesh, name: str, dtype: type, across: int) -> None:
    """Let a field of the mesh be an array of this type and shape."""
    values: np.ndarray = np.ascontiguousarray(getattr(mesh, name), dtype)
    if values.ndim != 2 or values.shape[1] != across:
        raise UsageError(f"{name} of a mesh must have shape [n, {across}], not {list(values.shape)}")
    object.__setattr__(mesh, name, values)
