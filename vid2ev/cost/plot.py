"""Error against time as a picture: every setting, the front, and the one recommended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.compare.plots import lettered, save
from vid2ev.cost.front import Row
from vid2ev.cost.measure import Cost
from vid2ev.terminal import counted

COLOURS = {
    "light": "#1f77b4",
    "timing": "#2ca02c",
    "filter": "#9467bd",
    "effects": "#d62728",
    "frames": "#8c564b",
    "views": "#17becf",
    "size": "#7f7f7f",
    "several": "#e08a00",
    "": "black",
}
MEANINGS = {
    "light": "light between the frames",
    "timing": "times of events",
    "filter": "filter and logarithm",
    "effects": "effects of the sensor",
    "frames": "frame cameras",
    "views": "views",
    "size": "fewer pixels",
    "several": "several together",
}
LEAST = 1e-4  # less is drawn as nothing
RIM_PT = 1  # around a point
PLACES = [  # of a name beside its point [points of type], and which end of it is there; the best ones first
    *((8, up, "left") for up in (0, 7, -7)),
    *((-8, up, "right") for up in (0, 7, -7)),
    *(
        (right, up, end)
        for up in (11, -11, 20, -20, 30, -30)
        for right, end in ((0, "center"), (3, "left"), (-3, "right"))
    ),
]


@lettered()
def plot(cost: Cost, picture: Path) -> None:
    """Draw it into a PNG file, which is there as a whole or not at all; raises DataError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.5, 6), layout="constrained")
    axes = figure.add_subplot()
    rows = [row for row in cost.settings if row.errors.headline is not None]
    _scale(axes, cost, rows)
    _draw_front(axes, cost)
    for group in dict.fromkeys(row.rung.group for row in rows):
        here = [row for row in rows if row.rung.group == group]
        places = [row.time for row in here], [_error(row) for row in here]
        axes.scatter(*places, color=COLOURS[group], s=36, zorder=3, label=MEANINGS.get(group))
    _draw_recommended(axes, cost)
    figure.legend(loc="outside lower center", ncols=5, frameon=False, fontsize=8)
    label(axes, [(row.time, _error(row), row.rung.name, COLOURS[row.rung.group]) for row in rows])
    save(figure, picture)


def _scale(axes: Any, cost: Cost, rows: list[Row]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator

    seen = [_error(row) for row in rows if _error(row) >= LEAST] or [LEAST]
    least = 10.0 ** math.floor(math.log10(min(seen)))
    axes.set_yscale("symlog", linthresh=least, linscale=0.4)
    axes.set_ylim(-0.4 * least, 2 * max(seen))
    axes.set_xscale("log")
    times = [row.time for row in (*rows, cost.reference)]
    axes.set_xlim(0.8 * min(times), 1.6 * max(times))
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(FuncFormatter(lambda *_: ""))
    events = any(row.errors.distance is not None for row in rows)
    axes.set_ylabel("distance from the reference, vR" if events else "error of frames [LSB]")
    axes.set_xlabel(f"time, in multiples of how long the clip is ({counted(cost.threads, 'thread')})")
    entitle(axes, f"{Path(cost.clip).name}, {'x'.join(map(str, cost.size))}")
    axes.grid(alpha=0.25, which="major")
    axes.axvline(cost.reference.time, color="#999999", linestyle=":", linewidth=1)
    axes.annotate(
        "reference", (cost.reference.time, 1), xycoords=("data", "axes fraction"), xytext=(3, -4), fontsize=8,
        textcoords="offset points", rotation=90, va="top", color="#666666",
    )  # fmt: skip


def _draw_front(axes: Any, cost: Cost) -> None:
    ahead = [row for row in cost.front if row.errors.headline is not None]
    stairs(axes, [row.time for row in ahead], [_error(row) for row in ahead])


def _draw_recommended(axes: Any, cost: Cost) -> None:
    for name, limit in cost.budget.limits:
        if name == "time":
            axes.axvline(limit, color="#e08a00", linewidth=1, linestyle="--", zorder=0)
        if name == ("lsb" if cost.reference.errors.distance is None else "vR"):
            axes.axhline(limit, color="#e08a00", linewidth=1, linestyle="--", zorder=0)
    if (best := cost.recommended) is not None:
        label = f"recommended within {cost.budget.text}"
        axes.scatter(
            [best.time], [_error(best)], s=190, facecolors="none", edgecolors="#e08a00", linewidths=2, zorder=4,
            label=label,
        )  # fmt: skip


def entitle(axes: Any, title: str) -> None:
    """A title as it is written, which may be of files with $ in their names."""
    axes.set_title(title, loc="left").set_parse_math(False)


def stairs(axes: Any, x: Sequence[float], y: Sequence[float]) -> None:
    """A front: level from each point to the next."""
    axes.plot(np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1], color="#444444", linewidth=1, zorder=1)


def label(axes: Any, points: Sequence[tuple[float, float, str, str]]) -> None:
    """Names beside points (x, y, name, colour), each where it covers least of names, of what is scattered, and of
    lines."""
    from matplotlib.transforms import Bbox

    axes.figure.draw_without_rendering()
    taken: list[Any] = []
    for drawn in axes.collections:  # points, and the ring around the recommended one
        half = (math.sqrt(drawn.get_sizes()[0]) / 2 + RIM_PT) * axes.figure.dpi / 72
        taken += [Bbox([place - half, place + half]) for place in axes.transData.transform(drawn.get_offsets())]
    lines = [line.get_path().transformed(line.get_transform()) for line in axes.lines]

    def covers(box: Any) -> int:
        across = sum(line.intersects_bbox(box, filled=False) for line in lines)
        outside = not all(axes.bbox.contains(*corner) for corner in (box.min, box.max))
        return int(across + 10 * (outside + sum(box.overlaps(other) for other in taken)))

    for x, y, name, colour in points:
        text = axes.annotate(name, (x, y), (0, 0), textcoords="offset points", fontsize=8, color=colour, va="center")
        text.set_parse_math(False)

        def there(place: tuple[int, int, str], text: Any = text) -> Any:
            text.set(position=place[:2], ha=place[2])
            return text.get_window_extent()

        taken.append(there(min(PLACES, key=lambda place: covers(there(place)))))


def _error(row: Row) -> float:
    return row.errors.headline or 0.0
