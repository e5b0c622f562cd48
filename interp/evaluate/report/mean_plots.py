"""Mean scores as plots: at each place in the gap, and against a condition."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any

from interp.evaluate.conditions import Condition
from interp.evaluate.report.blocks import Plot
from interp.evaluate.report.drawing import SOFT, WIDTH_IN, figure, legend, look, styles, svg_of
from interp.evaluate.report.numbers import SCORES
from interp.evaluate.report.overview import best_method, by_method
from interp.evaluate.row import Row
from interp.evaluate.tables import Bin, binned, by_position

WIDE = 20.0  # a condition's largest value over its smallest edge above 0, from which on its axis is logarithmic
NUMBERS_SHARE = 0.12  # of a panel's height, at its foot, for how many frames there are


def position_plot(rows: Sequence[Row]) -> str | None:
    """Mean scores at each place in the gap, or None where there is one place only."""
    if len({row.position for row in rows}) < 2:
        return None
    parts, multiple = by_method(rows), rows[0].multiple
    with look():
        made, panels = _two_panels()
        drawn = styles(list(parts), best_method(rows))
        for field, axes in panels.items():
            for method, part in parts.items():
                found = by_position(part, field)
                axes.plot(list(found), [mean.mean for mean in found.values()], **drawn[method])
            axes.set_xlabel(f"place in the gap, of {multiple}")
            axes.xaxis.get_major_locator().set_params(integer=True)
        legend(made, panels["psnr"], list(parts))
        return svg_of(made, f"position-{multiple}", "Scores at each place in the gap")


def condition_plot(rows: Sequence[Row], condition: Condition, edges: Sequence[float]) -> Plot | None:
    """Mean scores against a condition, and how many frames they are of; None without any."""
    caption = f"Mean score in bins of {condition.axis} [{condition.unit}]; below, how many frames are in each."
    parts, multiple = by_method(rows), rows[0].multiple
    found = {
        field: {method: binned(part, condition.field, field, edges) for method, part in parts.items()}
        for field in SCORES
    }
    if not any(any(bins.values()) for bins in found.values()):
        return None
    limited = False
    with look():
        made, panels = _two_panels()
        for field, axes in panels.items():
            for method, style in styles(list(parts), best_method(rows)).items():
                bins = found[field][method]
                axes.plot([one.at for one in bins], [one.score.mean for one in bins], **style)
            _scale(axes, edges, condition)
            limited |= _draw_limit(axes, condition)
            _count(axes, _fullest(found[field].values()))
        legend(made, panels["psnr"], list(parts))
        svg = svg_of(made, f"{condition.field}-{multiple}", f"Scores against {condition.title}")
    where = f" The line at {condition.limit:g} is where the paper's network ends." if limited else ""
    return Plot(svg, f"{caption}{where}")


def _two_panels() -> tuple[Any, dict[str, Any]]:
    made = figure(WIDTH_IN, 3.1)
    panels = dict(zip(SCORES, made.subplots(1, 2), strict=True))
    for field, axes in panels.items():
        axes.set_title(SCORES[field])
    return made, panels


def _scale(axes: Any, edges: Sequence[float], condition: Condition) -> None:
    axes.set_xlabel(f"{condition.axis} [{condition.unit}]")
    positive = [edge for edge in edges if edge > 0]
    if min(edges) >= 0 and positive and max(edges) / positive[0] >= WIDE:
        axes.set_xscale("symlog", linthresh=positive[0], linscale=0.5)
        axes.set_xlim(left=0)
        powers = range(math.floor(math.log10(positive[0])), math.ceil(math.log10(max(edges))) + 1)
        round_ones = (step * 10.0**power for power in powers for step in (1, 5))
        marks = [0.0, *(mark for mark in round_ones if positive[0] <= mark <= max(edges))]
        axes.set_xticks(marks, [f"{mark:g}" for mark in marks])


def _draw_limit(axes: Any, condition: Condition) -> bool:
    """Draw where the paper's network ends, if the axis reaches it; whether it does."""
    left, right = axes.get_xlim()
    reached = condition.limit is not None and left < condition.limit < right
    if reached:
        axes.axvline(condition.limit, color=SOFT, linewidth=0.8, linestyle=":")
        axes.annotate(
            f"paper: {condition.limit:g}", (condition.limit, 1), xycoords=("data", "axes fraction"), xytext=(0, 2),
            textcoords="offset points", fontsize=7, ha="center", va="bottom", color=SOFT,
        )  # fmt: skip
    return reached


def _fullest(of_methods: Iterable[Sequence[Bin]]) -> list[Bin]:
    """Of each bin, that of the method with the most frames there, as many as the table says."""
    found: dict[float, Bin] = {}
    for one in chain.from_iterable(of_methods):
        if one.low not in found or one.score.count > found[one.low].score.count:
            found[one.low] = one
    return list(found.values())


def _count(axes: Any, bins: Sequence[Bin]) -> None:
    """How many frames each mean is of, at the foot of the panel."""
    low, high = axes.get_ylim()
    axes.set_ylim(low - NUMBERS_SHARE * (high - low), high)
    for one in bins:
        axes.annotate(
            f"{one.score.count}", (one.at, 0), xycoords=("data", "axes fraction"), xytext=(0, 3), ha="center",
            textcoords="offset points", fontsize=7, color=SOFT,
        )  # fmt: skip
