"""The worst frames as pictures: truth, what was made of it, the error, and the worst patch of both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from interp.evaluate.figures.heat_map import error_codes
from interp.evaluate.figures.png import encoded
from interp.evaluate.figures.worst_patch import panel
from interp.evaluate.report.blocks import Block, Picture
from interp.evaluate.report.numbers import PSNR_DIGITS, SSIM_DIGITS, number
from interp.evaluate.row import Row

MOST, MOST_OF_ALL = 2, 8  # frames shown of each method, and of all if they are many: half a megabyte and more each


@dataclass(frozen=True, slots=True, eq=False)
class WorstFrame:
    """A frame to be looked at: its row, truth and rebuilt frame, R'G'B' uint8 [H, W, 3], and its map of SSIM [H, W],
    if it is to be shown, NaN where there is none."""

    row: Row
    truth: np.ndarray
    rebuilt: np.ndarray
    similarity: np.ndarray | None = None


def worst_blocks(worst: Sequence[WorstFrame]) -> Iterator[Block]:
    """A picture for each frame, of each method those that come first: one at least."""
    shown, methods = Counter[str](), {frame.row.method for frame in worst}
    most = min(MOST, max(1, MOST_OF_ALL // max(1, len(methods))))
    for frame in worst:
        row = frame.row
        shown[row.method] += 1
        if shown[row.method] > most:
            continue
        picture = panel(frame.truth, frame.rebuilt, (row.patch_x, row.patch_y), frame.similarity)
        rms = float(np.sqrt((error_codes(frame.truth, frame.rebuilt) ** 2).mean()))
        yield Picture(
            encoded(picture),
            f"{row.sequence}, {row.method}, gap {row.group}, place {row.position}/{row.multiple}:"
            f" PSNR-255 {number(row.psnr_255, PSNR_DIGITS)} dB, SSIM-255 {number(row.ssim_255, SSIM_DIGITS)},"
            f" error {rms:.1f} codes RMS; worst patch {number(row.patch_psnr, PSNR_DIGITS)} dB",
        )
