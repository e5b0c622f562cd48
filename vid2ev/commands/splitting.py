"""A clip split among workers, as the command line does it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from vid2ev.cluster.task import Task
    from vid2ev.cluster.workers import Workers


def tiles_of(split: str | None, workers: Workers) -> int | None:
    """Into how many parts to split the pixels; None for not at all.  Raises UsageError."""
    if split is None:
        return None
    kind, colon, count = split.partition(":")
    if kind != "tiles" or (colon and not (count.isdecimal() and int(count))):
        raise UsageError(f"--split {split}: expected tiles, or how many of them, such as tiles:8")
    if workers.alone:
        raise UsageError(f"--split {split} needs workers to split among; add --jobs or --scheduler")
    if not colon and workers.scheduler:
        raise UsageError(f"--split {split} with --scheduler: expected how many, such as tiles:8")
    return int(count) if colon else workers.jobs


def split_among(
    workers: Workers, video: str, directory: Path, tiles: int, quiet: bool, options: dict[str, Any]
) -> dict[str, Any]:
    """Convert a video, its pixels in so many parts; returns the manifest."""
    from vid2ev.commands.live import shared_out
    from vid2ev.commands.progress import bar, heard
    from vid2ev.split import convert_split

    if options.pop("budget") is not None:
        raise UsageError("--split and --budget: what the budget allows is found in one piece; leave one of them out")

    def share_out(tasks: Sequence[Task]) -> None:
        error: Exception | None = None
        with shared_out(tasks, workers, "tiles", quiet) as (outcomes, live):
            for outcome in outcomes:
                error = error or outcome.error
                if live:
                    live.end(outcome.name, bool(outcome.error), None, f"{outcome.name}: {outcome.error or 'done'}")
        if error:
            raise error

    with heard() as check, bar(quiet, check) as report:
        return convert_split(video, directory, tiles, share_out, report=report, **options)
