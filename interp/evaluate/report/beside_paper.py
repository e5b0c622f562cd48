"""Own numbers in the form of the paper's Tables II and III, with what is published beside them."""

from __future__ import annotations

from collections.abc import Sequence

from interp.evaluate.published import TABLE_II, Published, of_gap
from interp.evaluate.report.blocks import Cell, Line, Table
from interp.evaluate.report.numbers import PSNR_DIGITS, SSIM_DIGITS, number, spread
from interp.evaluate.report.overview import by_method
from interp.evaluate.row import Row
from interp.evaluate.tables import least, pooled
from vid2ev.terminal import counted

PUBLISHED = "published, other data"
FORM = ("mean", "least frame", "least patch (99×99)", "standard deviation")


def quality_table(rows: Sequence[Row]) -> Table:
    """The form of Table II, a line for each method: of SSIM and PSNR the mean, the least and the deviation."""
    lines = []
    for method, part in by_method(rows).items():
        numbers = []
        for score, digits in (("ssim", SSIM_DIGITS), ("psnr", PSNR_DIGITS)):
            mean = pooled(part, f"{score}_255")
            found = (mean.mean, least(part, f"{score}_255"), least(part, f"patch_{score}"), mean.std)
            numbers += [number(value, digits) for value in found]
        lines.append(Line(method, tuple(map(Cell, numbers))))
    for quoted in TABLE_II:
        cells = tuple(map(Cell, (*quoted.ssim, *quoted.psnr)))
        lines.append(Line(f"{quoted.data} ({PUBLISHED})", cells, published=True))
    return Table(
        ("", *(f"SSIM, {name}" for name in FORM), *(f"PSNR, {name}" for name in FORM)),
        tuple(lines),
        "In the form of the paper's Table II",
        "Own scores are against 255; the paper does not say against what its own are.",
    )


def comparison_table(rows: Sequence[Row]) -> Table:
    """The form of Table III: mean ± standard deviation of all frames, by the Time Lens protocol."""
    lines = []
    for method, part in by_method(rows).items():
        ssim, psnr = pooled(part, "ssim"), pooled(part, "psnr")
        lines.append(
            Line(method, (Cell("this evaluation"), Cell(spread(ssim, SSIM_DIGITS)), Cell(spread(psnr, PSNR_DIGITS))))
        )
    skipped = rows[0].multiple - 1
    lines += [_quoted(row) for row in of_gap(skipped)]
    return Table(
        ("method", "data", "SSIM", "PSNR"),
        tuple(lines),
        "In the form of the paper's Table III",
        f"{counted(skipped, 'frame')} skipped. Quoted rows are of other recordings and cameras, those of GoPro by a"
        " PSNR that may be another; they say what kind of number to expect, and nothing about which method is better.",
        words=2,
    )


def _quoted(row: Published) -> Line:
    return Line(row.method, (Cell(f"{row.data} ({PUBLISHED})"), Cell(row.ssim), Cell(row.psnr)), published=True)
