"""Codes of Netpbm's pictures: which of them is white, and those that OpenCV reads wrongly.

OpenCV leaves the codes of P5 and P6 as they stand, whatever their header says is white; it scales those of P2 and P3
that fit into 8 bits, depth too.  Of a PAM it takes red for blue, and memory that nobody wrote where it is transparent.

Source: netpbm, "PGM", "PPM" and "PAM" formats.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from vid2ev.light.recognise import head_of
from vid2ev.untrusted import check_bytes

TEXT, PAM, END = (b"P2", b"P3"), b"P7", b"ENDHDR\n"
WITH_WHITE = (*TEXT, b"P5", b"P6", PAM)


def white_of_pnm(path: Path) -> int | None:
    """The code that is white by the header, where it is not the largest of 8 or 16 bits: 1023 as FFmpeg writes 10 of
    them, 100 or anything else.  None for all others."""
    head = head_of(path)
    words = re.sub(rb"#[^\n]*", b" ", head).split(maxsplit=4)
    said = _pam(head).get(b"MAXVAL", b"") if head.startswith(PAM) else words[3] if len(words) > 3 else b""
    most = int(said) if head.startswith(WITH_WHITE) and said.isdigit() and len(said) < 6 else 0
    return most if 0 < most < (2**16 if most > 255 else 2**8) - 1 else None


def plain_pnm(path: Path) -> bytes:
    """A PNM of bytes of the same codes as a PAM's or a text's, without transparency.  Raises ValueError, KeyError for
    what is neither, DataError for one that is larger than a file may be in memory."""
    check_bytes(path, path.stat().st_size)
    content = path.read_bytes()
    if content.startswith(PAM):
        head, _, raster = content.partition(END)
        said = _pam(head)
        width, height, depth, most = (int(said[name]) for name in (b"WIDTH", b"HEIGHT", b"DEPTH", b"MAXVAL"))
    else:
        kind, *numbers, raster = re.sub(rb"#[^\n]*", b" ", content).split(maxsplit=4)
        (width, height, most), depth = map(int, numbers), 1 if kind == b"P2" else 3
    if not 1 <= depth <= 4 or not 0 < most < 2**16:
        raise ValueError(f"{depth} channels, of which {most} is white")
    dtype, count = np.dtype(">u2" if most > 255 else "u1"), width * height * depth
    if content.startswith(PAM):
        codes = np.frombuffer(raster, dtype, count)
    else:
        codes = np.array(raster.split()[:count], "S9").astype(np.int64).clip(0, np.iinfo(dtype).max).astype(dtype)
    codes = codes.reshape(height, width, depth)
    kind, channels = (b"P5", 1) if depth < 3 else (b"P6", 3)
    return b"%b %d %d %d\n" % (kind, width, height, most) + codes[..., :channels].tobytes()


def _pam(head: bytes) -> dict[bytes, bytes]:
    """What a PAM says of itself."""
    lines = (line.split(maxsplit=1) for line in head.partition(END)[0].splitlines())
    return {line[0]: line[1].strip() for line in lines if len(line) == 2}
