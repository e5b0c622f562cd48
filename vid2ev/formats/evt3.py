"""Prophesee RAW, EVT 3: words of 16 bits, the upper 4 say what the rest is.

    0  EVT_ADDR_Y      row [10:0]                             of the events that follow
    2  EVT_ADDR_X      polarity [11], column [10:0]           an event
    3  VECT_BASE_X     polarity [11], column [10:0]           of the vectors that follow
    4  VECT_12         one bit per pixel [11:0]               up to 12 events; the base moves on by 12
    5  VECT_8          one bit per pixel [7:0]                up to 8 events; the base moves on by 8
    6  EVT_TIME_LOW    time [us], lower 12 bits
    8  EVT_TIME_HIGH   time, upper 12 bits; they start anew every 16.8 s
    A  EXT_TRIGGER     7, F continued words   E others        passed over

As a camera does, the writer sends an EVT_TIME_HIGH every 4.096 ms, whether there are events or not: time that is not
counted so is lost to readers at the latest after 16.8 s.  Five events or more of one instant, row and polarity, in
ascending columns of one group of 32, are written as VECT_BASE_X, VECT_12, VECT_12, VECT_8, the only way in which
Prophesee's decoder takes vectors.

The reader takes a step back of the upper bits by half of their range or more for a new start, as Prophesee's does, and
a smaller one for what it is.  Source: https://docs.prophesee.ai/stable/data/encoding_formats/evt3.html
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from vid2ev.formats.event_file import Format, Recording
from vid2ev.formats.prophesee import RawEvents, read_header, write_raw

VERSION = "3.0"


def open_events(path: Path) -> RawEvents:
    """The events of an EVT 3 file.  Raises DataError."""
    return RawEvents(path, {VERSION: ("u2", _decoder)})


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it."""
    from vid2ev.formats.evt3_words import encode

    write_raw(path, recording, VERSION, "<u2", encode)


def _recognises(head: bytes, path: Path) -> bool:
    header = read_header(head)
    return header is not None and header.version == VERSION


def _decoder() -> Callable:
    from vid2ev.formats.evt3_words import decode

    return decode


FORMAT = Format(
    "evt3",
    "Prophesee RAW, EVT 3",
    ".raw",
    recognises=_recognises,
    open=open_events,
    write=write_events,
    largest=(2048, 2048),
    idle_bytes=488,  # a word of 2 bytes in 4096 us
    keeps=frozenset({"size", "start"}),
)
