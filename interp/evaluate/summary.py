"""What rows come to (`tables.py`), ready for JSON; a report says the same numbers.

    pooled         mean, standard deviation, least and number of a score over all frames of all sequences
    global         mean and standard deviation of the means of the sequences, each of which counts once: what the
                   field's script prints
    by_position    over the frames of a place between the key frames        by_sequence, by_set
    worst          the frames with the least PSNR, PSNR-255, SSIM, and the worst windows; `worst_pictures` those of
                   which there are pictures
    by_condition   in bins [from, to) of a condition, the last with its upper end; the same for all methods

Standard deviations are those of the population.  Frames that have no number (NaN) do not count: `count` says how many
there are.  Scores at the limit of 100 dB are counted in `perfect`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from interp.evaluate.conditions import Condition, varying
from interp.evaluate.row import Row
from interp.evaluate.tables import Bin, Mean, binned, least, lowest, per_sequence, pooled, split
from interp.evaluate.worst import names_of, worst_of
from vid2ev.compare.pictures import HIGHEST_DB

SCORES = (
    "psnr", "ssim", "psnr_255", "ssim_255", "psnr_moving", "psnr_static", "moving", "patch_psnr", "patch_ssim",
)  # fmt: skip
LEAST = ("psnr", "ssim", "psnr_255", "ssim_255", "patch_psnr", "patch_ssim")
SHOWN = ("sequence", "group", "position", "psnr_255", "patch_psnr", "patch_x", "patch_y")  # of the worst


def summarised(rows: Sequence[Row], methods: Sequence[str], sets: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """The summary of each method.

    sets   names of sequences of each data set; of several, `by_set` has each
    """
    conditions = varying(rows)
    return {name: _of_method([row for row in rows if row.method == name], sets, conditions) for name in methods}


def _of_method(
    rows: Sequence[Row], sets: Mapping[str, Sequence[str]], conditions: Sequence[tuple[Condition, list[float]]]
) -> dict[str, Any]:
    several = {name: [row for row in rows if row.sequence in of] for name, of in sets.items()} if len(sets) > 1 else {}
    places = split(rows, lambda row: row.position)
    return {
        "pooled": _pooled(rows),
        "global": _global(rows),
        "by_set": {name: {"pooled": _pooled(of), "global": _global(of)} for name, of in several.items()},
        "by_sequence": {name: _pooled(of) for name, of in split(rows, lambda row: row.sequence).items()},
        "by_position": {str(position): _pooled(places[position]) for position in sorted(places)},
        "worst": {name: _lowest(rows, name) for name in LEAST},
        "worst_pictures": [
            {name: getattr(row, name) for name in SHOWN} | {"files": names_of(row)} for row in worst_of(rows)
        ],
        "by_condition": {
            condition.field: {name: _bins(binned(rows, condition.field, name, edges)) for name in SCORES}
            for condition, edges in conditions
        },
        "perfect": sum(row.psnr_255 >= HIGHEST_DB for row in rows),
    }


def _pooled(rows: Sequence[Row]) -> dict[str, Any]:
    scores = {name: _mean(pooled(rows, name)) | {"min": _known(least(rows, name))} for name in SCORES}
    return {"frames": len(rows)} | scores


def _global(rows: Sequence[Row]) -> dict[str, Any]:
    return {name: _mean(per_sequence(rows, name)) for name in SCORES}


def _mean(of: Mean) -> dict[str, Any]:
    return {"mean": _known(of.mean), "std": _known(of.std), "count": of.count}


def _bins(found: Sequence[Bin]) -> list[dict[str, Any]]:
    return [{"from": one.low, "to": one.high, "at": one.at} | _mean(one.score) for one in found]


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _lowest(rows: Sequence[Row], score: str) -> dict[str, Any] | None:
    row = lowest(rows, score)
    if row is None:
        return None
    place = {"sequence": row.sequence, "group": row.group, "position": row.position, score: getattr(row, score)}
    return place | ({"x": row.patch_x, "y": row.patch_y} if score == "patch_psnr" else {})
