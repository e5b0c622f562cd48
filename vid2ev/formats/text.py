"""What the files of text have in common: an event per line, read some lines at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import Recording, promised
from vid2ev.formats.sequential import PIECE, Sequential, reading
from vid2ev.stream.events import Events

LINES = 1 << 15  # written at a time
LONGEST = 1 << 16  # bytes of a line that is read
SHORTEST = 8  # bytes of a line that has an event
MARK = b"\xef\xbb\xbf"  # that Windows puts before a text
FIELDS = ("t", "x", "y", "p", "label")


class TextEvents(Sequential):
    """The events in the lines of a text.

    fields  what the fields of a line are, of `FIELDS`; what is none of them is passed over
    power   10**power microseconds are the unit of time
    skip    lines before the first event
    """

    def __init__(self, path: Path, fields: list[str], power: int, skip: int):
        super().__init__(path)
        self._fields = np.array([FIELDS.index(name) if name in FIELDS else -1 for name in fields], np.int64)
        self._power, self._skip = power, skip
        self.labelled = "label" in fields

    def _decoded(self) -> Iterator[Events]:
        from vid2ev.formats.text_lines import parse

        outside = 0
        for data, line, cut in self._lines():
            count = len(data) // SHORTEST + 1
            types = (np.int64, np.uint16, np.uint16, np.uint8, np.uint8)
            t, x, y, p, label = (np.empty(count, dtype) for dtype in types)
            found, end = parse(np.frombuffer(data, np.uint8), self._fields, self._power, t, x, y, p, label)
            if end < len(data):
                bad = data[end : data.index(b"\n", end)]
                if not cut or end + len(bad) + 1 < len(data):
                    raise self._damaged(line + data.count(b"\n", 0, end), bad)
                self._leave_out(1, "line at the end, where the file is cut, is")
            label_or_none = label[:found] if self.labelled else None
            events, left = self._inside(Events(t[:found], x[:found], y[:found], p[:found], label_or_none))
            outside += left
            yield events
        self._leave_out(outside, f"{self._outside} are")

    def _lines(self) -> Iterator[tuple[bytes, int, bool]]:
        """Whole lines, the number of the first, and whether the last had no end in the file."""
        rest, line = b"", 1 + self._skip
        with reading(self.path) as file:
            if file.read(len(MARK)) != MARK:
                file.seek(0)
            for _ in range(self._skip):
                file.readline(LONGEST)
            while piece := file.read(PIECE):
                data = rest + piece
                end = data.rfind(b"\n") + 1
                rest = data[end:]
                if len(rest) > LONGEST:
                    raise self._damaged(line + data.count(b"\n"), rest)
                if end:
                    yield data[:end], line, False
                    line += data.count(b"\n")
        if rest:
            yield rest + b"\n", line, True

    def _damaged(self, line: int, text: bytes) -> DataError:
        shown = text[:40].decode("ascii", "backslashreplace").strip()
        return DataError(f"{self.path}, line {line}: '{shown}' is no event; expected {self._expected()}")

    def _expected(self) -> str:
        names = [FIELDS[field] if field >= 0 else "..." for field in self._fields]
        unit = "seconds" if self._power else "whole microseconds"
        return f"{' '.join(names)}, with t in {unit}, x and y from 0 to 65535"


def write_lines(path: Path, recording: Recording, head: str, separator: str, second_us: int, labels: bool) -> None:
    """Write a line that is the head, then one for each event.  Raises OSError where the disk cannot take it."""
    from vid2ev.formats.text_lines import WIDEST, write

    text, none = np.empty(LINES * WIDEST, np.uint8), np.empty(0, np.uint8)
    with open(path, "wb") as file:
        file.write(f"{head}\n".encode())
        for _, events in promised(recording):
            for first in range(0, len(events), LINES):
                part = events.stretch(first, min(first + LINES, len(events)))
                label = part.label if labels and part.label is not None else none
                size = write(part.t, part.x, part.y, part.p, label, ord(separator), second_us, text)
                file.write(text[:size].data)
