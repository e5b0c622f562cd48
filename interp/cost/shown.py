"""What was measured, for people: a table, and a picture of how good frames are against what one takes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from interp.cost.measure import Rebuilding, Row
from vid2ev.compare.plots import lettered, save
from vid2ev.cost.plot import entitle, label, stairs
from vid2ev.cost.table import columns
from vid2ev.terminal import counted

COLOURS = {
    "closed forms": "#1f77b4",
    "networks": "#d62728",
    "precision": "#2ca02c",
    "compiled": "#9467bd",
    "tiles": "#8c564b",
    "motion": "#7f7f7f",
}


def table(found: Rebuilding) -> str:
    """The table, and which way to take."""
    best, front = found.recommended, found.front
    head = ["", "way", "PSNR, dB", "SSIM", *(f"{width}x{height}" for width, height in found.sizes), "interpolate ..."]
    lines = [head]
    for row in found.rows:
        mark = ">" if row is best else "*" if row in front else ""
        times = [f"{row.time(size):.3g}" for size in found.sizes]
        lines.append([mark, row.way.name, _figure(row.psnr, 2), _figure(row.ssim, 4), *times, _asked(row)])
    width, height = found.sizes[0]
    gaps, threads = counted(found.gaps, "gap"), counted(found.threads, "thread")
    of = f"{found.source}, {found.sequence}, the first of {found.first_of}" if found.first_of > 1 else found.source
    said = f"{of}: {gaps}, x{found.multiple}, scored at {width}x{height}; ms per frame, {threads}"
    took = best.time(found.sizes[0])
    recommended = f"as good as the best, and fastest: {best.way.name} ({best.way.asked}), {took:.3g} ms per frame"
    return "\n".join([said, "", *columns(lines), "", recommended])


@lettered()
def plot(found: Rebuilding, picture: Path) -> None:
    """Draw it into a PNG file, which is there as a whole or not at all; raises DataError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 6), layout="constrained")
    axes = figure.add_subplot()
    rows = [row for row in found.rows if row.psnr is not None]
    for group in dict.fromkeys(row.way.group for row in rows):
        here = [_place(found, row) for row in rows if row.way.group == group]
        x, y = zip(*here, strict=True)
        axes.scatter(x, y, color=COLOURS[group], s=36, zorder=3, label=group)
    x, y = zip(*(_place(found, row) for row in found.front), strict=True)
    stairs(axes, x, y)
    x_best, y_best = _place(found, found.recommended)
    axes.scatter(
        [x_best], [y_best], s=190, facecolors="none", edgecolors="#e08a00", linewidths=2, zorder=4,
        label="as good as the best, and fastest",
    )  # fmt: skip
    _frame(axes, found, rows)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    label(axes, [(*_place(found, row), _short(row), COLOURS[row.way.group]) for row in rows])
    save(figure, picture)


def _frame(axes: Any, found: Rebuilding, rows: list[Row]) -> None:
    width, height = found.sizes[0]
    times = [row.time(found.sizes[0]) for row in rows]
    axes.set_xscale("log")
    axes.set_xlim(0.7 * min(times), 3 * max(times))
    axes.margins(y=0.12)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel(f"ms per frame of {width}x{height} ({found.device}, {counted(found.threads, 'thread')})")
    axes.set_ylabel("PSNR [dB]")
    entitle(axes, f"{Path(found.source).name}, x{found.multiple}")
    axes.grid(alpha=0.25, which="major")


def _place(found: Rebuilding, row: Row) -> tuple[float, float]:
    return row.time(found.sizes[0]), row.psnr or 0.0


def _short(row: Row) -> str:
    """A name for a plot: of what is done with a network, that alone."""
    return row.way.name.partition(", ")[2] or row.way.name


def _asked(row: Row) -> str:
    if row.way.asked:
        return row.way.asked
    return "(for comparison)" if row.way.scored else "(untrained: its time alone)"


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
