"""A folder of images: 8- or 16-bit PNG, TIFF, JPEG, BMP, PGM or PPM, grey or colour, in natural order (2 before 10).

Times come from `timestamps.txt` in the folder (`times.py` has the rule for its unit), or from fps.  Codes are sRGB
unless a transfer is given, 16-bit ones too; floating-point TIFF is linear light.  Transparency is ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.sources.pictures import TYPES, PictureReader
from vid2ev.sources.times import Clock, parse_fps, read_timestamps
from vid2ev.stream.frames import Frame

SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm")
TIMESTAMPS = "timestamps.txt"


class ImageFolder:
    """Frames of a folder, one per image.

    fps   if given, image k is at k / fps; needed where there is no timestamps.txt

    Raises UsageError without times, DataError if there is no image, if timestamps.txt does not match, and for
    an image that cannot be read or has another size than the first (the message names it).
    """

    def __init__(self, path: str | Path, *, transfer: str = "auto", fps: float | Fraction | None = None):
        self.path = Path(path)
        self.warnings: list[str] = []
        found = [file for file in self.path.iterdir() if file.suffix.lower() in SUFFIXES]
        self._files = sorted(found, key=lambda file: natural(file.name))
        if not self._files:
            raise DataError(f"{self.path}: no images in this folder; expected {', '.join(SUFFIXES)}")
        self._fps = None if fps is None else parse_fps(fps)
        self._stamps: list[Fraction] = []
        self._unit: str | None = None
        if fps is None:
            self._stamps, self._unit = self._read_stamps()
        first = self._read(self._files[0])
        self.size = (first.shape[1], first.shape[0])
        self.frames_expected: int | None = len(self._files)
        if transfer == "auto":
            transfer = "linear" if first.dtype.kind == "f" else "srgb"
        self._reader = PictureReader(transfer)
        self._dtype = str(first.dtype)

    def describe(self) -> dict[str, Any]:
        """Facts about the folder, for the manifest."""
        return {
            "kind": "images",
            "path": str(self.path),
            "size": list(self.size),
            "type": self._dtype,
            "transfer": self._reader.transfer,
            "fps": None if self._fps is None else str(self._fps),
            "timestamps_unit": self._unit,
            "frames_expected": self.frames_expected,
        }

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on; earlier images are not read."""
        clock, index = Clock(self._fps), 0
        stamps: Sequence[Fraction | None] = self._stamps or [None] * len(self._files)
        for file, stamp in zip(self._files, stamps, strict=True):
            t_ns = clock.next(stamp)
            if t_ns is None:
                continue
            if index >= start:
                yield Frame(self._light(file), t_ns)
            index += 1
        self.warnings.extend(remark for remark in clock.remarks() if remark not in self.warnings)

    def _light(self, file: Path) -> np.ndarray:
        picture = self._read(file)
        if (picture.shape[1], picture.shape[0]) != self.size:
            width, height = self.size
            raise DataError(
                f"{file}: {picture.shape[1]}x{picture.shape[0]} pixels, expected {width}x{height} like the first image;"
                " bring them to one size"
            )
        return self._reader.light(picture)

    def _read_stamps(self) -> tuple[list[Fraction], str]:
        file = self.path / TIMESTAMPS
        if not file.exists():
            raise UsageError(
                f"{self.path}: images without times; give --fps, or a {TIMESTAMPS} with one line per image"
            )
        stamps, unit = read_timestamps(file)
        if len(stamps) != len(self._files):
            raise DataError(f"{file}: {len(stamps)} times for {len(self._files)} images; expected one per image")
        return stamps, unit

    @staticmethod
    def _read(file: Path) -> np.ndarray:
        """Image as [H, W] or [H, W, 3] red, green, blue."""
        import cv2

        try:
            picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            picture = None
        if picture is None:
            raise DataError(f"{file}: not an image that can be read; remove it or write it anew")
        if picture.dtype not in (np.uint8, np.uint16) and picture.dtype.kind != "f":
            raise DataError(f"{file}: pixels of type {picture.dtype}, expected {TYPES}")
        return picture if picture.ndim == 2 else picture[..., 2::-1]


def natural(name: str) -> list[tuple[int, str]]:
    """Sort key by which `frame2` comes before `frame10`."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts] + [(-2, name)]
