"""What is done of the frames that are made: stretch after stretch, a line of JSON each.

t_us     when its frames are
memory   whether what a method has to remember was kept with it
and what else is wanted of it
"""

from __future__ import annotations

import json
import operator
import os
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vid2ev.recording.disk import whole_file
from vid2ev.recording.exposures import LATEST_US
from vid2ev.recording.manifest import as_stated
from vid2ev.untrusted import json_of

Line = dict[str, Any]


def read_lines(path: Path, wanted: Mapping[str, type]) -> list[Line]:
    """All lines, of which a last one that was cut off in writing is taken away; none where there is no file.

    wanted   what a line has beside its times: int, bool or str
    Raises DataError for what is none of these.
    """
    lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else []
    with as_stated(path):
        found = [_line_of(line, wanted) for line in lines]
    with whole_file(path) as file:
        file.write(b"".join(line + b"\n" for line in lines))
    return found


def append_line(path: Path, line: Mapping[str, Any]) -> None:
    """Write a line, and wait until it is on the disk."""
    with open(path, "a", encoding="utf-8") as lines:
        lines.write(json.dumps(line) + "\n")
        lines.flush()
        os.fsync(lines.fileno())


def _line_of(text: bytes, wanted: Mapping[str, type]) -> Line:
    """Raises KeyError, TypeError, ValueError for what is none."""
    line = json_of(text)
    numbers = [*map(operator.index, line["t_us"])]
    for key, kind in wanted.items():
        if type(line[key]) is not kind:
            raise TypeError(f"{key} = {reprlib.repr(line[key])}")
        numbers += [line[key]] if kind is int else []
    if any(abs(number) >= LATEST_US for number in numbers):
        raise ValueError("times beyond all clocks")
    return line  # type: ignore[no-any-return]
