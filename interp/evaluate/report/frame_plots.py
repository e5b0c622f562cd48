"""The scores of single frames as plots: how they spread in each sequence, and over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from interp.evaluate.naming import shortened
from interp.evaluate.report.blocks import Plot
from interp.evaluate.report.drawing import ACCENT, INK, SOFT, WIDTH_IN, figure, legend, look, styles, svg_of
from interp.evaluate.report.numbers import SCORES
from interp.evaluate.report.overview import best_method, by_method
from interp.evaluate.row import Row
from interp.evaluate.tables import split, values

ACROSS = 3  # panels beside each other
TITLE = 72  # letters above all of these
MOST_SEQUENCES = 8  # drawn over time: those in which scores change most
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def distribution_plot(rows: Sequence[Row]) -> str | None:
    """The spread of PSNR in each sequence, a panel for each method; None without any."""
    if not np.isfinite(values(rows, "psnr")).any():
        return None
    sequences, parts = list(dict.fromkeys(row.sequence for row in rows)), by_method(rows)
    across = min(ACROSS, len(parts))
    down = -(-len(parts) // across)
    best = best_method(rows)
    with look():
        made = figure(WIDTH_IN, 0.6 + down * (0.45 + 0.19 * len(sequences)))
        panels = made.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
        for axes in panels[len(parts) :]:
            axes.set_axis_off()
        for axes, (method, part) in zip(panels, parts.items(), strict=False):
            own = split(part, lambda row: row.sequence)
            for place, sequence in enumerate(sequences):
                _draw_spread(axes, place, values(own.get(sequence, []), "psnr"), ACCENT if method == best else SOFT)
            axes.set_title(shortened(method, TITLE // across))
            axes.set_yticks(range(len(sequences)), [shortened(sequence, 22) for sequence in sequences])
            axes.tick_params(axis="y", length=0)
            axes.grid(axis="y", visible=False)
        panels[0].set_ylim(len(sequences) - 0.5, -0.5)
        for axes in panels[max(0, len(parts) - across) : len(parts)]:
            axes.set_xlabel(SCORES["psnr"])
            axes.tick_params(labelbottom=True)
        return svg_of(made, f"spread-{rows[0].multiple}", "PSNR of the frames of each sequence, for each method")


def over_time_plot(rows: Sequence[Row]) -> Plot | None:
    """PSNR of each frame over time, a panel for each sequence, of many those in which it changes most; None where none
    has several frames."""
    parts = split((row for row in rows if np.isfinite(row.psnr)), lambda row: row.sequence)
    several = [name for name in parts if len({row.t_us for row in parts[name]}) > 1]
    widest = sorted(several, key=lambda name: -float(np.ptp(values(parts[name], "psnr"))))[:MOST_SEQUENCES]
    shown = [name for name in several if name in widest]
    if not shown:
        return None
    best = best_method(rows)
    with look():
        made = figure(WIDTH_IN, 0.5 + 1.4 * len(shown))
        panels = made.subplots(len(shown), 1, sharey=True, squeeze=False).ravel()
        for axes, name in zip(panels, shown, strict=True):
            own = by_method(parts[name])
            for method, style in styles(list(by_method(rows)), best).items():
                part = sorted(own.get(method, []), key=lambda row: row.t_us)
                line = style | {"marker": "", "linewidth": 1.4 if method == best else 0.7}
                axes.plot(values(part, "t_us") / 1e6, values(part, "psnr"), **line)
            axes.set_title(shortened(name, 80))
            axes.set_ylabel(SCORES["psnr"])
        panels[-1].set_xlabel("time [s]")
        legend(made, panels[0], list(by_method(rows)))
        svg = svg_of(made, f"time-{rows[0].multiple}", "PSNR of each frame over time")
    of = f", of the {len(shown)} of {len(several)} sequences in which it changes most"
    return Plot(svg, f"PSNR of each frame{of if len(shown) < len(several) else ''}.")


def _draw_spread(axes: Any, place: float, scores: np.ndarray, colour: str) -> None:
    scores = scores[np.isfinite(scores)]
    if not len(scores):
        return
    least, low, middle, high, most = np.quantile(scores, QUANTILES)
    axes.plot([least, most], [place, place], color=colour, linewidth=0.8)
    axes.plot([low, high], [place, place], color=colour, linewidth=5, solid_capstyle="butt")
    axes.plot([middle, middle], [place - 0.28, place + 0.28], color=INK, linewidth=1.2)
