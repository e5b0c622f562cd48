"""What was measured as a file for programs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vid2ev.recording.destination import check_new
from vid2ev.recording.disk import whole_file, writing
from vid2ev.sources import short_name


@dataclass(frozen=True)
class Findings:
    """What was measured: ready for JSON, as text for people, and what draws it into a PNG file; and why nothing is
    within a budget that was asked for, if so."""

    described: Mapping[str, Any]
    text: str
    draw: Callable[[Path], None]
    refusal: str | None = None


def check(name: str | None, source: str, overwrite: bool, kind: str = "cost") -> tuple[Path, Path]:
    """The places of the JSON and the PNG file; raises UsageError where one is taken."""
    stem = name or f"{short_name(source)}_{kind}"
    places = Path(f"{stem}.json"), Path(f"{stem}.png")
    for place in places:
        check_new(place, overwrite)
    return places


def store(described: Mapping[str, Any], place: Path) -> None:
    """Write the JSON file, which is there as a whole or not at all; raises DataError."""
    with writing(place):
        place.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(place) as file:
            file.write(f"{json.dumps(described, indent=2, allow_nan=False)}\n".encode())
