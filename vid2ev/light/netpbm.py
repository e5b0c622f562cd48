"""Codes of Netpbm's pictures: which of them is white, and PAM, which OpenCV reads wrongly.

OpenCV leaves the codes of P5, P6 and of 16 bits as they stand, whatever their header says is white; it scales those of
P2 and P3 that fit into 8 bits.  Of a PAM it takes red for blue, and memory that nobody wrote for what has transparency.

Source: netpbm, "PGM", "PPM" and "PAM" formats.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from vid2ev.light.recognise import head_of
from vid2ev.untrusted import check_bytes

AS_STORED = (b"P5", b"P6", b"P7")
WITH_WHITE = (b"P2", b"P3", *AS_STORED)
PAM, END = b"P7", b"ENDHDR\n"


def white_in(path: Path) -> int | None:
    """The code that is white, where it is not the largest of 8 or 16 bits: 1023 as FFmpeg writes 10 of them, 100 or
    anything else.  None for all others, and where OpenCV has scaled them."""
    head = head_of(path)
    words = re.sub(rb"#[^\n]*", b" ", head).split(maxsplit=4)
    said = _pam(head).get(b"MAXVAL", b"") if head.startswith(PAM) else words[3] if len(words) > 3 else b""
    most = int(said) if head.startswith(WITH_WHITE) and said.isdigit() and len(said) < 6 else 0
    held = 16 if most > 255 else 8
    as_stored = held == 16 or head.startswith(AS_STORED)
    return most if 0 < most < 2**held - 1 and as_stored else None


def pnm_of_pam(path: Path) -> bytes:
    """A PNM of the same codes, without transparency.  Raises ValueError, KeyError for what is no PAM, DataError for one
    that is larger than a file may be in memory."""
    check_bytes(path, path.stat().st_size)
    head, _, raster = path.read_bytes().partition(END)
    said = _pam(head)
    width, height, depth, most = (int(said[name]) for name in (b"WIDTH", b"HEIGHT", b"DEPTH", b"MAXVAL"))
    if not 1 <= depth <= 4 or not 0 < most < 2**16:
        raise ValueError(f"{depth} channels, of which {most} is white")
    codes = np.frombuffer(raster, ">u2" if most > 255 else "u1", width * height * depth).reshape(-1, depth)
    kind, channels = (b"P5", 1) if depth < 3 else (b"P6", 3)
    return b"%b %d %d %d\n" % (kind, width, height, most) + codes[:, :channels].tobytes()


def _pam(head: bytes) -> dict[bytes, bytes]:
    """What a PAM says of itself."""
    lines = (line.split(maxsplit=1) for line in head.partition(END)[0].splitlines())
    return {line[0]: line[1].strip() for line in lines if len(line) == 2}
