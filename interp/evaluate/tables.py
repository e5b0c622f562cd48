"""Scores of many frames as few numbers.

    pooled         mean +- standard deviation of the population, over all frames
    per sequence   the same over the means of the sequences ("global" in the Time Lens toolbox)

NaN is left out everywhere; what nothing is left of is NaN.  Endless scores (a PSNR without any error) make endless
means.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from interp.evaluate.row import Row

LEAST_VARIED = 0.1  # by how much of its largest value a condition has to vary
MOST_VALUES = 8  # different values of a condition up to which each is a bin of its own
MOST_BINS = 8  # that even bins are meant to be
DECADES = 2  # below the largest value that bins of a wide condition reach; the first one has all that is less
STEPS = (1, 2, 5)

Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True, slots=True)
class Mean:
    """Mean and population standard deviation of `count` numbers; NaN of none."""

    mean: float
    std: float
    count: int


@dataclass(frozen=True, slots=True)
class Bin:
    """The scores of the frames whose condition is from `low` up to `high`, that excluded; `at` is its mean there."""

    low: float
    high: float
    at: float
    score: Mean


def mean_of(numbers: Iterable[float]) -> Mean:
    """Mean and population standard deviation of those that are not NaN."""
    known = np.array([number for number in numbers if not math.isnan(number)], np.float64)
    if not len(known):
        return Mean(math.nan, math.nan, 0)
    std = float(known.std()) if np.isfinite(known).all() else math.nan
    return Mean(float(known.mean()), std, len(known))


def values(rows: Iterable[Row], field: str) -> np.ndarray:
    """A column, float64 [rows]."""
    return np.array([getattr(row, field) for row in rows], np.float64)


def split(rows: Iterable[Row], key: Callable[[Row], Key]) -> dict[Key, list[Row]]:
    """Rows by a key, in the order in which keys first come."""
    parts: dict[Key, list[Row]] = {}
    for row in rows:
        parts.setdefault(key(row), []).append(row)
    return parts


def pooled(rows: Iterable[Row], field: str) -> Mean:
    """Mean +- std over all frames."""
    return mean_of(getattr(row, field) for row in rows)


def per_sequence(rows: Iterable[Row], field: str) -> Mean:
    """Mean +- std of the means of the sequences."""
    return mean_of(pooled(part, field).mean for part in split(rows, lambda row: row.sequence).values())


def by_position(rows: Iterable[Row], field: str) -> dict[int, Mean]:
    """Mean +- std for each place in the gap, in order."""
    parts = split(rows, lambda row: row.position)
    return {position: pooled(parts[position], field) for position in sorted(parts)}


def lowest(rows: Iterable[Row], field: str) -> Row | None:
    """The row of the lowest score, the first of several; None if no score is known."""
    known = [row for row in rows if not math.isnan(getattr(row, field))]
    return min(known, key=lambda row: getattr(row, field), default=None)


def least(rows: Iterable[Row], field: str) -> float:
    """The lowest score: of all frames, or of all 99x99 windows of all frames for `patch_psnr` and `patch_ssim`."""
    found = lowest(rows, field)
    return math.nan if found is None else float(getattr(found, field))


def edges_of(condition: np.ndarray) -> list[float]:
    """Edges of bins for the values of a condition; none where it is not known or hardly varies.

    Few different values are a bin each.  What is never negative and spreads over more than a decade gets edges of
    1, 2, 5, 10 ...; other values even edges at round numbers.
    """
    known = np.unique(condition[np.isfinite(condition)])
    if len(known) < 2:
        return []
    low, high = float(known[0]), float(known[-1])
    if high - low < LEAST_VARIED * max(abs(low), abs(high)):
        return []
    if len(known) <= MOST_VALUES:
        return [*map(float, known), high]
    if low >= 0 and low < high / 10:
        top = math.ceil(math.log10(high))
        rounds = [step * 10.0**power for power in range(top - DECADES - 1, top + 1) for step in STEPS]
        inner = [edge for edge in rounds if max(low, high / 10**DECADES) < edge < high]
        return [0.0, *inner, min(edge for edge in rounds if edge >= high)]
    step = _round_up((high - low) / MOST_BINS)
    first, last = math.floor(low / step), math.ceil(high / step)
    return [float(f"{number * step:.12g}") for number in range(first, last + 1)]


def binned(rows: Sequence[Row], condition: str, field: str, edges: Sequence[float]) -> list[Bin]:
    """The mean score in each bin [edge, next edge), the last with its upper edge; those without scores left out."""
    places, scores = values(rows, condition), values(rows, field)
    known = ~np.isnan(places) & ~np.isnan(scores)
    if not known.any() or len(edges) < 2:
        return []
    places, scores = places[known], scores[known]
    inside = (places >= edges[0]) & (places <= edges[-1])
    numbers = np.where(inside, np.searchsorted(edges[1:-1], places, side="right"), -1)
    return [
        Bin(edges[k], edges[k + 1], float(places[numbers == k].mean()), mean_of(scores[numbers == k].tolist()))
        for k in range(len(edges) - 1)
        if (numbers == k).any()
    ]


def breaks_at(bins: Sequence[Bin], drop: float) -> Bin | None:
    """The first bin whose mean is more than `drop` below that of the lowest bin; None if there is none."""
    return next((one for one in bins if one.score.mean < bins[0].score.mean - drop), None)


def _round_up(step: float) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(nice * power for nice in (*STEPS, 10) if nice * power >= step * (1 - 1e-9))
