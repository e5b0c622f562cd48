"""Numbers as people read them in tables, and which of a column is the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from interp.evaluate.report.blocks import Cell
from interp.evaluate.tables import Mean

SCORES = {"psnr": "PSNR [dB]", "ssim": "SSIM"}  # of the Time Lens protocol
NOTHING = "–"
PSNR_DIGITS, SSIM_DIGITS = 2, 3
FEW = range(3, 18)  # digits of numbers that are meant to be short


def digits_of(field: str) -> int:
    """Digits after the point of a score [dB] or of an SSIM."""
    return SSIM_DIGITS if "ssim" in field else PSNR_DIGITS


def number(value: float, digits: int) -> str:
    """A number with so many digits after the point; a dash where there is none."""
    if math.isnan(value):
        return NOTHING
    return f"{value:.{digits}f}" if math.isfinite(value) else "∞"


def short(value: float, among: Iterable[float] = ()) -> str:
    """A number as short as three digits allow, or as many more as tell it from the others of these."""
    if math.isnan(value):
        return NOTHING
    others = {other for other in among if other != value}
    digits = next((n for n in FEW if _of(value, n) not in {_of(other, n) for other in others}), FEW[-1])
    return _of(value, digits)


def _of(value: float, digits: int) -> str:
    return f"{value:,.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def spread(mean: Mean, digits: int) -> str:
    """Mean ± standard deviation, which one number does not have."""
    if math.isnan(mean.std) or mean.count == 1:
        return number(mean.mean, digits)
    return f"{number(mean.mean, digits)} ± {number(mean.std, digits)}"


def cells(means: Sequence[Mean], shown: Callable[[float], str]) -> tuple[Cell, ...]:
    """Cells of means of which one is the best, of those over the most frames; those that look the same are so
    together."""
    most = max((mean.count for mean in means), default=0)
    texts = [shown(mean.mean) for mean in means]
    known = [mean.mean for mean in means if mean.count == most and not math.isnan(mean.mean)]
    best = shown(max(known)) if len(known) > 1 else None
    return tuple(Cell(text, text == best and mean.count == most) for text, mean in zip(texts, means, strict=True))


def marked(columns: Iterable[Sequence[tuple[float, str]]], can_be: Sequence[bool]) -> list[tuple[Cell, ...]]:
    """Lines of cells from columns of (value, text), with the best of each column marked, of those that can be."""
    done = []
    for column in columns:
        known = [value for (value, _), can in zip(column, can_be, strict=True) if can and not math.isnan(value)]
        best = max(known) if len(known) > 1 else math.nan
        done.append([Cell(text, can and value == best) for (value, text), can in zip(column, can_be, strict=True)])
    return list(zip(*done, strict=True))
