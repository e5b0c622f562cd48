"""Prophesee RAW, EVT 2: words of 32 bits, the upper 4 say what the rest is.

    0  CD_OFF          time [27:22], column [21:11], row [10:0]    an event; the lower 6 bits of its time [us]
    1  CD_ON           the same
    8  EVT_TIME_HIGH   time / 64 us [27:0]                         starts anew after 4.8 h
    A  EXT_TRIGGER     F continued words   E others                passed over

EVT 2.1, which is only read, has 32 more bits, one for each of the pixels from that column on; they come first, but
last where the byte order in the header is "legacy".

The writer sends an EVT_TIME_HIGH wherever the events need one, and in silence one every 4.096 ms, as EVT 3 does: enough
for Prophesee's decoder, which follows the new start of time only over gaps of less than 10 ms, and 1 kB per second of
silence instead of the 60 kB that a word every 64 us would take.

Sources: https://docs.prophesee.ai/stable/data/encoding_formats/evt2.html and evt21.html
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vid2ev.formats.event_file import Format, Recording
from vid2ev.formats.prophesee import RawEvents, read_header, write_raw

VERSION, VECTORS = "2.0", "2.1"


class Evt2Events(RawEvents):
    """The events of an EVT 2 or 2.1 file.  Raises DataError."""

    def __init__(self, path: Path):
        super().__init__(path, {VERSION: ("u4", _decoder), VECTORS: ("u8", self._vectors)})

    def _vectors(self) -> Callable:
        from vid2ev.formats.evt2_words import decode_vectors

        if self._header.byte_order != "legacy":
            return decode_vectors
        half = np.uint64(32)
        return lambda state, left, start_us, words, *rest: decode_vectors(
            state, left, start_us, words << half | words >> half, *rest
        )


def write_events(path: Path, recording: Recording) -> None:
    """Write a recording.  Raises OSError where the disk cannot take it."""
    from vid2ev.formats.evt2_words import encode

    write_raw(path, recording, VERSION, "<u4", encode)


def _recognises(head: bytes, path: Path) -> bool:
    header = read_header(head)
    return header is not None and header.version in (VERSION, VECTORS)


def _decoder() -> Callable:
    from vid2ev.formats.evt2_words import decode

    return decode


FORMAT = Format(
    "evt2",
    "Prophesee RAW, EVT 2",
    ".raw",
    recognises=_recognises,
    open=Evt2Events,
    write=write_events,
    largest=(2048, 2048),
    idle_bytes=977,  # a word of 4 bytes in 4096 us
    keeps=frozenset({"size", "start"}),
)
