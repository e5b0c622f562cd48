"""What a PNG says of its colours: the curve of its codes, and which red, green and blue they are of.

    cICP      code points of Rec. ITU-T H.273; before all others
    iCCP      a profile, of which only the name is read: sRGB (its own; some programs give all of them one in the tag)
    sRGB      sRGB
    gAMA      codes are light ^ g.  1 / 2.2 is what programs write beside sRGB, and taken for that
    cHRM      chromaticities, where none of the first three is there

Source: PNG (third edition), W3C Recommendation of 2025, sections 4.3 and 11.3.2.
"""

from __future__ import annotations

import zlib
from pathlib import Path

from vid2ev.errors import UsageError
from vid2ev.light.icc import LARGEST, REMEDY, name_in, remarks_on_profile
from vid2ev.light.primaries import Primaries, primaries_at, primaries_of
from vid2ev.light.tags import TRANSFERS, UNSPECIFIED
from vid2ev.light.transfer import parse_transfer
from vid2ev.untrusted import png_chunks

SMALL = 64  # bytes of a tag that are read, but for those of a profile
USUAL_GAMMA = 45455  # hundred thousandths


def png_tags(path: Path) -> tuple[str | None, Primaries | None]:
    """The transfer curve of a PNG that can be read, and its primaries; None where it does not say."""
    chunks = _chunks(path)
    if len(code := chunks.get(b"cICP", b"")) == 4:
        return TRANSFERS.get(code[1]), primaries_of(code[0])
    if b"iCCP" in chunks or b"sRGB" in chunks:
        return None, None
    return _curve(chunks.get(b"gAMA", b"")), _primaries(chunks.get(b"cHRM", b""))


def remarks_on_png(path: Path) -> list[str]:
    """That a PNG says of its codes what is not taken up."""
    chunks = _chunks(path)
    if len(code := chunks.get(b"cICP", b"")) == 4:
        curve, full_range = code[1], code[3]
        unknown = f"{path}: transfer curve {curve} of H.273 is not known; its codes are taken for sRGB, {REMEDY}"
        limited = f"{path}: codes of limited range by its tag cICP are taken for those of full range; write it anew so"
        return [unknown] * (curve not in (*TRANSFERS, UNSPECIFIED)) + [limited] * (not full_range)
    return remarks_on_profile(path, _profile_name(chunks[b"iCCP"]) if b"iCCP" in chunks else None)


def _profile_name(tag: bytes) -> str:
    """That in the profile, or else that of the tag: between the two are a zero and the way of compression."""
    name, _, packed = tag.partition(b"\0")
    try:
        profile = zlib.decompressobj().decompress(packed[1:], LARGEST)
    except zlib.error:
        profile = b""
    return name_in(profile) or name.decode("latin-1")


def _chunks(path: Path) -> dict[bytes, bytes]:
    """What comes before the pixels, by its name."""
    found: dict[bytes, bytes] = {}
    with open(path, "rb") as file:
        for kind, length, _ in png_chunks(file):
            if kind == b"IDAT":
                break
            found.setdefault(kind, file.read(min(length, LARGEST if kind == b"iCCP" else SMALL)))
    return found


def _curve(gamma: bytes) -> str | None:
    number = int.from_bytes(gamma, "big")
    if len(gamma) != 4 or number == 0 or abs(number - USUAL_GAMMA) <= USUAL_GAMMA // 100:
        return None
    try:
        return parse_transfer("linear" if number == 100000 else f"gamma:{100000 / number:.6g}").name
    except UsageError:  # (steeper than any curve that is meant)
        return None


def _primaries(places: bytes) -> Primaries | None:
    """Of white, red, green and blue, in this order."""
    if len(places) != 32:
        return None
    numbers = [int.from_bytes(places[k : k + 4], "big") / 100000 for k in range(0, 32, 4)]
    white, *colours = zip(numbers[::2], numbers[1::2], strict=True)
    try:
        return primaries_at([*colours, white])
    except ValueError:
        return None
