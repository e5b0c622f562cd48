"""Slices as files: `write_frames` makes one of these of a recording, as a whole or not at all.

    npz   frames      [N, ...] the arrays of the slices, as the representation says
          start_us    int64 [N]; slice k is (start_us[k], stop_us[k]]
          stop_us     int64 [N]
          events      int64 [N] how many there are in each
          slices, representation      the requests, in text
    png   a folder with 000000.png ... in 8 bits, as the representation looks, and slices.csv
    mp4   a film with a picture for each slice, one after the other at `fps` whatever they last, and NAME.csv beside it

A .csv has a row for each slice: number, start_us, stop_us, events.

All three are made in memory that does not grow with the recording.  The same recording gives the same bytes.
"""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TextIO

import numpy as np

from vid2ev.errors import UsageError
from vid2ev.formats.event_file import Recording
from vid2ev.recording.disk import whole
from vid2ev.views.representation import Slice, represent, slices_of
from vid2ev.views.requests import parse_representation, parse_slicing

KINDS = {"npz": "frames.npz", "png": "frames", "mp4": "frames.mp4"}  # and what convert calls them
FPS = 30
SLICES = "slices.csv"
LEVEL = 4  # of Deflate

Report = Callable[[Slice], object]
Pictures = Iterator[tuple[Slice, np.ndarray]]  # R'G'B' uint8 [height, width, 3]


def write_frames(
    path: Path,
    recording: Recording,
    representation: str = "counts",
    slicing: str = "duration:10ms",
    *,
    kind: str = "npz",
    fps: Fraction | int = FPS,
    report: Report | None = None,
) -> int:
    """Write the slices of a recording to a file (npz, mp4) or a folder (png); returns how many there are.

    representation, slicing   as `requests` parses them
    fps                       of a film
    report                    called with every slice that is done
    What is at `path` is replaced when the new is whole.  Raises UsageError for requests that cannot be meant, OSError
    where the disk cannot take it, and what reading the recording raises.
    """
    if kind not in KINDS:
        raise UsageError(f"frames as '{kind}': expected one of {', '.join(KINDS)}")
    cut, view = parse_slicing(slicing), parse_representation(representation)(recording.size)
    arrays = _reported(represent(recording, cut, view), report)
    with whole(path) as beside:
        if kind == "npz":
            table = list(slices_of(recording, cut))
            texts = {"slices": str(cut), "representation": representation}
            _write_npz(beside, table, (array for _, array in arrays), view.shape, view.dtype, texts)
            return len(table)
        pictures = ((part, view.picture(array)) for part, array in arrays)
        if kind == "png":
            return write_pictures(beside, pictures)
        with whole(path.with_suffix(".csv")) as listing, _table(listing) as rows:
            return write_film(beside, _listed(rows, pictures), fps)


def _reported(arrays: Iterator[tuple[Slice, np.ndarray]], report: Report | None) -> Iterator[tuple[Slice, np.ndarray]]:
    """The same, and each slice is reported once what is made of it is done."""
    for part, array in arrays:
        yield part, array
        if report is not None:
            report(part)


def write_pictures(folder: Path, pictures: Pictures) -> int:
    """A folder of pictures with the table of their slices; returns how many there are."""
    folder.mkdir()
    number = 0
    with _table(folder / SLICES) as table:
        for number, (_, picture) in enumerate(_listed(table, pictures), 1):
            write_picture(folder / f"{number - 1:06d}.png", picture)
    return number


def _table(path: Path) -> TextIO:
    return open(path, "w", newline="", encoding="utf-8")


def _listed(table: TextIO, pictures: Pictures) -> Pictures:
    """The same, and their slices go into a table."""
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(["number", "start_us", "stop_us", "events"])
    for number, (part, picture) in enumerate(pictures):
        yield part, picture
        rows.writerow([number, part.start_us, part.stop_us, part.events])


def write_picture(path: Path, picture: np.ndarray) -> None:
    """A PNG of R'G'B' uint8 [height, width, 3]; gray where it has no colour."""
    import cv2

    gray = bool((picture[..., :1] == picture[..., 1:]).all())
    coded = cv2.imencode(".png", picture[..., 0] if gray else np.ascontiguousarray(picture[..., ::-1]))[1]
    path.write_bytes(coded.tobytes())


def write_film(path: Path, pictures: Pictures, fps: Fraction | int) -> int:
    """A film of the pictures of slices; returns how many there are."""
    from vid2ev.pictures import film

    return film.write_film(path, (picture for _, picture in pictures), fps)


def _write_npz(
    path: Path,
    table: list[Slice],
    arrays: Iterator[np.ndarray],
    shape: tuple[int, ...],
    dtype: np.dtype,
    texts: dict[str, str],
) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
        _write_member(archive, "frames", (len(table), *shape), dtype, arrays)
        for name in ("start_us", "stop_us", "events"):
            column = np.array([getattr(part, name) for part in table], np.int64)
            _write_member(archive, name, column.shape, column.dtype, iter([column]))
        for name, text in texts.items():
            _write_member(archive, name, (), np.array(text).dtype, iter([np.array(text)]))


def _write_member(
    archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], dtype: np.dtype, parts: Iterator[np.ndarray]
) -> None:
    """An array, part by part, as a member of an npz file."""
    header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_1_0(member, header)  # type: ignore[arg-type]
        for part in parts:
            member.write(np.ascontiguousarray(part).tobytes())
