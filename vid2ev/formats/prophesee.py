"""What Prophesee's files have in common: lines of text at the start, then words.

    % evt 3.0                                 version of the words; absent in DAT files
    % format EVT3;height=720;width=1280       the same in newer files
    % geometry 1280x720                       (DAT files: Width, Height)
    % endianness little                       order of the bytes of words; an option of the format, too
    % start_us 81000                          the instant from which times count, on the clock of the source
    % end                                     newer files only

`start_us` is ours, `t0` that of faery; other readers pass over lines that they do not know.  The date is left out, so
the same events give the same bytes.  Sources: https://docs.prophesee.ai/stable/data/file_formats/raw.html and
https://docs.prophesee.ai/stable/data/file_formats/dat.html
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vid2ev.errors import DataError
from vid2ev.formats.event_file import HEAD, Recording, promised
from vid2ev.formats.sequential import Sequential, decoded, pieces, reading
from vid2ev.stream.events import Events

WORDS = 1 << 18  # written at a time
UNKNOWN_SIZE = (2048, 2048)  # all that the words can say
MAKER, ORDERED_FROM = "Prophesee", 0x37  # the first of its systems that has the halves of 64 bits in their order


class Header(NamedTuple):
    """The lines at the start of a file: what they say, and how many bytes they are."""

    fields: dict[str, str]
    length: int

    @property
    def version(self) -> str | None:
        """That of the words, such as "3.0"."""
        named = {"EVT2": "2.0", "EVT21": "2.1", "EVT3": "3.0"}.get(self.fields.get("format", "").partition(";")[0])
        return named or self.fields.get("evt")

    @property
    def size(self) -> tuple[int, int] | None:
        """(width, height) if there is one."""
        both = ";".join(f"{name}={self.fields.get(name, '')}" for name in ("format", "width", "height"))
        found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", self.fields.get("geometry", ""))
        sides = found.groups() if found else [_number(rf"{side}=(\d{{1,5}})\b", both) for side in ("width", "height")]
        width, height = (int(side or 0) for side in sides)
        return (width, height) if width and height else None

    @property
    def byte_order(self) -> str:
        """Of the words: "little", "big", or "legacy", of halves of 32 bits with the upper one first.

        It is an option of the format, or a line of its own; of neither, Prophesee's own older systems are known by
        their number, as its SDK knows them.
        """
        _, given, option = self.fields.get("format", "").partition("endianness=")
        if given or "endianness" in self.fields:
            return (option.partition(";")[0] if given else self.fields["endianness"]).lower()
        makers = {self.fields.get(f"{part}integrator_name", MAKER) for part in ("", "plugin_", "camera_")}
        system = self.fields.get("system_id", "")
        number = int(system) if re.fullmatch(r"\d{1,5}", system) else ORDERED_FROM
        return "legacy" if makers == {MAKER} and 0 < number < ORDERED_FROM else "little"

    @property
    def start_us(self) -> int | None:
        """The instant from which times count, if it is there."""
        found = _number(r"(?<!\d)(-?\d{1,19})(?!\d)", self.fields.get("start_us", self.fields.get("t0", "")))
        return int(found) if found is not None and abs(int(found)) < 1 << 62 else None


def read_header(head: bytes) -> Header | None:
    """The header of a file, from its first bytes; None if there is none."""
    fields, at = {}, 0
    while line := re.compile(rb"%(?: ([\t\x20-\x7e]{0,4000}))?\r?\n").match(head, at):
        key, _, value = (line[1] or b"").decode().strip().partition(" ")
        fields[key.lower()] = value.strip()
        at = line.end()
        if key == "end":
            break
    return Header(fields, at) if fields else None


class RawEvents(Sequential):
    """The events of a RAW file.

    kinds  version -> (dtype of the words, what gives the function that decodes them)
    Raises DataError for a file without header.
    """

    def __init__(self, path: Path, kinds: dict[str, tuple[str, Callable[[], Callable]]]):
        super().__init__(path)
        with reading(path) as file:
            header = read_header(file.read(HEAD))
        if header is None or header.version not in kinds:
            raise DataError(f"{path} has no header that says EVT {' or '.join(kinds)}; expected a RAW file")
        self.size, self.start_us, self.says_start = header.size, header.start_us or 0, header.start_us is not None
        self._header = header
        dtype, self._decoder = kinds[header.version]
        self._dtype = np.dtype(dtype).newbyteorder(">" if header.byte_order == "big" else "<")

    def describe(self) -> dict[str, Any]:
        """The lines of the header."""
        return {"version": self._header.version, "header": self._header.fields}

    def _decoded(self) -> Iterator[Events]:
        from vid2ev.formats.evt_state import Left, State, said_of

        state, left = np.full(len(State), -1, np.int64), np.zeros(len(Left), np.int64)
        with reading(self.path) as file:
            file.seek(self._header.length)
            words = (piece.astype(piece.dtype.newbyteorder("="), copy=False) for piece in pieces(file, self._dtype))
            decode = partial(self._decoder(), state, left, self.start_us)
            yield from decoded(words, decode, self.size or UNKNOWN_SIZE)
        for count, what in said_of(left, self._outside):
            self._leave_out(count, what)
        cut = (self.path.stat().st_size - self._header.length) % self._dtype.itemsize
        self._leave_out(cut, "bytes at the end, where the file is cut within a word, are")


def write_raw(path: Path, recording: Recording, version: str, dtype: str, encode: Callable) -> None:
    """Write a RAW file; encode(t, x, y, p, first, until_us, state, words) is the compiled function that says events
    number `first` and on in words, then time up to until_us, and returns how many events and words those were."""
    from vid2ev.formats.evt_state import State

    width, height = recording.size
    name = f"EVT{version[0]}"
    fields = (f"evt {version}", f"format {name};height={height};width={width}", f"geometry {width}x{height}")
    state, words = np.full(len(State), -1, np.int64), np.empty(WORDS, dtype)
    state[State.WIDTH] = width
    with open(path, "wb") as file:
        file.write("".join(f"% {line}\n" for line in (*fields, f"start_us {recording.start_us}", "end")).encode())

        def put(t: np.ndarray, events: Events, until_us: int) -> None:
            first = 0
            while first <= len(t):
                first, count = encode(t, events.x, events.y, events.p, first, until_us, state, words)
                file.write(words[:count].data)

        for t, events in promised(recording):
            put(t, events, int(t[-1]))
        put(np.empty(0, np.int64), Events.empty(), recording.duration_us)


def _number(pattern: str, text: str) -> str | None:
    found = re.search(pattern, text)
    return found[1] if found else None
