"""Pictures put together: in lines and columns, larger or smaller, framed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from interp.evaluate.figures.lettering import ACCENT, GROUND
from vid2ev.errors import UsageError

GAP_PX = 4
FRAME_PX = 2
LONGEST = 8  # times the other side, that one is shown: of a line camera's picture it would be millions of pixels


def beside(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Pictures uint8 [H, W, 3] from left to right, with dark gaps; lower ones are filled up below."""
    height = max(picture.shape[0] for picture in pictures)
    gap = np.full((height, GAP_PX, 3), GROUND, np.uint8)
    return np.concatenate([part for one in pictures for part in (gap, filled(one, height, one.shape[1]))][1:], 1)


def below(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Pictures from top to bottom, likewise; narrower ones are filled up on the right."""
    width = max(picture.shape[1] for picture in pictures)
    gap = np.full((GAP_PX, width, 3), GROUND, np.uint8)
    return np.concatenate([part for one in pictures for part in (gap, filled(one, one.shape[0], width))][1:], 0)


def titled(picture: np.ndarray, title: np.ndarray) -> np.ndarray:
    """A picture with a strip of letters of its width above it."""
    return np.concatenate([title, picture])


def resized(picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """A picture [H, W, 3] or map [H, W] of another size: means where it gets smaller, blocks where it gets larger."""
    import cv2

    smaller = width < picture.shape[1] or height < picture.shape[0]
    how = cv2.INTER_AREA if smaller else cv2.INTER_NEAREST
    return cv2.resize(np.ascontiguousarray(picture), (width, height), interpolation=how)


def in_proportion(side: int, other: int, other_shown: int) -> int:
    """How long a side of a picture is shown, whose other side is shown so long; slivers are shown wider than they
    are."""
    return min(max(1, round(side * other_shown / other)), LONGEST * other_shown)


def framed(picture: np.ndarray, box: tuple[int, int, int, int], width: int, height: int) -> np.ndarray:
    """A picture of another size, with a thin frame around what was in a box (left, top, width, height) of it."""
    made = resized(picture, width, height).copy()
    across, down = width / picture.shape[1], height / picture.shape[0]
    left, right = (round(x * across) for x in (box[0], box[0] + box[2]))
    top, bottom = (round(y * down) for y in (box[1], box[1] + box[3]))
    inside = made[top + FRAME_PX : bottom - FRAME_PX, left + FRAME_PX : right - FRAME_PX].copy()
    made[top:bottom, left:right] = ACCENT
    made[top + FRAME_PX : bottom - FRAME_PX, left + FRAME_PX : right - FRAME_PX] = inside
    return made


def cut(picture: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    """The pixels in a box (left, top, width, height).  Raises UsageError where it lies outside."""
    left, top, width, height = box
    high, wide = picture.shape[:2]
    if not (0 <= left < left + width <= wide and 0 <= top < top + height <= high):
        raise UsageError(f"patch {left},{top},{width}x{height}: expected one within {wide}x{high} pixels")
    return picture[top : top + height, left : left + width]


def check_pictures(**pictures: np.ndarray) -> None:
    """Raises UsageError for what is no uint8 [H, W, 3], or not of the size of the first."""
    first = next(iter(pictures.values())).shape
    for name, picture in pictures.items():
        if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape != (*first[:2], 3):
            raise UsageError(
                f"{name}: {picture.dtype} {list(picture.shape)}; expected uint8 pictures of one size, [H, W, 3]"
            )


def filled(picture: np.ndarray, height: int, width: int) -> np.ndarray:
    """A picture with dark ground below and on its right, up to a size."""
    made = np.full((height, width, 3), GROUND, np.uint8)
    made[: picture.shape[0], : picture.shape[1]] = picture
    return made
