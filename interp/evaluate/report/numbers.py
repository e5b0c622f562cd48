"""Numbers as people read them in tables, and which of a column is the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from interp.evaluate.report.blocks import Cell
from interp.evaluate.tables import Mean

SCORES = {"psnr": "PSNR [dB]", "ssim": "SSIM"}  # of the Time Lens protocol
NOTHING = "–"
PSNR_DIGITS, SSIM_DIGITS = 2, 3


def digits_of(field: str) -> int:
    """Digits after the point of a score [dB] or of an SSIM."""
    return SSIM_DIGITS if "ssim" in field else PSNR_DIGITS


def number(value: float, digits: int) -> str:
    """A number with so many digits after the point; a dash where there is none."""
    if math.isnan(value):
        return NOTHING
    return f"{value:.{digits}f}" if math.isfinite(value) else "∞"


def short(value: float) -> str:
    """A number as short as three digits allow."""
    if math.isnan(value):
        return NOTHING
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def spread(mean: Mean, digits: int) -> str:
    """Mean ± standard deviation, which one number does not have."""
    if math.isnan(mean.std) or mean.count == 1:
        return number(mean.mean, digits)
    return f"{number(mean.mean, digits)} ± {number(mean.std, digits)}"


def cells(values: Sequence[float], shown: Callable[[float], str]) -> tuple[Cell, ...]:
    """Cells of scores of which one is the best; those that look the same are so together."""
    texts = [shown(value) for value in values]
    known = [value for value in values if not math.isnan(value)]
    best = shown(max(known)) if len(known) > 1 else None
    return tuple(Cell(text, text == best) for text in texts)


def marked(columns: Iterable[Sequence[tuple[float, str]]]) -> list[tuple[Cell, ...]]:
    """Lines of cells from columns of (value, text), with the best of each column marked."""
    done = []
    for column in columns:
        known = [value for value, _ in column if not math.isnan(value)]
        best = max(known) if len(known) > 1 else math.nan
        done.append([Cell(text, value == best) for value, text in column])
    return list(zip(*done, strict=True))
