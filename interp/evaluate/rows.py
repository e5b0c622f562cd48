"""Rows as a table on disk: rows.csv, a line for each frame and method, in columns of the names of `Row`."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import astuple, fields
from pathlib import Path

from interp.evaluate.row import Row
from vid2ev.recording.disk import whole_file

ROWS = "rows.csv"
COLUMNS = tuple(each.name for each in fields(Row))


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write a table, whole or not at all; numbers as short as reads back to the same, `nan` where there is none."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(map(astuple, rows))
    with whole_file(path) as file:
        file.write(text.getvalue().encode())
