"""What the colour tags of a video mean.

Videos carry code points of Rec. ITU-T H.273 (tables 2, 3, 4) for their primaries, transfer curve and matrix, and a flag
for the range; 2 is "unspecified".  Luminance weights follow from the chromaticities of the primaries and the white
point (SMPTE RP 177); the matrices are those of table 4.
"""

from __future__ import annotations

from vid2ev.errors import DataError

IDENTITY, UNSPECIFIED, YCGCO = 0, 2, 8
FULL_RANGE = 2  # of the range flag: 0 unspecified, 1 limited, 2 full

# table 3; the curve of BT.709 is also that of BT.601 (6), xvYCC (11), BT.1361 (12) and BT.2020 (14, 15)
TRANSFERS = dict.fromkeys((1, 6, 11, 12, 14, 15), "bt709") | {
    4: "gamma:2.2",
    5: "gamma:2.8",
    7: "smpte240m",
    8: "linear",
    9: "log100",
    10: "log316",
    13: "srgb",
    16: "pq",
    17: "st428",
    18: "hlg",
}

# FFmpeg's names of codecs of pictures, not of cameras
PICTURES = ("apng", "bmp", "gif", "png", "tiff", "webp", "webp_anim")

# table 4: shares of red and blue in luma
MATRICES = {
    1: (0.2126, 0.0722),  # BT.709
    4: (0.30, 0.11),  # FCC
    5: (0.299, 0.114),  # BT.601, 625 lines
    6: (0.299, 0.114),  # BT.601, 525 lines
    7: (0.212, 0.087),  # SMPTE 240M
    9: (0.2627, 0.0593),  # BT.2020, non-constant luminance
}

# table 2: luminance of red, green, blue
BT709_WEIGHTS = (0.2126, 0.7152, 0.0722)
WEIGHTS = {
    1: BT709_WEIGHTS,
    5: (0.2220, 0.7067, 0.0713),  # BT.601, 625 lines
    6: (0.2124, 0.7011, 0.0865),  # BT.601, 525 lines
    7: (0.2124, 0.7011, 0.0865),  # SMPTE 240M, the same primaries
    9: (0.2627, 0.6780, 0.0593),  # BT.2020
    12: (0.2290, 0.6917, 0.0793),  # P3-D65, of telephones
}


def transfer_of(tag: int, asked: str, codec: str = "") -> str:
    """Name of the transfer curve: what was asked for, else the tag's, else sRGB of pictures that move, and BT.709."""
    return asked if asked != "auto" else TRANSFERS.get(tag, "srgb" if codec in PICTURES else "bt709")


def tag_of(curve: str) -> int:
    """The code of a transfer curve; that it is not specified where there is none."""
    return next((code for code, name in TRANSFERS.items() if name == curve), UNSPECIFIED)


def matrix_of(tag: int, width: int, height: int, path: object) -> tuple[float, float] | None:
    """Shares of red and blue in luma; None for Y'CgCo.  Raises DataError for matrices that are neither (ICtCp, ...).

    Untagged video is BT.709 if it is larger than television's standard definition, else BT.601, as players
    take it; so is video in Y'CbCr that is tagged as RGB, which cannot be.
    """
    if tag in (UNSPECIFIED, IDENTITY):
        return MATRICES[1] if width >= 1280 or height > 576 else MATRICES[6]
    if tag == YCGCO:
        return None
    if tag not in MATRICES:
        raise DataError(f"{path}: colour matrix {tag} of H.273 is not supported; convert the video to BT.709 first")
    return MATRICES[tag]


def is_full_range(tag: int, pixel_format: str) -> bool:
    """Whether codes run from 0 to full; untagged, RGB, grey and the `yuvj` formats do."""
    return tag == FULL_RANGE or (tag == 0 and pixel_format.startswith(("yuvj", "gray", "gbr")))
