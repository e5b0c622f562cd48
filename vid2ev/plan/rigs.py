"""Two rigs beside each other: their event cameras, by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.plan.recordings import Compared, compare_recordings
from vid2ev.recording.manifest import read_manifest


def compare_rigs(recording: Path, reference: Path, **options: Any) -> dict[str, Compared]:
    """Compare the event cameras of two rigs by their names; raises as `compare_recordings`, and UsageError for rigs
    whose event cameras have other names."""
    ones, others = event_cameras(recording), event_cameras(reference)
    if ones != others:
        raise UsageError(
            f"{recording} has the event cameras {', '.join(ones) or '(none)'}, {reference} has"
            f" {', '.join(others) or '(none)'}; give two rigs with the same names, or two cameras"
        )
    return {name: compare_recordings(recording / name, reference / name, **options) for name in ones}


def is_rig(path: Path) -> bool:
    """Whether a folder is the recording of several cameras."""
    return path.is_dir() and not any(path.glob("events*")) and any(path.glob("*/manifest.json"))


def event_cameras(folder: Path) -> list[str]:
    """The names of a rig's event cameras."""
    manifests = sorted(folder.glob("*/manifest.json"))
    return [path.parent.name for path in manifests if read_manifest(path.parent)["sensor"]["kind"] != "cis"]
