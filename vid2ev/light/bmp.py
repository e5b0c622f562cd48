"""What a BMP says of how its colours lie, and which of them OpenCV takes for others without a word.

Of 16 bits it shifts codes of 5 bits up to 8, so that white is 248, and of 32 bits it takes blue, green and red to come
in this order whatever the masks say.

Source: Microsoft, "BITMAPINFOHEADER structure" and "BITMAPV4HEADER structure".
"""

from __future__ import annotations

import struct
from pathlib import Path

from vid2ev.errors import DataError
from vid2ev.light.recognise import head_of

SHORTEST, MASKED = 40, (3, 6)  # bytes of a header that says it; ways of storing in which masks say where colours are
USUAL = (0xFF0000, 0xFF00, 0xFF)  # of red, green and blue


def check_bmp(path: Path) -> None:
    """Raise DataError for a BMP that would be read wrongly."""
    head = head_of(path)
    if len(head) < 66 or int.from_bytes(head[14:18], "little") < SHORTEST:
        return
    bits, stored = struct.unpack_from("<HI", head, 28)
    if bits == 16 or (stored in MASKED and struct.unpack_from("<III", head, 54) != USUAL):
        raise DataError(
            f"{path}: a BMP of {bits} bits a pixel whose colours lie otherwise than those of most, which is not read;"
            " write it anew with 24 bits, or as PNG"
        )
