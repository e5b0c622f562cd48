"""Many recordings and videos for `vid2ev interpolate`: found, and where their films go."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path


def sources_in(source: str, goes_to: Path) -> list[str]:
    """What an argument stands for: itself, the recordings in a folder, or where there are none its videos and folders
    of images, or what the lines of a list NAME.txt stand for; of the folder that frames go to not those that were made
    before.

    Raises UsageError, DataError."""
    from interp.data.layouts import is_sequence, sequences_in
    from vid2ev.errors import UsageError
    from vid2ev.sources import many

    folder = Path(source)
    if not folder.is_dir():
        found = many.sources_in(source)
        return found if found == [source] else [each for line in found for each in sources_in(line, goes_to)]
    if is_sequence(folder):
        return [source]
    try:
        recordings, unusable = sequences_in(folder)
    except UsageError:
        found = many.sources_in(source)
        own = os.path.realpath(folder) == os.path.realpath(goes_to)  # (of links in a ring, Path's raises)
        return [each for each in found if not (own and _is_made(Path(each)))] or found
    return [*map(str, recordings), *unusable]


def _is_made(path: Path) -> bool:
    """Whether a film or a folder of pictures is one of ours, of more frames than a source had."""
    from interp.interpolate.destination import manifest_of
    from vid2ev.errors import DataError
    from vid2ev.recording.manifest import read_manifest

    try:
        return "interpolation" in read_manifest(manifest_of(path, "png" if path.is_dir() else "mp4"))
    except DataError:
        return False


def places(sources: Sequence[str], folder: Path, named: Callable[[str], Path]) -> dict[str, Path]:
    """Where the film of each source goes within a folder; of sources with one name, the second gets a number."""
    found: dict[str, Path] = {}
    for source in dict.fromkeys(sources):
        name, number = named(source), 2
        plain, suffix = name, ".mp4" * (name.suffix == ".mp4")  # (of folders what is behind a dot is none)
        while folder / name in found.values():
            name, number = plain.with_name(f"{plain.name.removesuffix(suffix)}_{number}{suffix}"), number + 1
        found[source] = folder / name
    return found
