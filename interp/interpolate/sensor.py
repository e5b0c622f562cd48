"""What events stand for: as the recording that they are of says, or as is asked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from interp.representation.dead_time import DeadTime
from interp.representation.event_counts import contrast_of
from vid2ev.recording.manifest import as_stated, read_manifest


@dataclass(frozen=True, slots=True)
class Sensor:
    """Of an event camera: what an OFF and an ON event stand for [nat], and how long a pixel is blind after each; None
    where nobody knows."""

    contrast: tuple[float, float] | None = None
    dead_time: DeadTime | None = None


def sensor_of(path: str | Path, contrast: tuple[float, float] | None, refractory_us: float | None) -> Sensor:
    """That of an event file or a recording's folder; what is asked goes before what the recording says.

    Raises UsageError for a refractory period that is none, DataError for a manifest that is none.
    """
    said = _said(Path(path))
    return Sensor(contrast or said.contrast, DeadTime.asked(refractory_us, said.dead_time))


def _said(path: Path) -> Sensor:
    manifest = path / "manifest.json" if path.is_dir() else path.with_name("manifest.json")
    if not manifest.exists() or not (path.is_dir() or path.stem == "events"):  # (others only lie beside it)
        return Sensor()
    with as_stated(manifest):
        numbers = (read_manifest(manifest).get("sensor") or {"parameters": {}})["parameters"]
        return Sensor(
            contrast_of(numbers) if "threshold_on" in numbers else None,
            DeadTime.of(numbers) if "refractory_us" in numbers else None,
        )
