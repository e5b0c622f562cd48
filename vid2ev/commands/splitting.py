"""A clip split among workers, as the command line does it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vid2ev.errors import UsageError
from vid2ev.requests import number_of

if TYPE_CHECKING:
    from vid2ev.cluster.task import Task
    from vid2ev.cluster.workers import Workers

LOOKS = "looking for places to split: {n_fmt}/{total_fmt} frames, {elapsed} gone, {remaining} left"
KINDS = ("tiles", "cuts", "chain", "approximate")
LINK_MIN = 10.0  # of a chain
PARTS = {"cuts": 4}  # for each worker, as shots are not as long as each other; otherwise one


class Split(NamedTuple):
    """How a clip is split: a kind, and how many parts, or how long the links of a chain are [min]."""

    kind: str
    number: float


def split_of(text: str | None, workers: Workers) -> Split | None:
    """What --split says; None for not at all.  Raises UsageError."""
    if text is None:
        return None
    kind, colon, said = text.partition(":")
    if kind not in KINDS:
        raise UsageError(f"--split {text}: expected one of {', '.join(KINDS)}")
    if workers.alone:
        raise UsageError(f"--split {text} needs workers to split among; add --jobs 2 or more, or --scheduler")
    if kind == "chain":
        return Split(kind, _minutes(said, text) if colon else LINK_MIN)
    if colon and not (said.isdecimal() and 0 < len(said) < 7 and int(said)):
        raise UsageError(f"--split {text}: expected how many parts, such as {kind}:8")
    if not colon and workers.scheduler:
        raise UsageError(f"--split {text} with --scheduler: expected how many parts, such as {kind}:8")
    return Split(kind, int(said) if colon else workers.jobs * PARTS.get(kind, 1))


def split_among(
    workers: Workers,
    video: str,
    directory: Path,
    split: Split,
    quiet: bool,
    options: dict[str, Any],
    others: bool,
) -> dict[str, Any]:
    """Convert a video in parts, `others` perhaps being done already; returns the manifest."""
    from vid2ev.commands.live import shared_out
    from vid2ev.commands.progress import bar, interruptible
    from vid2ev.interrupts import heard
    from vid2ev.making.split import begun_parts, convert_split, parts_of
    from vid2ev.terminal import counting

    def share_out(tasks: Sequence[Task]) -> None:
        looking.close()
        errors = [outcome.error for outcome in shared_out(tasks, workers, "parts", quiet) if outcome.error]
        if errors:
            raise errors[0]

    told = interruptible(directory, lambda: bool(begun_parts(parts_of(directory))), others=others)
    with told, heard() as check, ExitStack() as looking, bar(quiet, check) as report:
        look = looking.enter_context(counting(quiet, LOOKS))
        return convert_split(
            video, directory, split.kind, int(split.number), share_out, look=look, report=report, **options
        )


def checked_for(workers: Workers, video: str, directory: Path, split: Split | None, options: dict[str, Any]) -> None:
    """Raise UsageError for what workers, or the parts of a video for them, refuse before anything is converted."""
    from vid2ev.commands.converting import check_shared
    from vid2ev.making.split import check_split

    if split is not None:
        check_split(video, directory, split.kind, **{key: options[key] for key in options.keys() - {"budget"}})
    elif not workers.alone:
        check_shared(video, directory, options["overwrite"], options["resume"])


def _minutes(said: str, text: str) -> float:
    minutes = number_of(said)
    if not 0 < minutes < 1e6:
        raise UsageError(f"--split {text}: expected how many minutes a worker goes on for, such as chain:10")
    return minutes
