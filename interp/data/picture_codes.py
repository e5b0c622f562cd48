"""Pictures of others as codes of 8 bits: frames of recordings and what was made of them are read the same way."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vid2ev.errors import DataError
from vid2ev.light.picture_files import decoded, white_in


def codes_in(path: Path) -> np.ndarray | None:
    """The codes of a picture, red, green, blue, uint8 [H, W, 3], others than of 8 bits to the nearest; None for none.

    Raises DataError for pixels that are no such codes, and for a picture that claims more memory than it may.
    """
    import cv2

    picture = next(iter(decoded(path, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)), None)
    if picture is None:
        return None
    white = white_in(path) or (65535 if picture.dtype == np.uint16 else 255)
    if white != 255 and picture.dtype.kind == "u":
        picture = np.rint(picture * 255.0 / white).clip(0, 255).astype(np.uint8)
    if picture.dtype != np.uint8:
        raise DataError(f"{path}: {picture.dtype} pixels, expected codes of 8 or 16 bits")
    return picture[..., ::-1]
