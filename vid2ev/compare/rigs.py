"""Two rigs beside each other: their event cameras, by name."""

from __future__ import annotations

from pathlib import Path

from vid2ev.errors import UsageError
from vid2ev.formats import of_only_camera
from vid2ev.recording.manifest import as_stated, read_manifest


def pairs(recording: str | Path, reference: str | Path) -> dict[str, tuple[Path, Path]]:
    """What to compare with what: the event cameras of two rigs by their names, or else the two themselves, as '', of a
    rig with one event camera that one.

    Raises UsageError for rigs whose event cameras have other names, or that have none.
    """
    one, other = Path(recording), Path(reference)
    if not (is_rig(one) and is_rig(other)):
        one, other = (of_only_camera(path) if is_rig(path) else path for path in (one, other))
        return {"": (one, other)}
    names, other_names = event_cameras(one), event_cameras(other)
    for rig, found in ((one, names), (other, other_names)):
        if not found:
            raise UsageError(f"{rig} has frame cameras alone, and events are compared; give a rig with event cameras")
    if names != other_names:
        raise UsageError(
            f"{one} has the event cameras {', '.join(names)}, {other} has {', '.join(other_names)};"
            " give two rigs with the same names, or two cameras"
        )
    return {name: (one / name, other / name) for name in names}


def is_rig(path: Path) -> bool:
    """Whether a folder is the recording of several cameras."""
    return (path / "manifest.json").is_file() and "cameras" in read_manifest(path)


def event_cameras(folder: Path) -> list[str]:
    """The names of a rig's event cameras."""
    with as_stated(folder / "manifest.json"):
        cameras = read_manifest(folder)["cameras"]
        return sorted(name for name, camera in cameras.items() if camera["kind"] != "cis")
