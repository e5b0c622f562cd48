"""The table of an evaluation, read back."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import get_type_hints

from interp.evaluate.row import Row

TYPES: dict[str, type] = get_type_hints(Row)


def read_rows(path: Path) -> list[Row]:
    """The rows of a table."""
    with open(path, newline="", encoding="utf-8") as file:
        return [Row(**{name: of(line[name]) for name, of in TYPES.items()}) for line in csv.DictReader(file)]
