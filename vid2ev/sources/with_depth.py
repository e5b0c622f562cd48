"""A source whose frames carry their depth.

On the command line depth is named in one text, with what its numbers mean after commas (`rig/depth.py` has all of it):

    plane:2.5      maps/,scale=0.001      disparity.npy,baseline_m=0.193,focal_px=995      model:FOLDER,scale=0.2
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from vid2ev.errors import UsageError, nearest
from vid2ev.recording.manifest import identity
from vid2ev.requests import number_of
from vid2ev.rig.depth import KINDS, Depth, open_depth
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.sources.edit import Edit
from vid2ev.sources.source import Source
from vid2ev.stream.frames import Frame

NUMBERS = ("scale", "shift", "focal_px", "baseline_m")
_SETTING = re.compile(r"(,\w+=[^,=]*)+$")


class WithDepth(Edit):
    """A source with the depth of its frames; `name` says where it is from."""

    def __init__(self, source: Source, depth: Depth, name: str):
        super().__init__(source)
        self._depth, self._name = depth, name
        self._frames = 0  # in all, once that is known

    @property
    def warnings(self) -> list[str]:
        """What a person should know."""
        maps, frames = self._depth.count, self._frames
        if maps is None or not 0 < frames < maps:
            return super().warnings
        said = (
            f"{maps} depth maps, of which only the first {frames} had a frame; are they of other times than the frames?"
        )
        return [*super().warnings, f"{self._name}: {said}"]

    def edits(self) -> dict[str, Any]:
        """Where the depth is from, and by what its files are known again."""
        path = Path(_SETTING.sub("", self._name))
        return {"depth": {"named": self._name} | (identity(path) if path.exists() else {})}

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on."""
        return self.frames_between(None, None, start)

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """See `Divisible`; of frames outside of the part no depth is asked for."""
        skipped = start if since_ns is None else 0
        coming = enumerate(self.source.frames(skipped), skipped)
        part = (each for each in coming if since_ns is None or each[1].t_ns >= since_ns)
        seen = 0
        for index, frame in islice(part, start - skipped, None):
            if until_ns is not None and frame.t_ns > until_ns:
                return
            number = index if frame.number is None else frame.number  # (pictures that are dropped have maps, too)
            yield replace(frame, depth=self._depth.at(number, frame.light))
            seen = number + 1
        self._frames = seen


def parse_depth(text: str, lens: Intrinsics) -> Depth:
    """The depth that a text names, of pictures taken through a lens.  Raises UsageError, DataError."""
    name, settings = text, dict[str, Any]()
    while found := re.fullmatch(r"(.+),(\w+)=([^,=]*)", name):
        name, key, value = found[1], found[2], found[3]
        if key == "kind" and value in KINDS:
            settings[key] = value
        elif key in NUMBERS and not math.isnan(number := number_of(value)):
            settings[key] = number
        else:
            keys = ("kind", *NUMBERS)
            wanted = f"one of {', '.join(KINDS)}" if key == "kind" else "a number"
            why = f"expected {wanted}" if key in keys else f"unknown{nearest(key, keys)}; expected {', '.join(keys)}"
            raise UsageError(f"depth '{text}': {key}={value}: {why}")
    return open_depth(name, lens, **settings)
