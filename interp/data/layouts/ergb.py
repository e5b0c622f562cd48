"""HS-ERGB and BS-ERGB: a folder of pictures with their times, and a folder of event files.

    HS-ERGB   SEQUENCE/images_corrected/000000.png, timestamp.txt     SEQUENCE/events_aligned/000000.npz   x y t p
    BS-ERGB   SEQUENCE/images/000000.png, timestamp.txt               SEQUENCE/events/000000.npz   x y timestamp
              polarity

Times are microseconds, one to a line.  Some folders have more pictures than times, or more times than pictures: the
first ones belong together, or the last times where the first do not increase.  Where pictures are missing by their
numbers, and there is a time for each number, a picture has the time of its number.  Some have lines above the times
that are none.  Events lie on the pictures, between pixels; what lies beyond is dropped where they are counted
(`Placed.within`), never moved to the border.

Sources: Tulyakov et al., "Time Lens", CVPR 2021, and "Time Lens++", CVPR 2022, and the READMEs of their data.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from interp.data.layouts.event_parts import EventParts, numbered
from interp.data.layouts.sequence import Placed
from interp.data.picture_codes import codes_in
from interp.representation.dead_time import DeadTime
from vid2ev.errors import DataError
from vid2ev.recording.exposures import LATEST_US
from vid2ev.terminal import counted


class Names(NamedTuple):
    """What a layout calls its folders and the columns of its event files."""

    images: str
    events: str
    columns: tuple[str, str, str, str]  # x, y, t, p
    events_after: bool  # file n has the events after picture n, not before it
    scaled: bool  # coordinates are written as pixels times 32


LAYOUTS = {
    "hsergb": Names("images_corrected", "events_aligned", ("x", "y", "t", "p"), False, False),
    "bsergb": Names("images", "events", ("x", "y", "timestamp", "polarity"), True, True),
}
MOMENT = 0.25  # of the time between pictures
STAMPS = ("timestamp.txt", "timestamps.txt")


class Ergb:
    """A sequence in one of the two layouts.

    pictures   the files of its frames
    Raises DataError for a folder that has no pictures, or no times for them.
    """

    curve = "srgb"
    contrast: tuple[float, float] | None = None
    dead_time: DeadTime | None = None
    apart = True  # two cameras, brought together for one distance

    def __init__(self, folder: Path, layout: str):
        names = LAYOUTS[layout]
        if not (folder / names.events).is_dir():
            raise DataError(f"{folder}: no folder {names.events}; expected the events of its pictures in it")
        self.name, self.folder, self.remarks = folder.name, folder, list[str]()
        pictures, stamps = numbered(folder / names.images, ".png"), self._stamps(folder / names.images)
        stamps = self._of_numbers(pictures, stamps)
        if len(stamps) != len(pictures):  # (a line for each: then lines that are no times have pictures, too)
            stamps = self._of_numbers(pictures, [t_us for t_us in stamps if t_us is not None])
        if not pictures or not stamps:
            raise DataError(f"{folder}: {_both(pictures, stamps)}; expected some of both")
        if len(pictures) != len(stamps):
            stamps = self._paired(pictures, stamps)
        timed = [(picture, t_us) for picture, t_us in zip(pictures, stamps, strict=False) if t_us is not None]
        if not timed:
            raise DataError(f"{folder}: no picture has a time; expected one to a line of {STAMPS[0]}")
        self.pictures = [picture for picture, _ in timed]
        self.times_us = np.array([t_us for _, t_us in timed], np.int64)
        self.size = self._picture(0).shape[1::-1]
        self.event_size = self.size
        self._parts = EventParts(folder / names.events, self.size)
        self.remarks += self._parts.remarks

    @property
    def covered_us(self) -> tuple[int, int]:
        """From the first event to the last; a picture taken a moment before or after is not left out for it."""
        typical_us = float(np.median(np.diff(self.times_us))) if len(self.times_us) > 1 else 0.0
        moment_us = int(MOMENT * typical_us)
        return self._parts.first_us - moment_us, self._parts.last_us + moment_us

    @property
    def unknown_us(self) -> list[tuple[int, int]]:
        """What files that are missing or cannot be read may have held."""
        return self._parts.unknown_us

    def frame(self, k: int) -> np.ndarray:
        """Picture k, red, green, blue."""
        picture = self._picture(k)
        if picture.shape[1::-1] != self.size:
            (width, height), (wide, high) = picture.shape[1::-1], self.size
            raise DataError(
                f"{self.pictures[k]}: {width}x{height} pixels, expected {wide}x{high} as the first picture has; leave"
                " it out with its time"
            )
        return picture

    def key(self, k: int) -> np.ndarray:
        """Picture k."""
        return self.frame(k)

    def looks(self, t_us: int) -> tuple[()]:
        """Nobody says so."""
        return ()

    def events(self, start_us: int, stop_us: int) -> Placed:
        """The events in (start_us, stop_us]."""
        return self._parts.between(start_us, stop_us)

    def _picture(self, k: int) -> np.ndarray:
        found = codes_in(self.pictures[k])
        if found is None:
            raise DataError(f"{self.pictures[k]} is no picture that can be read; leave it out with its time")
        return found

    def _paired(self, pictures: list[Path], stamps: list[int | None]) -> list[int | None]:
        """The first times for as many pictures; the last ones where only these increase: lines above them are wrong."""
        some = min(len(pictures), len(stamps))
        which = "last" if not _increase(stamps[:some]) and _increase(stamps[-some:]) else "first"
        self.remarks.append(f"{_both(pictures, stamps)}: pairs are made of the {which} {some}")
        return stamps[-some:] if which == "last" else stamps[:some]

    def _of_numbers(self, pictures: list[Path], stamps: list[int | None]) -> list[int | None]:
        """The times of the pictures' numbers, where some of these are left out and there is a time for each; else the
        times as they are."""
        numbers = [int(path.stem) for path in pictures]
        span = numbers[-1] - numbers[0] + 1 if numbers else 0
        if span != len(stamps) or span == len({*numbers}) or len({*numbers}) < len(numbers):
            return stamps
        missing = span - len(numbers)
        said = "is missing: its time is" if missing == 1 else "are missing: their times are"
        self.remarks.append(f"{missing} of {span} pictures {said} left out")
        return [stamps[number - numbers[0]] for number in numbers]

    def _stamps(self, folder: Path) -> list[int | None]:
        """The times [us] of the pictures; None of lines that say something else, which are counted."""
        path = next((folder / name for name in STAMPS if (folder / name).is_file()), None)
        if path is None:
            raise DataError(f"{folder}: no {STAMPS[0]}; expected the times of its pictures, one to a line")
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
        times = [_time_us(line) for line in lines if line.strip()]
        if strange := times.count(None):
            self.remarks.append(f"{strange} of the {len(times)} lines of {path.name} say no time")
        return times


def _both(pictures: list[Path], stamps: list[int | None]) -> str:
    return f"{counted(len(pictures), 'picture')} and {counted(len(stamps), 'time')}"


def _increase(stamps: list[int | None]) -> bool:
    """Whether times go up from each to the next, whatever lines between them say no time."""
    times = [t_us for t_us in stamps if t_us is not None]
    return all(a < b for a, b in pairwise(times))


def _time_us(line: str) -> int | None:
    """The time that a line begins with, None if it is none."""
    try:
        t_us = round(float(line.split()[0]))
    except (ValueError, OverflowError):
        return None
    return t_us if abs(t_us) < LATEST_US else None
