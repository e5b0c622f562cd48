"""What a TIFF says of how its samples lie, and which of them OpenCV takes for others without a word.

Of more than 8 bits it reads planes of their own as one, does not turn codes of which 0 is white, and shortens grey
beside transparency to 8 bits.  Codes of 10 to 14 bits without gaps between them it shifts up to 16, where white is not
the largest code.

Source: TIFF revision 6.0, sections 2 and 8; BigTIFF, Adobe's proposal of 2007: places of 8 bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO, Literal

from vid2ev.errors import DataError

MANY = 1 << 10  # tags that are looked at
SIZES = {1: 1, 3: 2, 4: 4, 16: 8}  # bytes of whole numbers, by their type
BITS, PHOTOMETRIC, SAMPLES, PLANAR = 258, 262, 277, 284  # tags
WHITE_IS_0, BLACK_IS_0, APART = 0, 1, 2


def check_tiff(path: Path) -> None:
    """Raise DataError if the first picture of a TIFF is one that would be read wrongly."""
    with open(path, "rb") as file:
        tags = numbers_in(file)
    bits, samples = tags.get(BITS, 1), tags.get(SAMPLES, 1)
    if bits <= 8:
        return
    if samples > 1 and tags.get(PLANAR) == APART:
        raise DataError(
            f"{path}: a TIFF of {bits} bits with its colours in planes of their own, which is read of 8 bits only;"
            " bring them together, as tiffcp -p contig does"
        )
    if tags.get(PHOTOMETRIC) == WHITE_IS_0:
        raise DataError(
            f"{path}: a TIFF of {bits} bits in which 0 is white, which is read of 8 bits only; write it anew with 0 for"
            " black"
        )
    if samples == 2 and tags.get(PHOTOMETRIC) == BLACK_IS_0:
        raise DataError(
            f"{path}: a TIFF of {bits} bits, grey with transparency, which is read of 8 bits only; write it"
            " anew without"
        )


def packed_bits(path: Path) -> int | None:
    """Of how many bits the codes of a TIFF are, where these are more than 8 and do not fill 16."""
    with open(path, "rb") as file:
        bits = numbers_in(file).get(BITS, 1)
    return bits if 8 < bits < 16 else None


def numbers_in(file: BinaryIO) -> dict[int, int]:
    """The tags of the first picture that are whole numbers: the first number of each."""
    end = file.seek(0, 2)
    file.seek(0)
    order: Literal["little", "big"] = "little" if file.read(2) == b"II" else "big"

    def number(size: int) -> int:
        return int.from_bytes(file.read(size), order)

    wide = number(2) == 43
    place = 8 if wide else 4  # bytes
    file.seek(8 if wide else 4)
    file.seek(min(number(place), end))
    found = {}
    for _ in range(min(number(8 if wide else 2), MANY)):
        tag, kind, count = number(2), number(2), number(place)
        held, size = file.read(place), SIZES.get(kind, 0)
        if size and count * size > place:
            after = file.tell()
            file.seek(min(int.from_bytes(held, order), end))
            held = file.read(size)
            file.seek(after)
        if size and count:
            found[tag] = int.from_bytes(held[:size], order)
    return found
