"""Many videos in one go: found, converted one after the other, and told of in a table."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

from vid2ev.errors import Vid2evError

CLIPS = {
    ".mp4", ".mkv", ".avi", ".mov", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".wmv", ".flv", ".y4m", ".ogv", ".3gp",
    ".mts", ".m2ts", ".gif", ".npy", ".npz",
}  # fmt: skip

Convert = Callable[[str, Path], dict[str, Any]]


def sources_in(video: str) -> list[str]:
    """The sources that an argument stands for: itself, or what a folder without pictures holds: videos, arrays and
    folders of pictures, in natural order."""
    from vid2ev.light.recognise import natural

    folder = Path(video)
    if video == "-" or not folder.is_dir() or _holds_pictures(folder) or (folder / "manifest.json").exists():
        return [video]
    children = sorted(folder.iterdir(), key=lambda path: natural(path.name))
    found = [str(path) for path in children if _is_clip(path) or (path.is_dir() and _holds_pictures(path))]
    return found or [video]


def directories(videos: Iterable[str], within: Path) -> dict[str, Path]:
    """A folder for the recording of each video; of videos with one name, the second gets a number."""
    from vid2ev.conversion import default_directory

    named: dict[str, Path] = {}
    for video in videos:
        name = default_directory(video).name
        taken = {path.name for other, path in named.items() if other != video}
        number = 2
        while name in taken:
            name = f"{default_directory(video).name}_{number}"
            number += 1
        named[video] = within / name
    return named


def convert_each(directories: dict[str, Path], convert: Convert, quiet: bool) -> list[dict[str, Any]]:
    """Convert all videos, whatever happens to some: for each video, directory, state ("done" or "failed"), and events
    or error with its exit code."""
    results = []
    for number, (video, directory) in enumerate(directories.items(), 1):
        if not quiet:
            click.echo(f"[{number}/{len(directories)}] {video} -> {directory}")
        result: dict[str, Any] = {"video": video, "directory": str(directory)}
        try:
            made = convert(video, directory)
        except Vid2evError as error:
            click.echo(f"error: {error}", err=True)
            result |= {"state": "failed", "error": str(error), "exit_code": error.exit_code}
        except Exception as error:  # (a mistake of ours in one video does not stop the others either)
            traceback.print_exc()
            result |= {"state": "failed", "error": f"{type(error).__name__}: {error}", "exit_code": 1}
        else:
            events = _events(made)
            result |= {"state": "planned" if events is None else "done", "events": events}
        results.append(result)
    return results


def exit_code(results: list[dict[str, Any]]) -> int:
    """0 if all went well, otherwise the worst."""
    return max((result.get("exit_code", 0) for result in results), default=0)


def table(results: list[dict[str, Any]]) -> str:
    """The results for people."""
    failed = sum(result["state"] == "failed" for result in results)
    verb = "planned" if any(result["state"] == "planned" for result in results) else "done"
    width = max(len(result["video"]) for result in results)
    lines = [""]
    for result in results:
        events = "" if result.get("events") is None else f"{result['events']:,} events"
        lines.append(f"{result['state']:<7} {result['video']:<{width}}  {result.get('error', events)}".rstrip())
    lines.append(f"{len(results) - failed} of {len(results)} {verb}" + f", {failed} failed" * (failed > 0))
    return "\n".join(lines)


def _events(made: dict[str, Any]) -> int | None:
    """How many there are, by a manifest; None before they are made."""
    results = [made] if "counts" in made else list(made.get("results", {}).values())
    return sum(result["counts"].get("events", 0) for result in results) if results else None


def _is_clip(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in CLIPS and not path.stem.endswith("_timestamps")


def _holds_pictures(folder: Path) -> bool:
    from vid2ev.light.recognise import PICTURE_SUFFIXES

    return any(path.suffix.lower() in PICTURE_SUFFIXES for path in folder.iterdir() if path.is_file())
