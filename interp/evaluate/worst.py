"""The worst frames of each method, as pictures: what was made, the truth, and the key frames around it.

    worst/METHOD/SEQUENCE_GROUP_POSITION_{made,truth,before,after}.png

One frame of a group at most, so that they show different things; the one with the worst window of 99x99 pixels.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from interp.evaluate.group import Group
from interp.evaluate.row import Row
from vid2ev.recording.disk import THEN_RESUME, writing
from vid2ev.recording.exposures import write_codes

FOLDER = "worst"
COUNT = 8  # of each method
PICTURES = ("made", "truth", "before", "after")


def worst_of(rows: Iterable[Row], count: int = COUNT) -> list[Row]:
    """The rows with the worst windows, the worst first, one of a group at most."""
    of_groups: dict[tuple[str, int], Row] = {}
    for row in rows:
        place = row.sequence, row.group
        if math.isnan(row.patch_psnr):
            continue
        if place not in of_groups or badness(row) < badness(of_groups[place]):
            of_groups[place] = row
    return heapq.nsmallest(count, of_groups.values(), key=badness)


def badness(row: Row) -> tuple[float, str, int, int]:
    """By which rows are sorted, the worst first."""
    return row.patch_psnr, row.sequence, row.group, row.position


def names_of(row: Row) -> dict[str, str]:
    """The pictures of a row, within the folder of the evaluation."""
    place = f"{FOLDER}/{row.method}/{row.sequence}_{row.group:05d}_{row.position:03d}"
    return {picture: f"{place}_{picture}.png" for picture in PICTURES}


class WorstPictures:
    """Those of one method, kept up to date while rows come; `rows` are those of before."""

    def __init__(self, folder: Path, rows: Iterable[Row]):
        self._folder = folder
        self._worst = worst_of(rows)

    def see(self, rows: Sequence[Row], group: Group, made: Sequence[np.ndarray | None]) -> None:
        """The rows of a group, before they are kept: a picture is there before anything says so."""
        before = self._worst
        self._worst = worst_of([*before, *rows])
        for row in self._worst:
            if row in rows:
                k = group.positions.index(row.position)
                picture = made[k]
                assert picture is not None
                self._write(row, (picture, group.truth[k], *group.keys))
        for row in before:
            if row not in self._worst:
                remove(self._folder, row)

    def _write(self, row: Row, pictures: Sequence[np.ndarray]) -> None:
        for name, picture in zip(names_of(row).values(), pictures, strict=True):
            path = self._folder / name
            with writing(path, THEN_RESUME):
                path.parent.mkdir(parents=True, exist_ok=True)
                write_codes(path, picture)


def lost(folder: Path, rows: Iterable[Row]) -> list[Row]:
    """The worst of a method's rows of which a picture is not there any more."""
    return [row for row in worst_of(rows) if not all((folder / name).exists() for name in names_of(row).values())]


def remove(folder: Path, row: Row) -> None:
    """Remove the pictures of a row."""
    for name in names_of(row).values():
        (folder / name).unlink(missing_ok=True)


def prune(folder: Path, method: str, rows: Iterable[Row]) -> None:
    """Remove the pictures of a method that are not of its worst rows, as where each sequence kept its own."""
    names = {name for row in worst_of(row for row in rows if row.method == method) for name in names_of(row).values()}
    for path in (folder / FOLDER / method).glob("*.png"):
        if path.relative_to(folder).as_posix() not in names:
            path.unlink()
