"""Curves as CSV, a file for training and one for validation, with a row per step that is logged.

Lightning's own writer of CSV forgets what is there when training goes on; this one keeps the rows up to the step from
which it goes on, and takes up columns that come later.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightning.pytorch.loggers.logger import Logger
from lightning.pytorch.utilities import rank_zero_only

from vid2ev.errors import DataError
from vid2ev.recording.disk import THEN_RESUME, whole_file, writing

FILES = {"train": "training.csv", "validation": "validation.csv"}


class Curves(Logger):
    """Writes what is logged as "train/NAME" and "validation/NAME" to the folder; keeps rows up to `step`."""

    def __init__(self, folder: Path, step: int = 0):
        super().__init__()
        self.folder = folder
        self._columns: dict[str, list[str]] = {}
        if rank_zero_only.rank == 0:  # type: ignore[attr-defined]
            for name in FILES.values():
                self._write(name, [row for row in read_curve(folder / name) if float(row["step"]) <= step])

    @property
    def name(self) -> str:
        """Lightning asks for one."""
        return ""

    @property
    def version(self) -> str:
        """As `name`."""
        return ""

    def log_hyperparams(self, *_: Any, **__: Any) -> None:
        """They are in the run's configuration."""

    @rank_zero_only
    def log_metrics(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        """Add a row to each file that the metrics are of."""
        for group, name in FILES.items():
            mine = {key.removeprefix(f"{group}/"): value for key, value in metrics.items() if key.startswith(group)}
            if mine:
                self._add(name, {"step": f"{step}"} | {key: f"{value:.6g}" for key, value in mine.items()})

    def _add(self, name: str, row: dict[str, str]) -> None:
        again = name == FILES["validation"]  # (one that is measured again, as a run that is done goes on, counts once)
        if again or not set(row) <= set(self._columns.get(name, [])):
            before = read_curve(self.folder / name)
            self._write(name, [*(each for each in before if not again or each["step"] != row["step"]), row])
            return
        path = self.folder / name
        with writing(path, THEN_RESUME), open(path, "a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, self._columns[name], lineterminator="\n").writerow(row)

    def _write(self, name: str, rows: list[dict[str, str]]) -> None:
        columns = list(dict.fromkeys(key for row in rows for key in row))
        if not columns:
            (self.folder / name).unlink(missing_ok=True)
            return
        with writing(self.folder / name, THEN_RESUME), whole_file(self.folder / name) as raw:
            lines = [columns, *([row.get(key, "") for key in columns] for row in rows)]
            raw.write("".join(",".join(line) + "\n" for line in lines).encode())
        self._columns[name] = columns


def check_curves(folder: Path) -> None:
    """Raise DataError where those of a run cannot be gone on with: at once, not when its clips are made again."""
    for name in FILES.values():
        read_curve(folder / name)


def read_curve(path: Path) -> list[dict[str, str]]:
    """The rows of a curve that are whole; none if there is no file.

    A crash may leave less than was written, or zeros in its place: rows from there on are not whole, and are dropped.
    Raises DataError for what no crash leaves: somebody may want to put it right.
    """
    content = path.read_bytes().partition(b"\0")[0] if path.exists() else b""
    try:
        rows = list(csv.DictReader(content[: content.rfind(b"\n") + 1].decode().splitlines()))
    except (UnicodeDecodeError, csv.Error) as error:
        raise _damaged(path, "it is not text in UTF-8, or no CSV") from error
    for line, row in enumerate(rows, 2):
        if None in row or None in row.values() or not _is_number(row.get("step", "")):
            raise _damaged(path, f"line {line} has no step, or not a value for each column")
    return rows


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _damaged(path: Path, why: str) -> DataError:
    return DataError(
        f"{path} cannot be read as a curve: {why}; put it right, or remove it: training goes on from its checkpoint,"
        " and the curve from there"
    )
