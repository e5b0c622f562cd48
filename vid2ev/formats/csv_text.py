"""Comma-separated text.

    t,x,y,p            a line that names the columns; with label, if asked for
    81000,4,17,1       time [us] on the clock of the source, column, row, 1 brighter (ON) or 0 darker (OFF)

Columns are read in any order and by other names in use (`NAMES`; polarity may be -1, too), and so are the files of
Metavision, which name no columns, "x,y,p,t", but have "%geometry:WIDTH,HEIGHT" before them, and those of faery, which
write the size into the names: "t,x@1280,y@720,on".  Numbers whose columns nobody names are refused: t,x,y,p and x,y,p,t
are both in use.
"""

from __future__ import annotations

import re
from pathlib import Path

from vid2ev.errors import DataError
from vid2ev.formats.event_file import HEAD, Format, Recording
from vid2ev.formats.sequential import reading
from vid2ev.formats.text import FIELDS, MARK, TextEvents, write_lines

NAMES = {"t": "ts|time|timestamp|t_us|time_us|timestamp_us", "x": "", "y": "", "p": "on|pol|polarity", "label": ""}
GEOMETRY = re.compile(rb"%geometry:(\d{1,5}),(\d{1,5})\r?\n")
METAVISION = ["x", "y", "p", "t"]
NUMBER = rb"[ \t]*[-+]?[\d.][\deE.+-]{0,40}[ \t]*"
UNNAMED = re.compile(rb"(?:[#%%][^\n]{0,1000}\n)*(%b(?:,%b){3,4})(?:\r?\n|$)" % (NUMBER, NUMBER))  # of events, it seems


class CsvEvents(TextEvents):
    """The events of comma-separated text.  Raises DataError for numbers whose columns are not named."""

    def __init__(self, path: Path):
        with reading(path) as file:
            head = file.read(HEAD)
        found = _columns(head)
        if found is None:
            raise DataError(
                f"{path} has no line that names its columns; put one before the others, such as t,x,y,p or x,y,p,t, in"
                " the order that they have, with t in whole microseconds"
            )
        fields, skip, size = found
        super().__init__(path, fields, 0, skip)
        self.size = size


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it."""
    head = ",".join(FIELDS[: 5 if recording.labelled else 4])
    write_lines(path, recording, head, ",", 1, recording.labelled)


def _columns(head: bytes) -> tuple[list[str], int, tuple[int, int] | None] | None:
    """The columns, the lines before the first event, and the size if it is there; None if it is no such text."""
    head = head.removeprefix(MARK)
    if (found := GEOMETRY.match(head)) and re.match(rb"(%.*\n)*(\d+,\d+,-?\d,-?\d+\r?\n|$)", head[found.end() :]):
        return METAVISION, 1, (int(found[1]), int(found[2]))
    line = head.partition(b"\n")[0]
    if not re.fullmatch(rb"[\x20-\x7e]{7,1000}\r?", line):
        return None
    names = [name.strip(" #\"'\r").lower().partition("@") for name in line.decode().split(",")]
    fields = [next((ours for ours in NAMES if name in (ours, *NAMES[ours].split("|"))), "") for name, _, _ in names]
    if any(fields.count(name) != 1 for name in "txyp") or fields.count("label") > 1:
        return None
    width, height = (names[fields.index(name)][2] for name in "xy")
    size = (int(width), int(height)) if re.fullmatch(r"[1-9]\d{0,4} [1-9]\d{0,4}", f"{width} {height}") else None
    return fields, 1, size


FORMAT = Format(
    "csv",
    "comma-separated text: t,x,y,p",
    ".csv",
    recognises=lambda head, path: _columns(head) is not None or UNNAMED.match(head.removeprefix(MARK)) is not None,
    open=CsvEvents,
    write=write_events,
    largest=(1 << 16, 1 << 16),
    keeps=frozenset({"labels"}),
)
