"""Letters on pictures, in the font that comes with matplotlib."""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np

from interp.evaluate.naming import shortened

GROUND, INK, ACCENT = (16, 18, 24), (226, 228, 232), (240, 166, 70)  # of sheets: that of events, and what is on it
SIZE_PX = 12
BELOW_PX = SIZE_PX // 3  # what g and y need
STRIP_PX = SIZE_PX + 8  # the height of a line of letters
INSET_PX = 4  # of letters on it


@lru_cache(maxsize=256)
def letters(text: str) -> np.ndarray:
    """How far pixels are covered by a line of text, float32 [SIZE_PX + BELOW_PX, w], 0 ... 1; its baseline is at the
    former."""
    from matplotlib.font_manager import findfont, get_font

    if not text.strip():
        return np.zeros((SIZE_PX + BELOW_PX, 0), np.float32)
    font = get_font(findfont("DejaVu Sans"))
    font.set_size(SIZE_PX, 72)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of letters that the font lacks: they become boxes
        font.set_text(" ".join(text.split()), 0)
        font.draw_glyphs_to_bitmap(antialiased=True)
    covered = np.array(font.get_image(), np.float32) / 255
    above = covered.shape[0] - round(font.get_descent() / 64)
    covered = np.pad(covered, ((max(0, SIZE_PX - above), BELOW_PX), (0, 0)))[max(0, above - SIZE_PX) :]
    return covered[: SIZE_PX + BELOW_PX]


def write(picture: np.ndarray, text: str, left: int, top: int, colour: tuple[int, int, int] = INK) -> None:
    """Write a line of text into a picture, uint8 [H, W, 3]; what is beyond its edges is cut off."""
    covered = letters(text)[: max(0, picture.shape[0] - top), : max(0, picture.shape[1] - left)]
    part = picture[top : top + covered.shape[0], left : left + covered.shape[1]]
    part[:] = np.rint(part + covered[..., None] * (np.array(colour) - part.astype(np.float32))).astype(np.uint8)


def strip(text: str, width: int) -> np.ndarray:
    """A line of text on dark ground, uint8 [STRIP_PX, width, 3], without its middle where it is too long."""
    made = np.full((STRIP_PX, width, 3), GROUND, np.uint8)
    fitting = (shortened(text, count) for count in range(len(text), 1, -1))
    write(made, next((each for each in fitting if letters(each).shape[1] <= width - INSET_PX), text), INSET_PX, 2)
    return made
