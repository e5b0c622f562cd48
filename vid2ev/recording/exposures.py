"""Pictures of a frame sensor as files.

    raw     raw/000000.png ...       codes of the ADC as they are, in PNG of 16 bits, gray or colour
    png     frames/000000.png ...    8 bits, by the curve of the sensor's `gamma`
    mp4     frames.mp4               a film of these at the sensor's rate, or the nearest that a film can have; made at
                                     the end of what is on the disk

Each of the two folders has a `timestamps.txt`, by which it can be opened as a source again:

    # start_us end_us
    0 5000
    33333 38333

when the first row of each picture opens and the last closes, in whole microseconds on the clock of the camera.

Colour in 16 bits is read as it is by OpenCV and FFmpeg; Pillow, and what reads with it, makes 8 bits of it.

An exposure's files depend on nothing but the exposure.  So an interrupted recording goes on to the same bytes: `keep`
as many as its last checkpoint knows of, and add the others again.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError, SavedError, UsageError
from vid2ev.light.picture_files import decoded
from vid2ev.light.tags import tag_of
from vid2ev.recording.disk import sync, whole_file
from vid2ev.stream.exposures import Exposure
from vid2ev.terminal import counted
from vid2ev.untrusted import first_line, read_lines

KINDS = {"raw": "raw", "png": "frames", "mp4": "frames.mp4"}  # and what they are called
TIMESTAMPS, HEADER = "timestamps.txt", "# start_us end_us\n"
LATEST_US = 1 << 60  # of any time in a file: sums of a few still fit into 64 bits
LEVEL = 1  # of Deflate: half the time of OpenCV's own 3, and 4 % more bytes where there is noise


class ExposureFiles:
    """Files of the exposures of one sensor, which grow in `folder`: `keep` what is there of an interrupted run, `add`
    each exposure, `sync` before a checkpoint, and `finish` at the end.

    kinds     some of "raw", "png" and "mp4"
    picture   the code of 8 bits [uint8] of each code (`CisSpec.picture_codes`)
    curve     the transfer curve of these (`CisSpec.curve`)
    rate_hz   of the film
    count     how many exposures there are
    Raises UsageError for another kind; what the disk cannot take is an OSError.
    """

    def __init__(self, folder: Path, kinds: Sequence[str], picture: np.ndarray, curve: str, rate_hz: float):
        unknown = [kind for kind in kinds if kind not in KINDS]
        if unknown or not kinds:
            raise UsageError(f"pictures as {list(kinds)}: expected some of {', '.join(KINDS)}")
        self.kinds, self.rate = tuple(dict.fromkeys(kinds)), Fraction(str(rate_hz))
        self.picture, self.curve = picture, curve
        kept = [kind for kind in ("raw", "png") if kind in kinds] or ["raw"]  # (a film is made of either)
        self._folders = {kind: folder / KINDS[kind] for kind in kept}
        self._unsynced: list[Path] = []
        self.count = -1

    def keep(self, count: int) -> None:
        """Begin with the first `count` exposures that are there; what there is of others is removed.

        Raises SavedError if there are fewer."""
        for folder in self._folders.values():
            folder.mkdir(parents=True, exist_ok=True)
            times = folder / TIMESTAMPS
            lines = times.read_text(encoding="utf-8").splitlines(keepends=True)[1:] if times.exists() else []
            there = [path for path in folder.glob("*.png") if path.stem.isdecimal() and int(path.stem) < count]
            if (held := min(len(lines), len(there))) < count:
                raise SavedError(
                    f"{folder} holds {counted(held, 'picture')} with times, expected {count}; start again with"
                    " --overwrite"
                )
            with whole_file(times) as file:
                file.write("".join([HEADER, *lines[:count]]).encode())
            for path in {*folder.iterdir()} - {*there, times}:
                path.unlink()
        self.count = count

    def add(self, exposure: Exposure) -> None:
        """Write the next exposure."""
        if self.count < 0:
            self.keep(0)
        for kind, folder in self._folders.items():
            path = folder / f"{self.count:06d}.png"
            write_codes(path, exposure.codes if kind == "raw" else self.picture[exposure.codes])
            with open(folder / TIMESTAMPS, "a", encoding="utf-8", newline="") as times:
                times.write(f"{exposure.start_ns // 1000} {exposure.end_ns // 1000}\n")
            self._unsynced.append(path)
        self.count += 1

    def sync(self) -> None:
        """Wait until all that was written is on the disk."""
        for path in self._unsynced:
            sync(path)
        for folder in self._folders.values() if self.count >= 0 else ():
            sync(folder / TIMESTAMPS)
            sync(folder)
        self._unsynced = []

    def finish(self, into: Path) -> list[str]:
        """Put what was asked for into the folder `into`, too, and make the film there; returns the names.

        It replaces what it finds there of an earlier attempt.  Of no exposures there is no film.
        """
        if self.count < 0:
            self.keep(0)
        self.sync()
        for kind in self._folders.keys() & set(self.kinds):
            copy_of = into / KINDS[kind]
            shutil.rmtree(copy_of, ignore_errors=True)
            shutil.copytree(self._folders[kind], copy_of, copy_function=_linked)
        if "mp4" in self.kinds and self.count:
            from vid2ev.pictures.film import write_film

            write_film(into / KINDS["mp4"], self._pictures(), self.rate, tag_of(self.curve))
        return [KINDS[kind] for kind in self.kinds if kind != "mp4" or self.count]

    def _pictures(self) -> Iterator[np.ndarray]:
        """The pictures in 8 bits, red, green, blue, from the disk."""
        kind, folder = list(self._folders.items())[-1]
        for number in range(self.count):
            codes = read_codes(folder / f"{number:06d}.png")
            picture = self.picture[codes] if kind == "raw" else codes
            yield picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)


def read_spans(path: Path) -> np.ndarray:
    """When each exposure began and ended, int64 [N, 2], us, of a file timestamps.txt.  Raises DataError."""
    lines = read_lines(path, "two times in us on every line")
    try:
        rows = [[int(word) for word in line.split()] for line in lines if line.strip() and line.lstrip()[0] != "#"]
        if bad := next((row for row in rows if len(row) != 2), None):
            raise ValueError(f"{counted(len(bad), 'number')} on a line")
        spans = np.array(rows, np.int64).reshape(-1, 2)
    except (ValueError, OverflowError) as error:
        said = first_line(error, 100)
        raise DataError(f"{path}: cannot be read ({said}); expected two times in us on every line") from error
    if not len(spans) or np.abs(spans.astype(np.float64)).max() >= LATEST_US or np.any(spans[:, 1] < spans[:, 0]):
        found = counted(len(spans), "exposure")
        raise DataError(f"{path}: {found}, or one that ends before it begins; make the recording again")
    return spans


def write_codes(path: Path, codes: np.ndarray) -> None:
    """A PNG of codes, uint8 or uint16, [H, W] or red, green, blue [H, W, 3]; the same codes give the same bytes."""
    import cv2

    pixels = codes if codes.ndim == 2 else np.ascontiguousarray(codes[..., ::-1])
    path.write_bytes(cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, LEVEL])[1].tobytes())


def read_codes(path: Path) -> np.ndarray:
    """The codes of a PNG that `write_codes` wrote.  Raises DataError."""
    import cv2

    found = decoded(path, cv2.IMREAD_UNCHANGED)
    if not found or found[0].dtype not in (np.uint8, np.uint16) or found[0].shape[2:] not in ((), (3,)):
        raise DataError(f"{path}: not a picture that can be read, expected one written here; start again")
    return found[0] if found[0].ndim == 2 else found[0][..., ::-1]


def _linked(source: str, target: str) -> None:
    """The same file under a second name; a copy where there are no such names, and of what grows: a recording that is
    finished shares nothing with what may still be written to."""
    try:
        if Path(source).name != TIMESTAMPS:
            os.link(source, target)
            return
    except OSError:
        pass
    shutil.copyfile(source, target)
