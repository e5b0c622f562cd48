"""Calibration files as trees of values, and every way to ask them for one.

A `Node` is a place in a file.  What it is asked for it gives, or says in one sentence what is missing there, or what
stands there instead.  Numbers may be written as texts.

    node["cam0"]["intrinsics"].numbers(4)       DataError: calib.yaml: cam0 has no intrinsics (...)

JSON and YAML are read.  All that stands in YAML is text until a number is asked for, so that a camera may be called on
or 007; tags such as OpenCV's `!!opencv-matrix` say nothing that is needed.

Sources: YAML 1.1; OpenCV 4.x, "XML/YAML/JSON file storages" (`%YAML:1.0`, `!!opencv-matrix`).
"""

from __future__ import annotations

import json
import math
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from vid2ev.errors import DataError
from vid2ev.rig.camera import nearest_rotation
from vid2ev.rig.pose import Pose
from vid2ev.rig.rig_file import read_text
from vid2ev.untrusted import check_depth

LARGEST = 1e12  # of a number that can be meant
MOST_ENTRIES = 1000  # of a list of numbers: YAML can say one list a thousand times


@dataclass(frozen=True)
class Node:
    """A value in a file, and where it stands there, such as "cam0.intrinsics"; "" is the file itself."""

    file: Path
    place: str
    value: Any

    def __contains__(self, key: str) -> bool:
        return isinstance(self.value, dict) and key in self.value

    def __getitem__(self, key: str) -> Node:
        """What stands under a key.  Raises DataError if nothing does."""
        if key not in self:
            raise DataError(f"{self.file}: {self.place or 'the file'} has no {key}; complete or replace the file")
        return Node(self.file, f"{self.place}.{key}".lstrip("."), self.value[key])

    def first_of(self, *keys: str) -> Node:
        """What stands under the first of the keys that is there."""
        return self[next((key for key in keys if key in self), keys[0])]

    def items(self) -> Iterator[tuple[str, Node]]:
        """The keys that are texts, and what stands under each.  Raises DataError if it has no keys."""
        if not isinstance(self.value, dict):
            raise self.wrong("names with values")
        for key in self.value:
            if isinstance(key, str):
                yield key, self[key]

    def entries(self) -> list[Node]:
        """The entries of a list."""
        if not isinstance(self.value, list):
            raise self.wrong("a list")
        return [Node(self.file, f"{self.place}[{index}]", value) for index, value in enumerate(self.value)]

    def text(self) -> str:
        """A text in one line."""
        if not isinstance(self.value, str):
            raise self.wrong("a text")
        return " ".join(self.value.split())

    def number(self) -> float:
        """A number that is not too large to be meant."""
        try:
            number = float(self.value) if isinstance(self.value, int | float | str) else math.nan
        except (ValueError, OverflowError):
            number = math.nan
        if isinstance(self.value, bool) or not abs(number) <= LARGEST:
            raise self.wrong("a number")
        return number

    def numbers(self, *counts: int) -> list[float]:
        """The numbers of a list, nested or not, or of one of OpenCV's matrices: as many as one of the counts."""
        found = [entry.number() for entry in self._flat()]
        if counts and len(found) not in counts:
            raise self.wrong(f"{' or '.join(map(str, counts))} numbers")
        return found

    def size(self) -> tuple[int, int]:
        """Width and height."""
        width, height = (entry.side() for entry in self._flat(2))
        return width, height

    def side(self) -> int:
        """A count of pixels."""
        number = self.number()
        if number != int(number) or not 1 <= number <= 65535:
            raise self.wrong("a whole number of pixels, 1 to 65535")
        return int(number)

    def matrix(self, rows: int, columns: int) -> np.ndarray:
        """A matrix [rows, columns]: rows within a list, or all numbers in one."""
        return np.array(self.numbers(rows * columns)).reshape(rows, columns)

    def rotation(self) -> np.ndarray:
        """A rotation matrix [3, 3]; few digits are made exact."""
        return self._turn(self.matrix(3, 3))

    def rigid(self) -> Pose:
        """A rigid motion [4, 4] or [3, 4], in m."""
        rows = 4 if len(self.numbers(12, 16)) == 16 else 3
        matrix = self.matrix(rows, 4)
        if rows == 4 and not np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-6):
            raise self.wrong("a rigid motion with a last row of 0, 0, 0, 1")
        return Pose(self._turn(matrix[:3, :3]), matrix[:3, 3].copy())

    def wrong(self, expected: str) -> DataError:
        """What is to be said where something else stands than was expected."""
        found = reprlib.repr(self.value).replace("\n", " ")
        return DataError(f"{self.file}: {self.place or 'the file'} is {found}, not {expected}; correct that value")

    def _turn(self, matrix: np.ndarray) -> np.ndarray:
        try:
            return nearest_rotation(matrix)
        except ValueError as error:
            raise self.wrong("a rotation matrix") from error

    def _flat(self, count: int | None = None) -> list[Node]:
        """The entries of a list and of the lists in it, or those of one of OpenCV's matrices."""
        if "data" in self:
            return self["data"]._flat(count)
        outer = self.entries()
        if sum(len(entry.value) if _is_list(entry) else 1 for entry in outer) > MOST_ENTRIES:
            raise self.wrong(f"at most {MOST_ENTRIES} numbers")
        entries = [one for entry in outer for one in (entry.entries() if _is_list(entry) else [entry])]
        if count is not None and len(entries) != count:
            raise self.wrong(f"{count} numbers")
        return entries


def read_tree(path: Path) -> Node:
    """A YAML or JSON file.  Raises DataError for what is neither, UsageError if there is none."""
    text = read_text(path)
    first, _, rest = text.partition("\n")
    try:
        if text.lstrip().startswith("{") and not first.startswith("%"):
            return Node(path, "", json.loads(text))
        check_depth(path, text)
        # (the first line of OpenCV 4 is no directive of YAML, for want of a space; lines are counted all the same)
        return Node(path, "", yaml.load(f"\n{rest}" if first.startswith("%YAML") else text, yaml.BaseLoader))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        why = "nested too deeply" if isinstance(error, RecursionError) else " ".join(str(error).split())[:200]
        raise DataError(f"{path}: not valid YAML or JSON ({why}); correct that line") from error


def _is_list(node: Node) -> bool:
    return isinstance(node.value, list)
