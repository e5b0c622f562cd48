"""Rows as a table on disk: rows.csv, a line for each frame and method, in columns of the names of `Row`."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, get_type_hints

from interp.evaluate.row import Row
from vid2ev.errors import DataError
from vid2ev.recording.disk import whole_file

ROWS = "rows.csv"
TYPES: dict[str, type] = get_type_hints(Row)
COLUMNS = tuple(each.name for each in fields(Row))
NUMBERS = tuple(name for name in COLUMNS if TYPES[name] is float)


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write a table, whole or not at all; numbers as short as reads back to the same, `nan` where there is none."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(map(astuple, rows))
    with whole_file(path) as file:
        file.write(text.getvalue().encode())


def read_rows(path: Path) -> list[Row]:
    """The rows of a table.  Raises DataError for a file that is none."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            return [Row(**{name: _value(name, line[name]) for name in COLUMNS}) for line in csv.DictReader(file)]
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise DataError(f"{path} is no table of an evaluation ({error}); evaluate again") from error


def _value(name: str, text: str) -> Any:
    return TYPES[name](text)
