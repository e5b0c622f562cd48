"""Methods by moments on a sheet: a line for each method and the truth, a column for each instant, each with a patch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from interp.evaluate.figures.layout import GAP_PX, below, beside, check_pictures, cut, framed, in_proportion, resized
from interp.evaluate.figures.lettering import GROUND, STRIP_PX, letters, strip, write
from interp.evaluate.figures.png import write_png
from vid2ev.errors import UsageError
from vid2ev.terminal import counted

HEIGHT_PX = 160  # of pictures on the sheet
MARGIN_PX = 8


def panel(
    lines: Mapping[str, Sequence[np.ndarray]],
    moments: Sequence[str],
    patch: tuple[int, int, int, int],
    height: int = HEIGHT_PX,
) -> np.ndarray:
    """The sheet, uint8 [rows, columns, 3].

    lines     name of each line, in order, and its pictures, uint8 [H, W, 3], one for each moment
    moments   names of the columns
    patch     (left, top, width, height) [px]: framed in each picture, and larger beside it
    height    of the pictures on the sheet [px]
    Raises UsageError for pictures that do not fit together, and for a patch outside of them.
    """
    _check(lines, moments)
    names = _named(list(lines), height)
    columns = []
    for number, moment in enumerate(moments):
        cells = [_cell(pictures[number], patch, height) for pictures in lines.values()]
        columns.append(below([strip(moment, cells[0].shape[1]), *cells]))
    return beside([names, *columns])


def write_moments(
    path: Path, lines: Mapping[str, Sequence[np.ndarray]], moments: Sequence[str], patch: tuple[int, int, int, int]
) -> None:
    """Write a sheet as a PNG file; raises DataError, and UsageError as `panel`."""
    write_png(path, panel(lines, moments, patch))


def _check(lines: Mapping[str, Sequence[np.ndarray]], moments: Sequence[str]) -> None:
    if not lines or not moments:
        asked = f"{counted(len(lines), 'line')} by {counted(len(moments), 'moment')}"
        raise UsageError(f"a sheet of {asked}: expected at least one of each")
    for name, pictures in lines.items():
        if len(pictures) != len(moments):
            found = counted(len(pictures), "picture")
            raise UsageError(f"{name}: {found}; expected {len(moments)}, one for each moment")
    check_pictures(**{f"{name}, {k}": one for name, pictures in lines.items() for k, one in enumerate(pictures)})


def _cell(picture: np.ndarray, patch: tuple[int, int, int, int], height: int) -> np.ndarray:
    """The picture with the patch framed, and the patch beside it, both so high."""
    high, wide = picture.shape[:2]
    zoomed = resized(cut(picture, patch), in_proportion(patch[2], patch[3], height), height)
    return beside([framed(picture, patch, in_proportion(wide, high, height), height), zoomed])


def _named(names: Sequence[str], height: int) -> np.ndarray:
    """The names of the lines, below each other at half the height of each."""
    width = max(letters(name).shape[1] for name in names) + 2 * MARGIN_PX
    made = np.full((STRIP_PX + len(names) * (height + GAP_PX), width, 3), GROUND, np.uint8)
    for number, name in enumerate(names):
        top = STRIP_PX + GAP_PX + number * (height + GAP_PX) + (height - STRIP_PX) // 2
        write(made, name, MARGIN_PX, max(0, top))
    return made
