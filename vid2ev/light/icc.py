"""The name of the ICC profile that a picture holds; no more of it is read, and that is said.

Sources: ICC.1:2022, sections 7.2 and 7.3 (header, table of tags), 10.13 (texts) and B.3, B.4 (where it is in TIFF and
JPEG); ICC.1:2001-04, 6.5.17 (texts before 2010); ITU-T T.81, B.1.1 (marks of a JPEG).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from vid2ev.light.recognise import JPEG, TIFF, head_of

LARGEST = 1 << 16  # bytes of a profile that are looked at: what one part of a JPEG holds
MANY = 1 << 10  # parts of a file that are looked at
LONGEST = 60  # characters
PROFILE = 34675  # the tag of a TIFF
IN_JPEG = b"ICC_PROFILE\0"
SMALL_SRGB = {"c2", "c2ci", "uRGB"}  # that large sites give pictures, to save bytes
REMEDY = "unless --transfer says another curve"


def profile_name(path: Path) -> str | None:
    """The name in a JPEG or a TIFF, empty for a profile without; None where there is no profile.  Raises DataError."""
    head = head_of(path)
    with open(path, "rb") as file:
        profile = _of_jpeg(file) if head.startswith(JPEG) else _of_tiff(file) if head.startswith(TIFF) else b""
    return name_in(profile) if profile else None


def remarks_on_profile(path: Path, name: str | None) -> list[str]:
    """That the profile of a file is none of sRGB, if it has one that is not, by its name."""
    if name is None or "srgb" in name.lower() or name in SMALL_SRGB:
        return []
    return [f"{path}: its ICC profile {name!r} is not read; its codes are taken for sRGB, {REMEDY}"]


def jpeg_parts(file: BinaryIO) -> Iterator[tuple[int, int]]:
    """The parts of a JPEG before its pixels: the mark, and where the part ends; the file is at its content."""
    end = 2
    for _ in range(MANY):
        file.seek(end)
        mark = file.read(4)
        if len(mark) < 4 or mark[0] != 0xFF or mark[1] in (0xD9, 0xDA):  # (pixels follow)
            return
        if mark[1] == 0xFF:  # (before a mark there may be as many of these as one likes)
            end += 1
            continue
        end += 2 + int.from_bytes(mark[2:])
        yield mark[1], end


def _of_jpeg(file: BinaryIO) -> bytes:
    """The first part of it."""
    for mark, end in jpeg_parts(file):
        if mark == 0xE2 and file.read(len(IN_JPEG)) == IN_JPEG:
            file.read(2)
            return file.read(min(max(end - file.tell(), 0), LARGEST))
    return b""


def _of_tiff(file: BinaryIO) -> bytes:
    little = file.read(2) == b"II"

    def number(size: int) -> int:
        return int.from_bytes(file.read(size), "little" if little else "big")

    if number(2) != 42:  # (of BigTIFF nothing is said)
        return b""
    file.seek(number(4))
    for _ in range(min(number(2), MANY)):
        tag, _, size, place = number(2), number(2), number(4), number(4)
        if tag == PROFILE:
            file.seek(place)
            return file.read(min(size, LARGEST))
    return b""


def name_in(profile: bytes) -> str:
    """What a profile says that it is, as far as it goes; empty where it does not."""
    for k in range(min(int.from_bytes(profile[128:132]), MANY)):
        entry = profile[132 + 12 * k : 144 + 12 * k]
        if entry[:4] == b"desc":
            begin = int.from_bytes(entry[4:8])
            return "".join(filter(str.isprintable, _text(profile[begin:])))[:LONGEST].strip()
    return ""


def _text(tag: bytes) -> str:
    """In the first of its languages."""
    if tag.startswith(b"mluc"):
        length, begin = int.from_bytes(tag[20:24]), int.from_bytes(tag[24:28])
        return tag[begin : begin + min(length, 4 * LONGEST)].decode("utf-16-be", "replace")
    return tag[12 : 12 + min(int.from_bytes(tag[8:12]), 4 * LONGEST)].decode("latin-1")
