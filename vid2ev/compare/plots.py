"""A comparison as a picture: where events are too many or missing, how late they are, and when it goes wrong."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vid2ev.compare.comparison import Comparison
from vid2ev.recording.disk import whole_file, writing

BARS = 101  # of the distribution of timing errors, at most


def plot(comparison: Comparison, picture: Path) -> None:
    """Draw a comparison into a PNG file, which is there as a whole or not at all; raises DataError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 9), layout="constrained")
    panels = figure.subplot_mosaic([["map", "timing"], ["time", "time"]], height_ratios=[2, 1])
    draw_map(figure, panels["map"], comparison)
    draw_timing(panels["timing"], comparison)
    _draw_time(panels["time"], comparison)
    save(figure, picture)


@contextmanager
def lettered() -> Iterator[None]:
    """Letters of names that the font lacks are boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")
        yield


def save(figure: Any, picture: Path) -> None:
    """Write a figure as a PNG file, which is there as a whole or not at all; raises DataError."""
    with writing(picture):
        picture.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(picture) as file:
            figure.savefig(file, format="png", dpi=100, metadata={"Software": None})


def draw_map(figure: Any, axes: Any, comparison: Comparison) -> None:
    """Draw how many more events each pixel has than that of the reference."""
    from matplotlib.ticker import MaxNLocator

    difference = comparison.difference
    most = max(float(np.quantile(np.abs(difference), 0.999)), 1.0)
    image = axes.imshow(difference, cmap="RdBu_r", vmin=-most, vmax=most, interpolation="nearest")
    figure.colorbar(image, ax=axes, shrink=0.7, label="events more (red) or fewer (blue) than the reference")
    axes.set_title("events per pixel", loc="left")
    for axis in (axes.xaxis, axes.yaxis):  # (between pixels there is nothing to count, and little room where few are)
        axis.set_major_locator(MaxNLocator(nbins=5, integer=True, min_n_ticks=1))


def draw_timing(axes: Any, comparison: Comparison) -> None:
    """Draw how many pairs have which error of time."""
    window_us, errors = comparison.window_us, comparison.timing_errors
    axes.set_title("timing error of the pairs", loc="left")
    axes.set_xlabel("A after the reference [us]")
    axes.set_ylabel("pairs")
    if not comparison.matched:
        return
    error_us = np.arange(1 - window_us, window_us)
    reach_us = max(int(np.abs(error_us[errors > 0]).max()), BARS // 2)
    axes.hist(error_us, _edges_us(reach_us), weights=errors, color="#444444", log=True)


def _edges_us(reach_us: int) -> np.ndarray:
    """Edges of bars up to an error at least: each has as many whole microseconds, and one has 0 in its middle."""
    width_us = -(-(2 * reach_us + 1) // BARS) // 2 * 2 + 1
    beside = -(-(reach_us - width_us // 2) // width_us)
    return width_us * (np.arange(-beside, beside + 2) - 0.5)


def _draw_time(axes: Any, comparison: Comparison) -> None:
    squared, events = comparison.by_time
    first_us, last_us = comparison.span_us
    edges_s = np.linspace(0, (last_us + 1 - first_us) / 1e6, len(events) + 1)
    tau_us = next(iter(comparison.distances))
    axes.stairs(2 * squared / np.maximum(events, 1), edges_s, color="black")
    axes.axhline(comparison.distance, color="#e08a00", linewidth=1)
    axes.set_title(f"distance over time, tau {tau_us} us; the line is that of all", loc="left")
    axes.set_xlabel(f"time after {first_us} us [s]")
    axes.set_ylabel("distance")
    axes.set_ylim(bottom=0)
