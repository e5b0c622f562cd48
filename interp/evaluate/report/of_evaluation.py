"""The report of an evaluation, of what is in its folder: rows, summary and the pictures of worst frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from interp.evaluate.protocol import Protocol
from interp.evaluate.remarks import left_out, remarks
from interp.evaluate.report import About, WorstFrame, write_report
from interp.evaluate.report.worst import MOST
from interp.evaluate.row import Row
from interp.evaluate.tables import split
from interp.evaluate.worst import names_of, worst_of
from vid2ev.compare.pictures import RADIUS_PX, moments
from vid2ev.recording.exposures import read_codes
from vid2ev.recording.manifest import versions

FILMS = ("video", "scene")
OF_SENSOR = ("name", "seed", "parameters")  # beside options of the films that it looks at (`Simulated.describe`)
SIMULATED = (*FILMS, "own")  # sequences whose events are of light that passes through the truth
FACTS = {
    "kind": "kind", "size": "pixels", "event_size": "of events", "frames": "frames", "rate_hz": "per second",
    "groups": "gaps scored",
}  # fmt: skip


def write_pages(folder: Path, rows: Sequence[Row], summary: Mapping[str, Any]) -> None:
    """Write the report into the folder; raises DataError."""
    write_report(folder, rows, about(summary), worst_frames(folder, rows))


def about(summary: Mapping[str, Any]) -> About:
    """What a summary says besides scores."""
    sequences = summary["sequences"]
    return {
        "settings": _settings(summary),
        "sequences": {name: {title: _fact(of[key]) for key, title in FACTS.items()} for name, of in sequences.items()},
        "sets": summary["sets"],
        "not_scored": left_out(summary),
        "remarks": remarks(summary),
        "versions": versions(("torch",)),
        "events_from_truth": [name for name, of in sequences.items() if of["kind"] in SIMULATED],
    }


def worst_frames(folder: Path, rows: Sequence[Row]) -> list[WorstFrame]:
    """The worst frames of each method, as many as are shown, the worst first; those without pictures left out."""
    worst = [row for part in split(rows, lambda row: row.method).values() for row in worst_of(part, MOST)]
    return [_worst(folder, row) for row in worst if all((folder / name).exists() for name in names_of(row).values())]


def _worst(folder: Path, row: Row) -> WorstFrame:
    names = names_of(row)
    made, true = (read_codes(folder / names[name]) for name in ("made", "truth"))
    found = moments(made, true)
    similarity = None if found is None else np.pad(found.ssim_map(), RADIUS_PX, constant_values=np.nan)
    return WorstFrame(row, true, made, similarity)


def _settings(summary: Mapping[str, Any]) -> dict[str, object]:
    protocol, sensor = Protocol(**summary["protocol"]), summary["sensor"]
    settings = {
        "frames skipped between key frames": protocol.skip,
        "frames rebuilt between them": protocol.insert,
        "times of these": "of the frames" if protocol.own_times else "even",
        "codes of 8 bits": {"round": "rounded", "truncate": "truncated"}[protocol.rounding],
        "gaps of each sequence": summary["limit"] or "all",
    }
    weights = {name: of["weights_sha256"] for name, of in summary["identities"].items() if "weights_sha256" in of}
    settings |= {f"weights of {name} (SHA-256)": digest for name, digest in weights.items()}
    if any(of["kind"] in FILMS for of in summary["sequences"].values()):
        settings["event camera"] = f"{sensor['name']}, seed {sensor['seed']}"
        settings["its parameters"] = [
            f"{name} {_parameter(value)}" for name, value in sensor["parameters"].items() if value != []
        ]
        if edits := [f"{name} {_fact(value)}" for name, value in sensor.items() if name not in OF_SENSOR]:
            settings["how films are read"] = edits
    return settings


def _parameter(value: object) -> object:
    """As --set takes it, but for digits."""
    return f"[{', '.join(f'{each:g}' for each in value)}]" if isinstance(value, list) else _fact(value)


def _fact(value: object) -> object:
    if isinstance(value, float):
        return f"{value:g}"
    return "×".join(map(str, value)) if isinstance(value, list | tuple) else value
