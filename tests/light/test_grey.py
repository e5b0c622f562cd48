"""A picture is grey by its header if it is when it is read."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from vid2ev.errors import DataError
from vid2ev.light import grey
from vid2ev.light.grey import is_grey
from vid2ev.light.picture_files import read_picture

PALETTE = b"\0\0\0\x05\x06\x07"
PLANES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # of the colour types of a PNG


def part(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png(kind: int, bits: int, *more: bytes) -> bytes:
    row = bytes(1 + -(-8 * PLANES[kind] * bits // 8))
    head = part(b"IHDR", struct.pack(">IIBBBBB", 8, 8, bits, kind, 0, 0, 0))
    return grey.PNG + head + b"".join(more) + part(b"IDAT", zlib.compress(row * 8)) + part(b"IEND", b"")


def jpeg(pixels: np.ndarray, *options: int, before: bytes = b"") -> bytes:
    content = cv2.imencode(".jpg", pixels, options)[1].tobytes()
    return content[:2] + before + content[2:]


FLAT, COLOURED = np.zeros((8, 8), np.uint8), np.zeros((8, 8, 3), np.uint8)
BY_HEADER = {
    **{f"grey of {bits}": png(0, bits) for bits in (1, 2, 4, 8, 16)},
    "grey with a clear code": png(0, 8, part(b"tRNS", b"\0\0")),
    "red, green, blue": png(2, 8),
    "palette": png(3, 8, part(b"PLTE", PALETTE)),
    "palette with a clear entry": png(3, 8, part(b"PLTE", PALETTE), part(b"tRNS", b"\0")),
    "grey with alpha": png(4, 8),
    "colour with alpha": png(6, 16),
    "grey JPEG": jpeg(FLAT),
    "JPEG": jpeg(COLOURED),
    "progressive JPEG": jpeg(FLAT, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "JPEG with a long part": jpeg(FLAT, before=b"\xff\xe1\xff\x00" + bytes(0xFEFE)),
    "P2": b"P2\n8 8\n255\n" + b"7 " * 64,
    "P4": b"P4\n8 8\n" + bytes(8),
    "P5": b"P5\n8 8\n65535\n" + bytes(128),
    "P6": b"P6\n8 8\n255\n" + bytes(192),
    "Pf": b"Pf\n8 8\n-1\n" + bytes(256),
    "PF": b"PF\n8 8\n-1\n" + bytes(768),
}
READ = {
    f"{kind} {pixels.ndim}": cv2.imencode(kind, pixels)[1].tobytes()
    for kind in (".tif", ".bmp", ".webp")
    for pixels in (FLAT, COLOURED)
}


@pytest.mark.parametrize("name", [*BY_HEADER, *READ])
def test_a_header_says_what_reading_says(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "some").write_bytes((BY_HEADER | READ)[name])
    wanted = read_picture(tmp_path / "some").pixels.ndim == 2
    if name in BY_HEADER:
        monkeypatch.setattr(grey, "read_picture", None)  # (it is not asked for)
    assert is_grey(tmp_path / "some") == wanted


@pytest.mark.parametrize("content", [grey.PNG, b"\xff\xd8\xff", b"\xff\xd8\xff\xc0\x00", b"", jpeg(FLAT)[:30]])
def test_a_header_that_is_cut_short_says_nothing(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "some.png").write_bytes(content)
    with pytest.raises(DataError, match="not an image that can be read"):
        is_grey(tmp_path / "some.png")
