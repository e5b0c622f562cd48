"""What rows come to: means, extremes, and how scores depend on what makes a frame hard.

    pooled         mean and standard deviation of a score over all frames of all sequences
    global         the same of the means of the sequences, each of which counts once: what the field's script prints
    by_position    over the frames of a place between the key frames        by_sequence, by_sequence_and_position
    worst          the frames with the least PSNR, PSNR-255, SSIM, and the worst windows; `worst_pictures` the eight of
                   which there are pictures
    by_condition   in bins of a condition

Standard deviations are those of the population.  Frames that have no number (NaN) do not count: `count` says how many
there are.  Scores at the limit of 100 dB are counted in `perfect`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from interp.evaluate.row import Row
from interp.evaluate.worst import names_of, worst_of
from vid2ev.compare.pictures import HIGHEST_DB

SCORES = (
    "psnr", "ssim", "psnr_255", "ssim_255", "psnr_moving", "psnr_static", "moving", "patch_psnr", "patch_ssim",
)  # fmt: skip
LEAST = ("psnr", "ssim", "psnr_255", "ssim_255", "patch_psnr", "patch_ssim")
SHOWN = ("sequence", "group", "position", "psnr_255", "patch_psnr", "patch_x", "patch_y")  # of the worst
EDGES = {
    "motion_px": (0, 1, 2, 4, 8, 16, 32, 64),
    "motion_px_per_s": (0, 30, 60, 125, 250, 500, 1000, 2000),
    "events_per_px": (0, 0.25, 0.5, 1, 2, 4, 8, 16),
    "contrast": (0, 0.25, 0.5, 0.75, 1, 1.5, 2),
    "blur_px": (0, 0.5, 1, 2, 4, 8),
    "disparity_px": (0, 0.5, 1, 2, 4, 8, 16, 32),
    "offset_us": (-math.inf, -1000, -100, -10, 10, 100, 1000),
}


def summarised(rows: Sequence[Row], methods: Sequence[str], sets: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """The summary of each method, ready for JSON.

    sets   names of sequences of each data set; of several, `by_set` has each
    """
    return {name: _of_method([row for row in rows if row.method == name], sets) for name in methods}


def _of_method(rows: Sequence[Row], sets: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    several = {name: [row for row in rows if row.sequence in of] for name, of in sets.items()} if len(sets) > 1 else {}
    places: Callable[[Row], tuple[str, int]] = lambda row: (row.sequence, row.position)  # noqa: E731
    both: dict[str, dict[str, Any]] = {}
    for (sequence, position), of in _grouped(rows, places).items():
        both.setdefault(sequence, {})[str(position)] = means(of)
    return {
        "pooled": means(rows),
        "global": means_of_means(rows),
        "by_set": {name: {"pooled": means(of), "global": means_of_means(of)} for name, of in several.items()},
        "by_sequence": {name: means(of) for name, of in _grouped(rows, lambda row: row.sequence).items()},
        "by_position": {str(name): means(of) for name, of in _grouped(rows, lambda row: row.position).items()},
        "by_sequence_and_position": both,
        "worst": {name: _lowest(rows, name) for name in LEAST},
        "worst_pictures": [
            {name: getattr(row, name) for name in SHOWN} | {"files": names_of(row)} for row in worst_of(rows)
        ],
        "by_condition": {name: binned(rows, name, edges) for name, edges in EDGES.items()},
        "perfect": sum(row.psnr_255 >= HIGHEST_DB for row in rows),
    }


def means(rows: Iterable[Row]) -> dict[str, Any]:
    """Mean, standard deviation and number of each score."""
    listed = list(rows)
    return {"frames": len(listed)} | {name: _statistics([getattr(row, name) for row in listed]) for name in SCORES}


def means_of_means(rows: Iterable[Row]) -> dict[str, Any]:
    """The same of the means of the sequences."""
    sequences = [means(of) for of in _grouped(rows, lambda row: row.sequence).values()]
    return {"sequences": len(sequences)} | {
        name: _statistics([math.nan if each[name]["mean"] is None else each[name]["mean"] for each in sequences])
        for name in SCORES
    }


def binned(rows: Sequence[Row], condition: str, edges: Sequence[float]) -> list[dict[str, Any]]:
    """Means in bins [from, to) of a condition, the last open, of those with frames; what is not known is left out."""
    found = []
    for low, high in pairwise((*edges, math.inf)):
        within = [row for row in rows if low <= getattr(row, condition) < high]
        if within:
            ends = {"from": low if math.isfinite(low) else None, "to": high if math.isfinite(high) else None}
            mean = float(np.mean([getattr(row, condition) for row in within]))
            found.append(ends | {"mean": mean} | means(within))
    return found


def _statistics(values: Sequence[float]) -> dict[str, Any]:
    known = np.array([value for value in values if not math.isnan(value)], np.float64)
    if not known.size:
        return {"mean": None, "std": None, "min": None, "count": 0}
    return {"mean": float(known.mean()), "std": float(known.std()), "min": float(known.min()), "count": known.size}


def _lowest(rows: Sequence[Row], score: str) -> dict[str, Any] | None:
    known = [row for row in rows if not math.isnan(getattr(row, score))]
    if not known:
        return None
    row = min(known, key=lambda row: (getattr(row, score), row.sequence, row.group, row.position))
    place = {"sequence": row.sequence, "group": row.group, "position": row.position, score: getattr(row, score)}
    return place | ({"x": row.patch_x, "y": row.patch_y} if score == "patch_psnr" else {})


def _grouped(rows: Iterable[Row], key: Callable[[Row], Any]) -> dict[Any, list[Row]]:
    found: dict[Any, list[Row]] = {}
    for row in rows:
        found.setdefault(key(row), []).append(row)
    return found
