"""Paths of a camera over a photograph.

A pose is where the camera looks, by [px] of its own picture from the middle of the photograph, right and down; the
angle [degrees] by which it is turned clockwise; and its zoom, relative to the scale of the whole clip.

    pan       x, y = speed (t - duration / 2) (cos angle, sin angle)
    saccade   (-1/2, 1/2) -> (0, -1/2) -> (1/2, 1/2) -> (-1/2, 1/2), times `degrees`, one jump every period; a jump over
              A degrees takes 21 ms + 2.2 ms A, its course is 10 s**3 - 15 s**4 + 6 s**5 of the way at the share s of
              its time
    zoom      zoom = factor**(t / duration - 1/2)
    FILE.csv  rows of t [s], x, y and, if wanted, angle and zoom; straight lines between them

Sources: the triangle of three saccades, 100 ms and a degree each, is that of N-MNIST (Orchard et al., "Converting
static image datasets to spiking neuromorphic datasets using saccades", Frontiers in Neuroscience 9, 2015); the duration
of saccades, Carpenter, "Movements of the Eyes", 1988; the course is that of least jerk (Flash and Hogan, J.
Neuroscience 5, 1985), to which eyes come near, but not quite (Harwood, Mezey and Harris, J. Neuroscience 19, 1999).
"""

from __future__ import annotations

import csv
import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, field, fields, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.requests import number_of
from vid2ev.sources.times import LONGEST_NS
from vid2ev.untrusted import read_lines

SAMPLES = 4001


class Pose(NamedTuple):
    """Where a camera looks, at one instant or at many."""

    x: Any
    y: Any
    angle: Any
    zoom: Any


@dataclass(frozen=True)
class Motion(ABC):
    """A path that lasts duration_s [s]; scale is output pixels per pixel of the photograph, 0 for all that fits."""

    name: ClassVar[str]
    duration_s: float = 1.0
    scale: float = 0.0

    def __post_init__(self) -> None:
        numbers = asdict(self).values()
        if not all(map(math.isfinite, numbers)) or not 0 < self.duration_s <= 1e6 or self.scale < 0:
            given = ", ".join(f"{key}={value:g}" for key, value in asdict(self).items())
            raise UsageError(
                f"motion {self.name}: {given}; expected finite numbers, a duration_s above 0 and at most 1e6, a scale"
                " from 0"
            )

    @property
    def begin_s(self) -> float:
        """The first instant [s]."""
        return 0.0

    def instants(self) -> np.ndarray:
        """Instants [s] close enough to each other to find extent and speed by."""
        return self.begin_s + np.linspace(0, self.duration_s, SAMPLES)

    @abstractmethod
    def at(self, t_s: np.ndarray) -> Pose:
        """The poses at instants from begin_s to begin_s + duration_s."""

    def describe(self) -> dict[str, Any]:
        """The name and all parameters, for the manifest."""
        return {"motion": self.name, **asdict(self)}


@dataclass(frozen=True)
class Pan(Motion):
    """Straight on at speed [px/s] towards angle [degrees]: 0 is right, 90 down."""

    name = "pan"
    speed: float = 200.0
    angle: float = 0.0

    def at(self, t_s: np.ndarray) -> Pose:
        way = self.speed * (t_s - self.duration_s / 2)
        towards = math.radians(self.angle)
        return Pose(way * math.cos(towards), way * math.sin(towards), np.zeros_like(way), np.ones_like(way))


@dataclass(frozen=True)
class Saccade(Motion):
    """Three jumps around a triangle `degrees` wide and high, one each third of duration_s."""

    name = "saccade"
    duration_s: float = 0.3
    degrees: float = 1.0
    px_per_degree: float = 20.0

    CORNERS: ClassVar[np.ndarray] = np.array([[-0.5, 0.5], [0.0, -0.5], [0.5, 0.5], [-0.5, 0.5]])

    def at(self, t_s: np.ndarray) -> Pose:
        period = self.duration_s / 3
        jump = np.clip((t_s / period).astype(int), 0, 2)
        begin, end = self.CORNERS[jump].T, self.CORNERS[jump + 1].T
        length = abs(self.degrees) * np.hypot(*(end - begin))
        share = np.clip((t_s - jump * period) / np.minimum(0.021 + 0.0022 * length, period), 0, 1)
        place = begin + (end - begin) * share**3 * (10 - 15 * share + 6 * share**2)
        x, y = place * self.degrees * self.px_per_degree
        return Pose(x, y, np.zeros_like(x), np.ones_like(x))


