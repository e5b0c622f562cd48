"""Images as a clip: a folder of them in natural order (2 before 10), or the pages of a TIFF.

8- or 16-bit PNG, TIFF, JPEG, BMP, PNM, PAM, WebP or JPEG 2000, grey or colour; floating-point TIFF and PFM; OpenEXR and
Radiance HDR.  The content decides, not the name.  Times come from `timestamps.txt` in the folder (`times.py` has the
rule for its unit; HS-ERGB and BS-ERGB call it `timestamp.txt`), for `stack.tif` from `stack_timestamps.npy` or `.txt`
beside it, or from fps: one after the other then, whatever their numbers, with a remark where numbers are missing.
Codes are sRGB, 16-bit ones too, unless a transfer is given, or `frames.json`, the manifest of the frame camera whose
folder it is, or the first PNG says one; that manifest also says of how many bits codes are that do not fill theirs,
and PNM and PAM say which code is white.
Floating point is linear light, 1.0 white as it stands; of Radiance HDR as it stands in the first, and all others are
brought to its EXPOSURE.  Transparency is ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.formats import recognise
from vid2ev.light.picture_files import PageReader, Picture, pages_of, read_picture, remarks_on_tags, white_in
from vid2ev.light.pictures import PictureReader, bits_of, white_of
from vid2ev.light.radiance import exposure_in
from vid2ev.light.recognise import PICTURE_SUFFIXES, pictures_in
from vid2ev.light.transfer import parse_transfer
from vid2ev.recording.exposures import KINDS
from vid2ev.rig.lens_file import lens_in
from vid2ev.sources.many import clips_below, sources_in
from vid2ev.sources.times import (
    OF_ERGB,
    Clock,
    digest_of,
    expected_duration_s,
    parse_fps,
    read_timestamps,
    remarks_on_unit,
    stamps_beside,
    times_beside,
)
from vid2ev.stream.frames import Colour, Frame
from vid2ev.terminal import counted
from vid2ev.untrusted import json_of, read_text

TIMESTAMPS = "timestamps.txt"
FRAMES = "frames.json"  # what `vid2ev interpolate` and `reconstruct` say of frames that they have made


class Images:
    """Frames of a folder of images, or of a TIFF with pages.

    fps       if given, image k is at k / fps; needed where there are no times
    taken_by  the camera that took them, where the folder says it (`rig/lens_file.py`)

    Raises UsageError without times, DataError if there is no image, if the times do not match, and for
    an image that cannot be read or has another size or kind of pixel than the first (the message names it).
    """

    rewindable = True
    kept = None
    dense = False

    def __init__(
        self,
        path: str | Path,
        *,
        transfer: str = "auto",
        fps: float | Fraction | None = None,
        colour: Colour = "luminance",
    ):
        self.path = Path(path)
        self.warnings: list[str] = []
        self._places = _places(self.path)
        if not self._places:
            raise DataError(f"{self.path}: no images in this folder; {_instead(self.path)}")
        self._fps = None if fps is None else parse_fps(fps)
        self._stamps: list[Fraction] = []
        self._unit: str | None = None
        if fps is None:
            self._stamps, self._unit = self._read_stamps()
            file = _times_in(self.path) if self.path.is_dir() else times_beside(self.path)
            self.warnings += remarks_on_unit(self._unit, file)
        elif self.path.is_dir():
            self.warnings += _remarks_on_gaps([file for file, _ in self._places])
        if self.path.is_dir() and (pages := pages_of(self._places[0][0])) > 1:
            name = self._places[0][0].name
            self.warnings.append(f"{name} has {pages} pages; of images in a folder the first is read")
        first, _, tagged = read_picture(*self._places[0])
        self.size = (first.shape[1], first.shape[0])
        self.frames_expected: int | None = len(self._places)
        self.duration_expected_s = expected_duration_s(self._stamps, self._fps, len(self._places))
        curve, white = (None, None) if first.dtype.kind == "f" else _said(self.path.absolute())
        self._tagged = transfer == "auto" and curve is None, tagged
        if transfer == "auto":
            self.warnings += [] if curve else remarks_on_tags(self._places[0][0], first)
            transfer = "linear" if first.dtype.kind == "f" else curve or tagged or "srgb"
        self.taken_by = lens_in(self.path, self.size) if self.path.is_dir() else None
        self._white, self._exposure = white_in(self._places[0][0]), exposure_in(self._places[0][0])
        self._reader = PictureReader(transfer, colour, white or self._white)
        self.warnings += self._reader.remarks_on(first)
        self._dtype = first.dtype

    def describe(self) -> dict[str, Any]:
        """Facts about the folder, for the manifest."""
        return {
            "kind": "images",
            "path": str(self.path),
            "size": list(self.size),
            "type": str(self._dtype),
            **self._reader.about(),
            "fps": None if self._fps is None else str(self._fps),
            "timestamps_unit": self._unit,
            "timestamps_sha256": digest_of(self._stamps),
            "frames_expected": self.frames_expected,
        }

    def frames(self, start: int = 0) -> Iterator[Frame]:
        """The frames from index `start` on; earlier images are not read."""
        return self.frames_between(None, None, start)

    def frames_between(self, since_ns: int | None, until_ns: int | None, start: int = 0) -> Iterator[Frame]:
        """The frames from `since_ns` to `until_ns`, both included, None without end; from index `start` among these."""
        clock, pages = Clock(self._fps), None if self.path.is_dir() else PageReader(self.path)
        stamps: Sequence[Fraction | None] = self._stamps or [None] * len(self._places)
        for (file, page), t_ns in clock.within(zip(self._places, stamps, strict=True), since_ns, until_ns, start):
            light = self._light(file, pages.read(page) if pages else read_picture(file))
            yield Frame(light, t_ns, number=clock.frames - 1)
        self.warnings.extend(remark for remark in clock.remarks() if remark not in self.warnings)

    def _light(self, file: Path, picture: Picture) -> np.ndarray:
        pixels, primaries, tagged = picture
        if (pixels.shape[1], pixels.shape[0]) != self.size:
            width, height = self.size
            raise DataError(
                f"{file}: {pixels.shape[1]}x{pixels.shape[0]} pixels, expected {width}x{height} like the first image;"
                " bring them to one size"
            )
        if (pixels.dtype.kind == "f") != (self._dtype.kind == "f"):
            raise DataError(f"{file}: {pixels.dtype} pixels, expected {self._dtype} like those of the first image")
        count, first = self._tagged
        if count and (tagged or "srgb") != (first or "srgb"):
            raise DataError(
                f"{file}: codes of {tagged or 'srgb'} by its tags, expected {first or 'srgb'} like those of the first"
                " image; bring them to one curve, or say with --transfer which one it is"
            )
        if self._reader.white == self._white != (white := white_in(file)):
            raise DataError(
                f"{file}: white is code {white or np.iinfo(pixels.dtype).max} by its header, expected"
                f" {self._white or 'the largest'} as in the first image; bring them to one, as in PNG"
            )
        if pixels.dtype.kind == "f" and (exposure := exposure_in(file)) != self._exposure:
            pixels = pixels * pixels.dtype.type(self._exposure / exposure)
        return self._reader.light(pixels, primaries)

    def _read_stamps(self) -> tuple[list[Fraction], str]:
        if not self.path.is_dir():
            return stamps_beside(self.path, len(self._places))
        file = _times_in(self.path)
        if not file.exists():
            raise UsageError(
                f"{self.path}: images without times; give --fps, or put a {TIMESTAMPS} with one line per image there"
            )
        stamps, unit = read_timestamps(file, [place.name for place, _ in self._places])
        if len(stamps) != len(self._places):
            found, images = counted(len(stamps), "time"), counted(len(self._places), "image")
            raise DataError(f"{file}: {found} for {images}; expected one per image; leave some out, or give --fps")
        return stamps, unit


def _times_in(folder: Path) -> Path:
    """Where the times in a folder are, or would be."""
    ours, other = folder / TIMESTAMPS, folder / OF_ERGB
    return other if other.exists() and not ours.exists() else ours


def _said(folder: Path) -> tuple[str | None, int | None]:
    """The transfer curve that pictures of a folder are said to be coded by, and which code is white where that is not
    the largest: by whoever made them, or by the manifest of the frame camera that sent them; None where nobody says so.
    """
    for path, said_of in ((folder / FRAMES, _of_frames), (folder.parent / "manifest.json", _of_camera)):
        try:
            curve, white = said_of(json_of(read_text(path)), folder.name)
            return parse_transfer(str(curve)).name, white
        except (OSError, ValueError, LookupError, TypeError):  # (there is none, or it is none of ours)
            continue
    return None, None


def _of_frames(said: Any, _: str) -> tuple[Any, None]:
    return said["transfer"], None


def _of_camera(said: Any, folder: str) -> tuple[str, int | None]:
    """Of a frame camera's codes, which are linear, or of its pictures.  Raises LookupError, TypeError, ValueError."""
    gamma, bits = (said["sensor"]["parameters"][key] for key in ("gamma", "bits"))
    curve = gamma if gamma == "srgb" else f"gamma:{gamma}"
    return {KINDS["raw"]: ("linear", white_of(bits_of(bits))), KINDS["png"]: (curve, None)}[folder]


