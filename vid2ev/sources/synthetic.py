"""Synthetic clips whose light is a formula, so that what a sensor ought to answer is known.

On the command line `synthetic:NAME`, with parameters after commas: `synthetic:sine,frequency_hz=50,size=64x48`.  A new
clip is a class with its formula in `light`, and a place in `SYNTHETIC`.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.requests import number_of
from vid2ev.sources.source import LARGEST
from vid2ev.sources.times import parse_fps, round_ns
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import BRIGHTEST

WIDEST_NAT = 61.0  # of a swing: from what float32 can still hold to the brightest light that sensors take


@dataclass(frozen=True)
class SyntheticClip(ABC):
    """A clip of `size` (width, height) with frames at k / fps from 0 to duration_s [s], both ends included."""

    name: ClassVar[str]
    above_0: ClassVar[tuple[str, ...]] = ()  # parameters of which the formula makes sense above 0 only,
    from_0: ClassVar[tuple[str, ...]] = ("duration_s",)  # and from 0 on
    kept: ClassVar[None] = None
    size: tuple[int, int] = (320, 240)
    fps: float = 240.0
    duration_s: float = 1.0
    warnings: list[str] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        parse_fps(self.fps)
        numbers = [getattr(self, f.name) for f in fields(self) if f.name not in ("size", "warnings")]
        if min(self.size) < 1 or max(self.size) > LARGEST or not all(abs(number) <= BRIGHTEST for number in numbers):
            raise UsageError(
                f"synthetic:{self.name}: {self}; expected numbers up to {BRIGHTEST:g}, and a size from 1x1 to"
                f" {LARGEST}x{LARGEST}"
            )
        for key in (*self.above_0, *self.from_0):
            if (value := getattr(self, key)) < 0 or (value == 0 and key in self.above_0):
                least = "above 0" if key in self.above_0 else "from 0 on"
                raise UsageError(f"synthetic:{self.name}: {key}={value:g}; expected a number {least}")

    @abstractmethod
    def light(self, t_ns: int) -> np.ndarray:
        """Light [float32, H x W] at an instant."""

    @property
    def rewindable(self) -> bool:
        """A formula can be asked again."""
        return True

    @property
    def dense(self) -> bool:
        """There is as much between its frames as between those of a video."""
        return False

    @property
    def duration_expected_s(self) -> float:
        """From the first frame to the last [s]."""
        return float((self.frames_expected - 1) / parse_fps(self.fps))

    @property
    def frames_expected(self) -> int:
        """The number of frames."""
        return math.floor(Fraction(str(self.duration_s)) * parse_fps(self.fps)) + 1

    def describe(self) -> dict[str, Any]:
        """The name and all parameters, for the manifest."""
        parameters = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "warnings"}
        return {"kind": "synthetic", "name": self.name} | parameters | {"size": list(self.size)}

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        fps = parse_fps(self.fps)
        for k in range(start, self.frames_expected):
            t_ns = round_ns(k / fps)
            yield Frame(self.light(t_ns), t_ns)

    def _even(self, light: float) -> np.ndarray:
        return np.full(self.size[::-1], light, np.float32)


@dataclass(frozen=True)
class Ramp(SyntheticClip):
    """Log light rises evenly from ln(low) to ln(high): ln(low) + d is reached at duration_s d / ln(high / low)."""

    name = "ramp"
    above_0 = ("duration_s", "low", "high")
    low: float = 0.05
    high: float = 1.0

    def light(self, t_ns: int) -> np.ndarray:
        return self._even(self.low * (self.high / self.low) ** (t_ns * 1e-9 / self.duration_s))


@dataclass(frozen=True)
class Sine(SyntheticClip):
    """Log light swings by amplitude_nat [nat] about ln(mean), frequency_hz times a second, rising first."""

    name = "sine"
    from_0 = ("duration_s", "mean")
    mean: float = 0.2
    amplitude_nat: float = 0.5
    frequency_hz: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(self.amplitude_nat) > WIDEST_NAT:
            raise UsageError(f"synthetic:sine: amplitude_nat={self.amplitude_nat:g}; expected at most {WIDEST_NAT:g}")

    def light(self, t_ns: int) -> np.ndarray:
        swing = math.sin(2 * math.pi * self.frequency_hz * t_ns * 1e-9)
        return self._even(self.mean * math.exp(self.amplitude_nat * swing))


@dataclass(frozen=True)
class Step(SyntheticClip):
    """Light is `low` before at_s [s] and `high` from then on."""

    name = "step"
    from_0 = ("duration_s", "low", "high")
    low: float = 0.1
    high: float = 0.5
    at_s: float = 0.5

    def light(self, t_ns: int) -> np.ndarray:
        return self._even(self.high if t_ns * 1e-9 >= self.at_s else self.low)


@dataclass(frozen=True)
class MovingEdge(SyntheticClip):
    """A soft upright edge, bright on its left, moves right at speed [px/s] from column `start` at time 0.

    light(x, t) = low + (high - low) Phi((start + speed t - x) / width), Phi the normal distribution, `width`
    [px] its standard deviation.
    """

    name = "moving-edge"
    above_0 = ("width",)
    from_0 = ("duration_s", "low", "high")
    low: float = 0.1
    high: float = 0.6
    speed: float = 200.0
    start: float = 20.0
    width: float = 1.5

    def light(self, t_ns: int) -> np.ndarray:
        place, edge = self.start + self.speed * t_ns * 1e-9, NormalDist()
        row = [edge.cdf((place - x) / self.width) for x in range(self.size[0])]
        return np.tile((self.low + (self.high - self.low) * np.array(row)).astype(np.float32), (self.size[1], 1))


@dataclass(frozen=True)
class Black(SyntheticClip):
    """No light at all."""

    name = "black"

    def light(self, t_ns: int) -> np.ndarray:
        return self._even(0.0)


@dataclass(frozen=True)
class Flash(SyntheticClip):
    """Light is `dark`, but for `bright` from at_s [s] for length_s [s]."""

    name = "flash"
    from_0 = ("duration_s", "dark", "bright", "length_s")
    dark: float = 0.0
    bright: float = 1e6
    at_s: float = 0.5
    length_s: float = 0.05

    def light(self, t_ns: int) -> np.ndarray:
        begin_ns, length_ns = round(1e9 * self.at_s), round(1e9 * self.length_s)
        return self._even(self.bright if 0 <= t_ns - begin_ns < length_ns else self.dark)


SYNTHETIC: dict[str, type[SyntheticClip]] = {clip.name: clip for clip in (Ramp, Sine, Step, MovingEdge, Black, Flash)}


def parse_synthetic(text: str) -> SyntheticClip:
    """The clip of `NAME` or `NAME,key=value,...`.  Raises UsageError."""
    name, *settings = text.split(",")
    if name not in SYNTHETIC:
        raise UsageError(f"synthetic:{name}: expected one of {', '.join(SYNTHETIC)}")
    clip = SYNTHETIC[name]()
    known = {f.name: getattr(clip, f.name) for f in fields(clip) if f.init}
    values: dict[str, Any] = {}
    for setting in settings:
        key, _, value = setting.partition("=")
        if key not in known:
            raise UsageError(f"synthetic:{name}: parameter '{key}' is not one of {', '.join(known)}")
        values[key] = _size(value) if key == "size" else number_of(value)
        if values[key] is None or values[key] != values[key]:
            expected = "WIDTHxHEIGHT, such as 320x240" if key == "size" else "a number"
            raise UsageError(f"synthetic:{name}: {key}='{value}', expected {expected}")
    return replace(clip, **values)


def _size(text: str) -> tuple[int, int] | None:
    found = re.fullmatch(r"(-?[0-9]{1,9})x(-?[0-9]{1,9})", text)
    return (int(found[1]), int(found[2])) if found else None
