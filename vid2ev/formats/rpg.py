"""Text as the Robotics and Perception Group of Zurich writes it.

    240 180                  width and height
    0.081000 4 17 1          time [s] on the clock of the source, column, row, 1 brighter (ON) or 0 darker (OFF)

Six decimals are whole microseconds, and none is lost.  Files without the first line are read, as are times with any
number of decimals, which are rounded to microseconds; where no line has any, they are microseconds already.
Sources: https://github.com/uzh-rpg/rpg_e2vid; https://rpg.ifi.uzh.ch/davis_data.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from vid2ev.errors import DataError
from vid2ev.formats.columns import check_order
from vid2ev.formats.event_file import HEAD, Format, Recording
from vid2ev.formats.sequential import reading
from vid2ev.formats.text import FIELDS, TextEvents, write_lines
from vid2ev.stream.events import Events

COMMENTS = re.compile(rb"(?:\xef\xbb\xbf)?(?:[#%][\t\x20-\x7e]{0,1000}\r?\n)*")
SIZE = re.compile(rb"[ \t]*([1-9]\d{0,4})[ \t]+([1-9]\d{0,4})[ \t]*(?:\r?\n|$)")
EVENT = re.compile(rb"[ \t]*(?:[-+]?[\d.][\deE.+-]{0,40}[ \t]+){3}[-+]?[01](?:\.0*)?(?:[eE][-+]?0+)?[ \t]*(?:\r?\n|$)")
DECIMALS, SECOND = 6, 10**6


class RpgEvents(TextEvents):
    """The events of such a text.  Raises DataError for a file that does not begin as one does."""

    def __init__(self, path: Path):
        with reading(path) as file:
            head = file.read(HEAD)
        if not _recognises(head, path):
            raise DataError(f"{path} does not begin with 'width height' or 't x y p'; expected such a text")
        comments = COMMENTS.match(head)
        begin = comments.end() if comments else 0
        size = SIZE.match(head, begin)
        seconds = bool(re.search(rb"^[ \t]*[-+]?\d*(?:\.|\d[eE])", head[size.end() if size else begin :], re.MULTILINE))
        skip = head.count(b"\n", 0, begin) + 1 if size else 0
        super().__init__(path, list(FIELDS[:4]), DECIMALS if seconds else 0, skip)
        self.size = (int(size[1]), int(size[2])) if size else None
        if not seconds and EVENT.match(head, size.end() if size else begin):
            self.warnings.append("times have no decimals; they are taken for microseconds")

    def _decoded(self) -> Iterator[Events]:
        for number, events in enumerate(super()._decoded()):
            if not number:
                check_order(self.path, events.t, x=events.x, y=events.y)
            yield events


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it."""
    write_lines(path, recording, f"{recording.size[0]} {recording.size[1]}", " ", SECOND, False)


def _recognises(head: bytes, path: Path) -> bool:
    comments = COMMENTS.match(head)
    begin = comments.end() if comments else 0
    size = SIZE.match(head, begin)
    return bool(EVENT.match(head, size.end() if size else begin) or (size and size.end() == len(head)))


FORMAT = Format(
    "rpg",
    "text: t x y p, in seconds",
    ".txt",
    recognises=_recognises,
    open=RpgEvents,
    write=write_events,
    largest=(1 << 16, 1 << 16),
    keeps=frozenset({"size"}),
)