@dataclass(frozen=True)
class Zoom(Motion):
    """In by `factor`, evenly in its logarithm; a factor below 1 is out."""

    name = "zoom"
    factor: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.01 <= self.factor <= 100:
            raise UsageError(f"motion zoom: factor {self.factor}, expected 0.01 to 100")

    def at(self, t_s: np.ndarray) -> Pose:
        still = np.zeros_like(t_s)
        return Pose(still, still, still, self.factor ** (t_s / self.duration_s - 0.5))


@dataclass(frozen=True)
class Waypoints(Motion):
    """The path of a .csv file: its rows t, x, y, angle, zoom."""

    name = "path"
    path: str = ""
    rows: np.ndarray = field(default_factory=lambda: np.zeros((2, 5)), repr=False)

    def __post_init__(self) -> None:
        pass  # (its numbers are checked as they are read)

    @classmethod
    def read(cls, path: Path) -> Waypoints:
        """The path of a file.  Raises UsageError if it is not there, DataError for rows that make no path."""
        rows = _rows(path)
        duration = Fraction(str(rows[-1][0])) - Fraction(str(rows[0][0]))
        return cls(duration_s=float(duration), path=str(path), rows=np.array(rows))

    @property
    def begin_s(self) -> float:
        return float(self.rows[0, 0])

    def at(self, t_s: np.ndarray) -> Pose:
        t, *columns = self.rows.T
        return Pose(*(np.interp(t_s, t, column) for column in columns))

    def instants(self) -> np.ndarray:
        return np.unique(np.concatenate([super().instants(), self.rows[:, 0]]))

    def describe(self) -> dict[str, Any]:
        return {"motion": self.path, "duration_s": self.duration_s, "rows": self.rows.tolist()}


MOTIONS: dict[str, type[Motion]] = {motion.name: motion for motion in (Pan, Saccade, Zoom)}


def parse_motion(text: str) -> Motion:
    """The motion of `NAME`, `NAME:key=value,...` or `FILE.csv`.  Raises UsageError, DataError."""
    if text.lower().endswith(".csv"):
        return Waypoints.read(Path(text))
    name, _, settings = text.partition(":")
    if name not in MOTIONS:
        raise UsageError(f"motion '{text}': expected {', '.join(MOTIONS)} or a file PATH.csv")
    known = [parameter.name for parameter in fields(MOTIONS[name])]
    values: dict[str, float] = {}
    for setting in settings.split(",") if settings else []:
        key, _, value = setting.partition("=")
        if key not in known:
            raise UsageError(f"motion {name}: parameter '{key}' is not one of {', '.join(known)}")
        values[key] = number_of(value)
        if math.isnan(values[key]):
            raise UsageError(f"motion {name}: {key}='{value}', expected a number")
    return replace(MOTIONS[name](), **values)


def _rows(path: Path) -> list[list[float]]:
    """Rows t, x, y, angle, zoom of a file, with or without a line of names."""
    text = read_lines(path, f"{', '.join(MOTIONS)} or a file of rows t,x,y[,angle][,zoom]")
    try:
        lines = [[word.strip() for word in row] for row in csv.reader(text) if row and not row[0].startswith("#")]
    except csv.Error as error:
        raise DataError(f"{path}: cannot be read as CSV ({error}); expected rows of t,x,y[,angle][,zoom]") from error
    if not lines:
        raise DataError(f"{path}: no rows; expected rows of t,x,y[,angle][,zoom]")
    names = ["t", "x", "y", "angle", "zoom"][: max(map(len, lines))]
    if lines[0][0] == "t":
        names = lines.pop(0)
    if not {"t", "x", "y"} <= set(names) <= {"t", "x", "y", "angle", "zoom"} or len(set(names)) < len(names):
        raise DataError(f"{path}: columns {', '.join(names)[:80]}; expected t,x,y[,angle][,zoom]")
    rows = []
    for number, words in enumerate(lines, 1):
        try:
            row = {"angle": 0.0, "zoom": 1.0} | dict(zip(names, map(number_of, words), strict=True))
        except ValueError as error:
            raise DataError(f"{path}: row {number} is {','.join(words)[:80]}; expected {len(names)} numbers") from error
        if not all(map(math.isfinite, row.values())) or not 0.01 <= row["zoom"] <= 100:
            raise DataError(
                f"{path}: row {number} is {','.join(words)[:80]}; expected finite numbers, a zoom of 0.01 to 100"
            )
        rows.append([row[name] for name in ("t", "x", "y", "angle", "zoom")])
    if any(abs(row[0]) * 1e9 > LONGEST_NS for row in rows):
        raise DataError(f"{path}: a time beyond 146 years; expected seconds")
    if len(rows) < 2 or any(b[0] <= a[0] for a, b in pairwise(rows)):
        raise DataError(f"{path}: expected at least two rows, with times that rise")
    return rows
