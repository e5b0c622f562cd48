"""Videos and folders of images to interpolate: frames, and no events."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import torch

from interp.interpolate.instants import rate_of
from interp.interpolate.take import Key, Options
from interp.light import to_codes
from interp.own_codes import BRIGHT, curve_of, curve_of_film
from interp.representation.dead_time import DeadTime
from vid2ev import Events, open_source
from vid2ev.errors import DataError, UsageError
from vid2ev.light.transfer import parse_transfer
from vid2ev.pictures.brightest import MOST_OF_HALF_FLOATS
from vid2ev.recording.manifest import identity
from vid2ev.sources.edit import unedited


class OfSource:
    """Frames of whatever `vid2ev.open_source` opens."""

    event_size: tuple[int, int] | None = None
    contrast: tuple[float, float] | None = None
    dead_time: DeadTime | None = None
    apart = False

    def __init__(self, path: str, options: Options, has_events: bool = False):
        of_events = {"--contrast": options.contrast, "--refractory": options.refractory_us}
        if (asked := [name for name, value in of_events.items() if value is not None]) and not has_events:
            raise UsageError(f"{asked[0]} is of events, and {path} has none; leave it out")
        try:
            self._source = open_source(
                path,
                transfer=options.transfer,
                fps=options.source_hz,
                colour="rgb",
                start=options.start_s,
                stop=options.stop_s,
                crop=options.crop,
                size=options.size,
            )
        except (UsageError, DataError) as error:
            raise type(error)(_by_its_name(str(error))) from error
        if not self._source.rewindable:
            raise UsageError(f"{path} can be read once only; save it as a file to interpolate it")
        self._about = self._source.describe()
        self.name, self.size = Path(path).stem, self._source.size
        self.channels = 1 if _is_grey(self._about) else 3
        self.bits = 8 if self._about.get("bits", 16) <= 8 or self._about.get("type") == "uint8" else 16
        said = str(self._about.get("transfer", "srgb"))
        whole = said == "srgb" and not self._about.get("edits", {}).get("resized", False)
        self._top = np.float32({"uint8": 255, "uint16": 65535}.get(str(self._about.get("type")), 0) * whole)
        self._by_light = said in BRIGHT
        self.bright = str(self._about.get("type")).startswith("float") or _goes_beyond_white(said)
        self.curve, self.coded = curve_of_film(said), curve_of(self._about)
        rate = self._about.get("fps") or self._about.get("rate")
        self.rate = Fraction(rate) if rate else self._mean_rate()

    @property
    def remarks(self) -> list[str]:
        """Those of the source."""
        return [*map(_by_its_name, self._source.warnings)]

    @property
    def gaps_expected(self) -> int | None:
        """By the header of the file."""
        count = self._source.frames_expected
        return None if count is None else max(count - 1, 0)

    def looks(self, t_us: int) -> tuple[()]:
        """Nobody says so."""
        return ()

    def describe(self, besides: Collection[Path] = ()) -> dict[str, Any]:
        """What the source says."""
        path = Path(str(self._about.get("path", "")))
        return self._about | ({"identity": identity(path, besides=besides)} if path.exists() else {})

    def keys(self, start: int = 0) -> Iterator[Key]:
        """See `Take`."""
        for frame in self._source.frames(start):
            light = np.nan_to_num(frame.light[..., : self.channels], nan=0.0, posinf=MOST_OF_HALF_FLOATS)
            yield Key(round(Fraction(frame.t_ns, 1000)), self._codes(light), light=light if self._by_light else None)

    def _codes(self, light: np.ndarray) -> np.ndarray:
        """Of light that is finite."""
        codes = to_codes(torch.from_numpy(light), "srgb").numpy()
        if self._top:
            codes *= self._top
            np.rint(codes, out=codes)
            codes /= self._top
        return codes

    def _mean_rate(self) -> Fraction:
        """Of the whole: where a part begins and ends, there need not be a frame."""
        whole = unedited(self._source)
        count, span_s = whole.frames_expected, whole.duration_expected_s
        return rate_of(Fraction((count - 1) / span_s)) if count and count > 1 and span_s else Fraction(30)

    def events(self, start_us: int, stop_us: int) -> Events | None:
        """None."""
        return None


def _goes_beyond_white(curve: str) -> bool:
    """Whether the highest code of a curve is brighter than white."""
    return bool(parse_transfer(curve).to_light(np.ones(1))[0] > 1)


def _is_grey(about: dict[str, Any]) -> bool:
    if about.get("kind") == "images":
        from vid2ev.light.grey import is_grey
        from vid2ev.light.recognise import pictures_in

        path = Path(about["path"])
        pictures = pictures_in(path) if path.is_dir() else [path]
        return all(map(is_grey, pictures))
    return str(about.get("pixel_format", "")).startswith("gray")


def _by_its_name(said: str) -> str:
    """What a source says, with the options that there are here: --fps is that of the frames to make, and a single
    picture needs its events."""
    said = said.replace("let a camera move over it with --motion pan", "its events with --events")
    return re.sub(r"^fps\b|(?<![\w-])--fps\b", "--source-fps", said)
