"""What a file is, by its content: names lie.

    picture   PNG, JPEG, TIFF, BMP, PNM, PFM, WebP, JPEG 2000, OpenEXR, Radiance HDR
    array     .npy
    arrays    .npz, a ZIP archive of .npy files
    video     everything else, and animated PNG and WebP

A file of JPEGs one after the other (Motion JPEG) begins like a JPEG; there the name decides, `.mjpg` or `.mjpeg`.

Sources: PNG section 5.2 and its `acTL`; RFC 9649 section 2.7 (WebP); TIFF 6.0 page 13; ITU-T T.81 B.1.1.3; Radiance
`filefmts`; OpenEXR file layout; numpy NEP 1.
"""

from __future__ import annotations

import re
import zipfile
from itertools import takewhile
from pathlib import Path
from typing import Literal

from vid2ev.errors import DataError
from vid2ev.untrusted import check_file, png_chunks

Kind = Literal["picture", "array", "arrays", "video"]

PICTURE_SUFFIXES = (
    ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pbm", ".pgm", ".ppm", ".pnm", ".pam", ".pfm", ".webp", ".jp2",
    ".exr", ".hdr", ".pic",
)  # fmt: skip
MOTION_JPEG_SUFFIXES = (".mjpg", ".mjpeg")

NUMPY = b"\x93NUMPY"
EXR = b"\x76\x2f\x31\x01"
PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
BMP = b"BM"
RADIANCE = (b"#?RADIANCE", b"#?RGBE")
PICTURES = (EXR, PNG, JPEG, *TIFF, BMP, b"\0\0\0\x0cjP  ", *RADIANCE)
ANIMATED = 0x02  # a flag of WebP
NETPBM = re.compile(rb"P[1-7Ff]\s")
HEAD = 4096


def recognise(path: Path) -> Kind:
    """What the file is.  Raises DataError if it cannot be opened."""
    head = head_of(path)
    if head.startswith(NUMPY):
        return "array"
    if head.startswith(b"PK\x03\x04") and _holds_arrays(path):
        return "arrays"
    if head.startswith(PNG) and is_animated_png(path):
        return "video"
    if head.startswith(JPEG) and path.suffix.lower() in MOTION_JPEG_SUFFIXES:
        return "video"
    webp = is_webp(head)
    if webp and head[12:16] == b"VP8X" and head[20:21] and head[20] & ANIMATED:
        return "video"
    return "picture" if webp or head.startswith(PICTURES) or NETPBM.match(head) else "video"


def is_webp(head: bytes) -> bool:
    """Whether a file that begins so is a WebP."""
    return head.startswith(b"RIFF") and head[8:12] == b"WEBP"


def head_of(path: Path) -> bytes:
    """The first bytes of a file.  Raises DataError."""
    check_file(path)
    try:
        with open(path, "rb") as file:
            return file.read(HEAD)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); leave it out, or get another copy") from error


def is_animated_png(path: Path) -> bool:
    """Whether a file is a PNG that says so before its pixels, behind a profile of any size."""
    with open(path, "rb") as file:
        kinds = (kind for kind, _, _ in png_chunks(file))
        return file.read(len(PNG)) == PNG and b"acTL" in takewhile(lambda kind: kind != b"IDAT", kinds)


def _holds_arrays(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except (OSError, ValueError, RuntimeError, zipfile.BadZipFile):
        return path.suffix.lower() == ".npz"


def pictures_in(folder: Path) -> list[Path]:
    """The files of a folder that are named as pictures are and are not hidden, in natural order."""
    named = [path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES and path.name[0] != "."]
    return sorted([path for path in named if not path.is_dir()], key=lambda path: natural(path.name))


def natural(name: str) -> list[tuple[int, str]]:
    """Sort key by which `frame2` comes before `frame10`."""
    parts = re.split(r"(\d+)", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts] + [(-2, name)]
