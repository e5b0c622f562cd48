"""EXIF of a WebP that begins with the mark that JPEG has before it, as libvips and others write it: OpenCV then finds
no orientation in it.

Source: RFC 9649, sections 2.3 and 2.7 (parts of a file, even in length).
"""

from __future__ import annotations

from pathlib import Path

from vid2ev.untrusted import check_bytes

MARK = b"Exif\0\0"
MANY = 1 << 10  # parts of a file that are looked at


def without_mark(path: Path) -> bytes | None:
    """The content of a WebP whose EXIF begins with the mark, without that; None for any other file.  Raises DataError
    for one that is larger than a file may be in memory."""
    place, end = 12, path.stat().st_size
    with open(path, "rb") as file:
        for _ in range(MANY):
            file.seek(place)
            part = file.read(8 + len(MARK))
            length = int.from_bytes(part[4:8], "little")
            if part[:4] == b"EXIF" or place > end:
                break
            place += 8 + length + length % 2
    if part[:4] != b"EXIF" or part[8:] != MARK or length < len(MARK):
        return None
    check_bytes(path, end)
    content = path.read_bytes()
    whole = int.from_bytes(content[4:8], "little") - len(MARK)
    shorter = (length - len(MARK)).to_bytes(4, "little")
    return b"RIFF" + whole.to_bytes(4, "little") + content[8 : place + 4] + shorter + content[place + 8 + len(MARK) :]
