"""Clips: what lies between two key frames, and the file that keeps one."""

from __future__ import annotations

import json
import re
import secrets
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interp.representation.event_counts import MOST_NATS
from vid2ev.errors import DataError
from vid2ev.recording.disk import write_npy
from vid2ev.requests import is_whole
from vid2ev.untrusted import first_line, json_of

HALF_WRITTEN = re.compile(r"\d+\.npy\.[0-9a-f]{16}\.new")  # by `write_clip`
LEFT_S = 3600.0  # since the last byte of one that nobody writes any more: a clip is written in less than a second


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """One gap between two key frames.

    truth      what the frame camera would have seen at K + 1 instants, even in time, both ends included, without
               exposure and noise: sRGB codes uint8, or linear light float16, [K + 1, H, W, 3]
    keys       the two key frames as the frame camera gave them, sRGB codes uint8 [2, H, W, 3]; the instants of the ends
               are the middles of their exposures.  One colour of both in place of three after `alter.grey`
    off_on     OFF and ON events in each of S equal sub-intervals, with what dead time hid, float16 [2, S, h, w]
    contrast   what an OFF and an ON event stand for, nominally [nat]
    gap_us     from key frame to key frame [us]
    about      where it comes from, and the event camera's place: ready for JSON
    """

    truth: np.ndarray
    keys: np.ndarray
    off_on: np.ndarray
    contrast: tuple[float, float]
    gap_us: int
    about: dict[str, Any]

    @property
    def multiple(self) -> int:
        """K: intervals between the frames of truth."""
        return len(self.truth) - 1

    @property
    def coarser(self) -> int:
        """Pixels of the frames per pixel of the event camera, across."""
        return self.truth.shape[2] // self.off_on.shape[3]

    @property
    def footprint(self) -> int:
        """Pixels of the frames, across, that a pixel of the event camera looked at: more where events were carried from
        larger ones into the geometry of the frames."""
        return int(self.about.get("footprint", self.coarser))


def write_clip(path: Path, clip: Clip) -> None:
    """Write a clip to a file that is there as a whole or not at all; the same clip gives the same bytes.

    It is not waited for to reach the disk: what a crash of the machine loses is made again.
    """
    about = json.dumps(clip.about, sort_keys=True).encode()
    arrays = {"truth": clip.truth, "keys": clip.keys, "off_on": clip.off_on}
    kinds: list[Any] = [(name, array.dtype, array.shape) for name, array in arrays.items()]
    kinds += [("contrast", np.float64, (2,)), ("gap_us", np.int64), ("about", f"S{max(len(about), 1)}")]
    record = np.zeros((), np.dtype(kinds))
    for name, value in (arrays | {"contrast": clip.contrast, "gap_us": clip.gap_us, "about": about}).items():
        record[name] = value
    # (a number of the process could be that of another machine's that writes to the same folder)
    beside = path.with_name(f"{path.name}.{secrets.token_hex(8)}.new")
    try:
        with open(beside, "wb") as file:
            write_npy(file, record)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def sound_clip(path: Path) -> Clip | None:
    """A clip of a folder that is a cache: None where there is none, or, as after a crash of the machine, a part of one,
    which is to be made again."""
    try:
        return read_clip(path)
    except (FileNotFoundError, DataError):
        return None


def remove_half_written(folder: Path) -> None:
    """Remove what killed processes were writing of clips; what is not old may be being written, by another machine."""
    for path in folder.glob("*.npy.*.new"):
        with suppress(OSError):
            if HALF_WRITTEN.fullmatch(path.name) and time.time() - path.stat().st_mtime > LEFT_S:
                path.unlink()


def read_clip(path: Path) -> Clip:
    """A clip whose arrays stay in its file.

    Raises FileNotFoundError where there is none, DataError for a file that is no clip.
    """
    try:
        record = np.load(path, mmap_mode="r", allow_pickle=False)
        about = json_of(bytes(record["about"].item()))
        gap_us, contrast = int(record["gap_us"]), tuple(float(value) for value in record["contrast"])
        clip = Clip(record["truth"], record["keys"], record["off_on"], contrast, gap_us, about)  # type: ignore[arg-type]
        _check(clip)
        return clip
    except FileNotFoundError:
        raise
    except Exception as error:  # (numpy has a dozen of its own for damaged headers)
        said = first_line(error, 150)
        raise DataError(f"{path} is no clip ({said}); remove it, and it is made again") from error


def _check(clip: Clip) -> None:
    """Raise ValueError for what no clip is."""
    truth, keys, off_on = clip.truth, clip.keys, clip.off_on
    either = np.uint8, np.float16  # (counts of bytes are of older clips)
    kinds = truth.dtype in either and off_on.dtype in either and keys.dtype == np.uint8
    if not kinds or [truth.ndim, keys.ndim, off_on.ndim] != [4, 4, 4] or 0 in (*truth.shape, *off_on.shape):
        raise ValueError(f"{truth.dtype} {list(truth.shape)}, {list(keys.shape)}, {list(off_on.shape)}")
    alike = keys.shape == (2, *truth.shape[1:]) and truth.shape[3] == 3 and len(truth) > 1 and len(off_on) == 2
    if not alike or off_on.shape[3] > truth.shape[2] or clip.gap_us <= 0 or not isinstance(clip.about, dict):
        raise ValueError(f"{list(truth.shape)}, {list(keys.shape)}, {list(off_on.shape)}, {clip.gap_us} us")
    if not is_whole(clip.about.get("footprint", 1), 1):
        raise ValueError(f"footprint {clip.about['footprint']}")
    if not (_finite(truth) and _finite(off_on)):
        raise ValueError("values that are no numbers")
    if len(clip.contrast) != 2 or not all(0 < value <= MOST_NATS for value in clip.contrast):
        raise ValueError(f"contrasts {clip.contrast}")


def _finite(values: np.ndarray) -> bool:
    """Whether all are numbers; of float16 by their bits but for the sign: each sample waits for it, 0.3 for 2 ms."""
    return values.dtype != np.float16 or int((values.view(np.uint16) << 1).max()) < 0x7C00 << 1
