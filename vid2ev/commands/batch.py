"""Many videos in one go: found, converted one after the other, and told of in a table."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

from vid2ev.errors import Vid2evError

PICTURES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".exr", ".hdr"}
CLIPS = {
    ".mp4", ".mkv", ".avi", ".mov", ".webm", ".m4v", ".mpg", ".mpeg", ".ts", ".wmv", ".flv", ".y4m", ".ogv", ".3gp",
    ".mts", ".m2ts", ".gif", ".npy", ".npz",
}  # fmt: skip

Convert = Callable[[str, Path], dict[str, Any] | None]


def sources_in(video: str) -> list[str]:
    """The sources that an argument stands for: itself, or what a folder without pictures holds: videos, arrays and
    folders of pictures, in natural order."""
    from vid2ev.sources.images import natural

    folder = Path(video)
    if not folder.is_dir() or _holds_pictures(folder):
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


def convert_each(directories: dict[str, Path], convert: Convert, quiet: bool) -> None:
    """Convert all videos, whatever happens to some; ends the program with the worst exit code if any failed."""
    rows, exit_code = [], 0
    for number, (video, directory) in enumerate(directories.items(), 1):
        if not quiet:
            click.echo(f"[{number}/{len(directories)}] {video} -> {directory}")
        try:
            made = convert(video, directory)
        except Vid2evError as error:
            click.echo(f"error: {error}", err=True)
            rows.append((video, "failed", str(error)))
            exit_code = max(exit_code, error.exit_code)
        else:
            rows.append((video, "done", f"{made['counts']['events']:,} events" if made else ""))
    if not quiet:
        click.echo(_table(rows))
    if exit_code:
        sys.exit(exit_code)


def _table(rows: list[tuple[str, str, str]]) -> str:
    failed = sum(state == "failed" for _, state, _ in rows)
    width = max(len(video) for video, _, _ in rows)
    lines = [f"{state:<7} {video:<{width}}  {text}".rstrip() for video, state, text in rows]
    return "\n".join(["", *lines, f"{len(rows) - failed} of {len(rows)} done" + f", {failed} failed" * (failed > 0)])


def _is_clip(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in CLIPS and not path.stem.endswith("_timestamps")


def _holds_pictures(folder: Path) -> bool:
    return any(path.suffix.lower() in PICTURES for path in folder.iterdir() if path.is_file())
