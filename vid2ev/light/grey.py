"""Whether the picture of a file is grey, by its header where that says it: decoding thousands only for that takes long.

Sources: PNG (third edition) 11.2.1; ITU-T T.81 B.2.2; netpbm, "PNM" and "PFM" formats.
"""

from __future__ import annotations

from pathlib import Path

from vid2ev.light.icc import jpeg_parts
from vid2ev.light.picture_files import read_picture
from vid2ev.light.recognise import JPEG, PNG, head_of, is_animated_png

NETPBM = {b"P1": True, b"P2": True, b"P4": True, b"P5": True, b"Pf": True, b"P3": False, b"P6": False, b"PF": False}
SIZES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # marks of a JPEG at the part that says how large it is


def is_grey(path: Path) -> bool:
    """Whether `read_picture` gives one channel.  Raises DataError as that, where the picture has to be read for it."""
    said = _by_header(path)
    return read_picture(path).pixels.ndim == 2 if said is None else said


def _by_header(path: Path) -> bool | None:
    """None where it does not say so for certain."""
    head = head_of(path)
    if head.startswith(PNG):
        return head[25] == 0 if head[12:16] == b"IHDR" and len(head) > 25 and not is_animated_png(path) else None
    if head.startswith(JPEG):
        return _of_jpeg(path)
    return NETPBM.get(head[:2])


def _of_jpeg(path: Path) -> bool | None:
    with open(path, "rb") as file:
        for mark, _ in jpeg_parts(file):
            if mark in SIZES:
                size = file.read(6)
                return size[5] == 1 if len(size) == 6 else None
    return None
