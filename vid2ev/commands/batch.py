"""Many videos in one go: converted one after the other or shared out, and told of in a table."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands import as_told
from vid2ev.errors import Vid2evError
from vid2ev.terminal import counted

if TYPE_CHECKING:
    from vid2ev.cluster.work import Outcome
    from vid2ev.cluster.workers import Workers

Convert = Callable[[str, Path, bool], dict[str, Any]]  # a video, its folder, and whether others are done


def directories(videos: Iterable[str], within: Path) -> dict[str, Path]:
    """A folder for the recording of each video; of videos with one name, the second gets a number."""
    from vid2ev.making.conversion import default_directory

    named: dict[str, Path] = {}
    taken: set[str] = set()
    alike: Counter[str] = Counter()
    for video in dict.fromkeys(videos):
        name = first = default_directory(video).name
        while name in taken:
            alike[first] += 1
            name = f"{first}_{alike[first] + 1}"
        taken.add(name)
        named[video] = within / name
    return named


def convert_each(directories: dict[str, Path], convert: Convert, quiet: bool) -> list[dict[str, Any]]:
    """Convert all videos, whatever happens to some: for each video, directory, state ("done" or "failed"), and events
    or error with its exit code."""
    results = list[dict[str, Any]]()
    for number, (video, directory) in enumerate(directories.items(), 1):
        if not quiet:
            click.echo(f"[{number}/{len(directories)}] {video} -> {directory}")
        result: dict[str, Any] = {"video": video, "directory": str(directory)}
        try:
            made = convert(video, directory, any(each["state"] == "done" for each in results))
        except Exception as error:  # (a mistake of ours in one video does not stop the others either)
            if isinstance(told := as_told(error), Vid2evError):
                click.echo(f"error: {told}", err=True)
            else:
                traceback.print_exc()
            result |= _failed(error)
        else:
            result |= _done(made)
        results.append(result)
    return results


def convert_shared(
    directories: dict[str, Path],
    convert: Callable[..., Any],
    check: Callable[[str, Path], object],
    workers: Workers,
    quiet: bool,
) -> list[dict[str, Any]]:
    """`convert_each` by workers, each of which converts one video at a time.

    convert  a task, which gives the manifest in the end: takes `Tell`, and `video` and `directory` by name
    check    raises at once, here, for what need not be tried
    """
    from vid2ev.cluster.task import Task
    from vid2ev.commands.live import Said, shared_out

    results, tasks = dict[str, dict[str, Any]](), list[Task]()
    for video, directory in directories.items():
        try:
            check(video, directory)
        except Exception as error:
            if not isinstance(told := as_told(error), Vid2evError):
                raise
            results[video] = _failed(error)
            click.echo(f"error: {told}", err=True)
        else:
            tasks.append(Task(video, partial(convert, video=video, directory=directory)))

    def said(outcome: Outcome) -> Said:
        result = _result(outcome)
        failed = outcome.error is not None
        told = "error: " * failed + _told(result)
        return Said(f"{outcome.name} -> {directories[outcome.name]}: {told}", result.get("events"), failed)

    for outcome in shared_out(tasks, workers, "clips", quiet, said):
        results[outcome.name] = _result(outcome)
        if outcome.error and not isinstance(as_told(outcome.error), Vid2evError):
            traceback.print_exception(outcome.error)
        if outcome.error and quiet:
            click.echo(f"error: {as_told(outcome.error)}", err=True)
    return [{"video": video, "directory": str(directories[video])} | results[video] for video in directories]


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
        lines.append(f"{result['state']:<7} {result['video']:<{width}}  {_told(result)}".rstrip())
    lines.append(f"{len(results) - failed} of {len(results)} {verb}" + f", {failed} failed" * (failed > 0))
    return "\n".join(lines)


def _result(outcome: Outcome) -> dict[str, Any]:
    return _failed(outcome.error) if outcome.error else _done(outcome.value)


def _done(made: dict[str, Any]) -> dict[str, Any]:
    if "frames" in made:  # (of a film)
        return {"state": "done", "frames": made["frames"]}
    events = _events(made)
    return {"state": "planned" if events is None else "done", "events": events}


def _told(result: dict[str, Any]) -> str:
    """What came of a video: its events, its frames, or the error."""
    counts = [counted(result[f"{what}s"], what) for what in ("event", "frame") if result.get(f"{what}s") is not None]
    return result.get("error", "".join(counts))


def _failed(error: Exception) -> dict[str, Any]:
    if isinstance(told := as_told(error), Vid2evError):
        return {"state": "failed", "error": str(told), "exit_code": told.exit_code}
    return {"state": "failed", "error": f"{type(error).__name__}: {error}", "exit_code": 1}


def _events(made: dict[str, Any]) -> int | None:
    """How many there are, by a manifest; None before they are made."""
    results = [made] if "counts" in made else list(made.get("results", {}).values())
    return sum(result["counts"].get("events", 0) for result in results) if results else None
