"""Letters on pictures, in the font that comes with matplotlib."""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np

GROUND, INK, ACCENT = (16, 18, 24), (226, 228, 232), (240, 166, 70)  # of sheets: that of events, and what is on it
SIZE_PX = 12
STRIP_PX = SIZE_PX + 8  # the height of a line of letters


@lru_cache(maxsize=256)
def letters(text: str, size_px: int = SIZE_PX) -> np.ndarray:
    """How far pixels are covered by a line of text, float32 [size + below, w], 0 ... 1; its baseline is at `size`."""
    from matplotlib.font_manager import findfont, get_font

    below = size_px // 3  # what g and y need
    if not text.strip():
        return np.zeros((size_px + below, 0), np.float32)
    font = get_font(findfont("DejaVu Sans"))
    font.set_size(size_px, 72)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of letters that the font lacks: they become boxes
        font.set_text(" ".join(text.split()), 0)
        font.draw_glyphs_to_bitmap(antialiased=True)
    covered = np.array(font.get_image(), np.float32) / 255
    above = covered.shape[0] - round(font.get_descent() / 64)
    covered = np.pad(covered, ((max(0, size_px - above), below), (0, 0)))[max(0, above - size_px) :]
    return covered[: size_px + below]


def write(picture: np.ndarray, text: str, left: int, top: int, colour: tuple[int, int, int] = INK) -> None:
    """Write a line of text into a picture, uint8 [H, W, 3]; what is beyond its edges is cut off."""
    covered = letters(text)[: max(0, picture.shape[0] - top), : max(0, picture.shape[1] - left)]
    part = picture[top : top + covered.shape[0], left : left + covered.shape[1]]
    part[:] = np.rint(part + covered[..., None] * (np.array(colour) - part.astype(np.float32))).astype(np.uint8)


def strip(text: str, width: int, colour: tuple[int, int, int] = INK) -> np.ndarray:
    """A line of text on dark ground, uint8 [STRIP_PX, width, 3]."""
    made = np.full((STRIP_PX, width, 3), GROUND, np.uint8)
    write(made, text, 4, 2, colour)
    return made
