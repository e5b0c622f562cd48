"""Depth of a video's frames: a plane, maps from files, or a model that looks at the pictures.

    plane:Z_M      a plane that faces the camera, Z_M metres in front of it; `plane:inf` is infinitely far
    PATH           a file or a folder: one map for all frames, or one for each (`depth_files.py`)
    model:NAME     a monocular model, by folder or by name (`depth_model.py`)

The numbers v in files and from models mean, by `kind`,

    depth          Z = scale v + shift                      m; the default
    disparity      Z = focal_px baseline_m / (scale v + shift)      px; shift is the offset of the principal points
    inverse        1 / Z = scale v + shift                  1/m; what most monocular models give

A depth map is float32 [H, W], z in the camera's coordinates [m]; +inf is infinitely far.  What is not known is NaN:
in files 0 of integers, NaN, and what leads to a depth or a disparity that is not greater than 0; infinite disparities.

Between two frames depth is interpolated in 1 / Z, as disparity is.  Where the two differ so much that something moved
in front of something else, or where only one is known, it is that of one frame, the nearer in time first: a mean would
be a depth at which there is nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.requests import number_of
from vid2ev.rig.intrinsics import Intrinsics

Kind = Literal["depth", "disparity", "inverse"]
KINDS = ("depth", "disparity", "inverse")
SAME_SURFACE = 1.25  # depths of one surface in two frames differ by less than this factor


class Depth(Protocol):
    """Depth of the frames of a video."""

    plane_m: float | None  # the distance, if it is a plane
    count: int | None  # how many frames there is a map of; None if of any

    def at(self, index: int, light: np.ndarray | None = None) -> np.ndarray:
        """The depth map of frame `index`, with this light, which only models look at.

        Raises DataError for a file that is missing or cannot be meant.
        """


@dataclass(frozen=True)
class DepthScale:
    """What numbers mean, see above; `scale` is 1 if not given where numbers are in metres or pixels anyway."""

    kind: Kind = "depth"
    scale: float | None = None
    shift: float = 0.0
    focal_px: float | None = None
    baseline_m: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(f"depth of kind '{self.kind}'; possible are {', '.join(KINDS)}")
        for name in ("scale", "focal_px", "baseline_m"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise UsageError(f"{name} {value:g} of depth; expected a number greater than 0")
        if not math.isfinite(self.shift):
            raise UsageError(f"shift {self.shift:g} of depth; expected a finite number")
        if self.kind == "disparity" and self.baseline_m is None:
            raise UsageError("disparity without a baseline; give baseline_m, the distance of the two cameras in metres")

    def depth_m(self, values: np.ndarray) -> np.ndarray:
        """Depth [float32, m] of values; NaN where it is not known.  Focal length and scale must be there."""
        known = values != 0 if values.dtype.kind in "iub" else ~np.isnan(values)
        with np.errstate(all="ignore"):
            scaled = np.float64(self.scale or 1.0) * values + self.shift
            if self.kind == "depth":
                depth, known = scaled, known & (scaled > 0)
            elif self.kind == "inverse":
                depth = np.where(scaled > 0, 1 / scaled, np.inf)
                known = known & ~np.isposinf(scaled)
            else:
                depth = (self.focal_px or math.nan) * (self.baseline_m or math.nan) / scaled
                known = known & np.isfinite(scaled) & (scaled > 0)
            return np.where(known, depth, np.nan).astype(np.float32)


class PlaneDepth:
    """A plane that faces the camera."""

    count: int | None = None

    def __init__(self, plane_m: float, size: tuple[int, int]):
        self.plane_m: float | None = plane_m
        self._map = np.full(size[::-1], plane_m, np.float32)

    def at(self, index: int, light: np.ndarray | None = None) -> np.ndarray:
        """The same map for all."""
        return self._map


def open_depth(
    text: str | Path,
    source: Intrinsics,
    *,
    kind: Kind | None = None,
    scale: float | None = None,
    shift: float = 0.0,
    focal_px: float | None = None,
    baseline_m: float | None = None,
) -> Depth:
    """Depth as named at the top, for pictures of `source`.

    kind       by default disparity if a baseline is given, else depth
    focal_px   of disparity; by default that of the source across

    Raises UsageError for what cannot be meant, DataError for files and models that cannot be read.
    """
    given = DepthScale(kind or ("disparity" if baseline_m is not None else "depth"), scale, shift, focal_px, baseline_m)
    for name, value in (("focal_px", focal_px), ("baseline_m", baseline_m)):
        if value is not None and given.kind != "disparity":
            raise UsageError(f"{name} {value:g} of depth: expected of disparity; leave it out, or set kind=disparity")
    meaning = replace(given, focal_px=focal_px or source.focal_px[0])
    if not str(text):  # (which a folder of depth would be: this one)
        raise UsageError("depth '': expected a map or a folder of maps, plane:METRES or model:NAME")
    name, _, rest = str(text).partition(":")
    if name == "plane":
        return PlaneDepth(_distance_m(rest), source.size)
    if name == "model":
        from vid2ev.rig.depth_model import ModelDepth

        return ModelDepth(rest, source.size, meaning, given.kind if baseline_m is not None else kind)
    from vid2ev.rig.depth_files import DepthFiles

    return DepthFiles(Path(text), source.size, meaning)


def plane_of(text: str | Path | None) -> float | None:
    """The distance [m] that a text names, if it names a plane.  Raises UsageError."""
    name, _, rest = str(text).partition(":")
    return _distance_m(rest) if name == "plane" else None


def between(before_m: np.ndarray, after_m: np.ndarray, share: float | np.ndarray) -> np.ndarray:
    """The depth after `share` (0 to 1) of the way from one map to another, in time or from pixel to pixel."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = 1 / before_m, 1 / after_m
        alike = np.maximum(first, second) <= SAME_SURFACE * np.minimum(first, second)
        mean = (1 / ((1 - share) * first + share * second)).astype(np.float32)
    nearer, other = np.where(share < 0.5, (before_m, after_m), (after_m, before_m))
    straight = np.where(share == 0, before_m, mean)  # (1 / (1 / Z) is not always Z)
    return np.where(alike, straight, np.where(np.isnan(nearer), other, nearer))


def _distance_m(text: str) -> float:
    distance_m = math.inf if text == "inf" else number_of(text)
    if not distance_m > 0:
        raise UsageError(f"depth 'plane:{text}'; expected a distance in metres, such as plane:2.5 or plane:inf")
    return distance_m
