"""Matroska and WebM: whether a file is there to its end, which its header says.

    file      EBML header, segment; each an identity, a number of bytes, and these
    number    big endian in 1 to 8 bytes, as many as zeros before its first 1, and that; all ones: nobody knows

Source: RFC 8794, sections 4 and 5; RFC 9559, section 5.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

HEADER, SEGMENT = bytes.fromhex("1a45dfa3"), bytes.fromhex("18538067")


def missing_bytes(path: Path) -> int:
    """How many bytes of the segment are missing; 0 where that is not known, and of other files."""
    with open(path, "rb") as file:
        if file.read(4) != HEADER:
            return 0
        if (header := _number(file) or 0) > path.stat().st_size:  # (where a file system may not lead)
            return 0
        file.seek(header, 1)
        if file.read(4) != SEGMENT:
            return 0
        said = _number(file)
        return 0 if said is None else max(file.tell() + said - path.stat().st_size, 0)


def _number(file: BinaryIO) -> int | None:
    first = file.read(1)
    length = 9 - (first or b"\0")[0].bit_length()
    if length > 8:
        return None
    bits = 7 * length
    number = int.from_bytes(first + file.read(length - 1), "big") & ((1 << bits) - 1)
    return None if number == (1 << bits) - 1 else number