def _instead(folder: Path) -> str:
    """What to give in place of a folder without pictures."""
    held = [Path(source) for source in sources_in(str(folder))] if folder.is_dir() else []
    held = [path for path in held if path != folder][:1]
    events = any(path.is_file() and recognise(path) for path in held)
    for kind, first in (
        ("event files" if events else "videos or folders of images", next(iter(held), None)),
        ("recordings", next((path.parent for path in sorted(folder.glob("*/manifest.json"))), None)),
        ("folders of clips", clips_below(folder)),
    ):
        if first is not None:
            return f"give one of the {kind} in it, such as {first}"
    return f"expected {', '.join(PICTURE_SUFFIXES)}"


def _remarks_on_gaps(files: Sequence[Path]) -> list[str]:
    """That some of the numbers are missing in the names of images, where these differ in nothing else."""
    found = [re.fullmatch(r"(.*?)([0-9]{1,18})([^0-9]*)", file.stem) for file in files]
    numbers = [int(each[2]) for each in found if each]
    if len(numbers) < len(files) or len({(each[1], each[3]) for each in found if each}) > 1:
        return []
    steps = [after - before for before, after in pairwise(numbers)]
    usual = min(steps, default=0)
    gaps = [k for k, step in enumerate(steps) if step != usual]
    if usual < 1 or not gaps:
        return []
    first, more = gaps[0], len(gaps) - 1
    return [
        f"{files[0].parent}: none between {files[first].name} and {files[first + 1].name}"
        + f", nor in {counted(more, 'other gap')}" * (more > 0)
        + f"; with --fps images are evenly apart, whatever their numbers; {TIMESTAMPS} says other times"
    ]


def _places(path: Path) -> list[tuple[Path, int]]:
    """Where each image is: a file, and the page in it."""
    if not path.is_dir():
        return [(path, page) for page in range(pages_of(path))]
    return [(file, 0) for file in pictures_in(path)]
