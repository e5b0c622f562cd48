"""One video converted, as the command line does it: checked, planned, within its budget, with a bar."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vid2ev.errors import UsageError

if TYPE_CHECKING:
    from vid2ev.cluster.task import GoOn, Tell


def convert_one(
    video: str,
    directory: Path,
    dry_run: bool,
    verbose: bool,
    quiet: bool,
    options: dict[str, Any],
    others: bool = False,
) -> dict[str, Any]:
    """Convert a video, `others` perhaps being done already; returns the manifest, of a dry run what it would begin
    with."""
    from vid2ev.commands import summary
    from vid2ev.commands.dry_run import planned
    from vid2ev.commands.progress import bar, given, kept
    from vid2ev.interrupts import heard
    from vid2ev.making import conversion
    from vid2ev.sources import is_live
    from vid2ev.terminal import lines

    budget, limits = options["budget"], None
    if budget is not None:
        from vid2ev.cost.front import Budget

        limits = Budget.parse(budget)
    options = chosen_for(video, directory, quiet, options, given(), dry_run)
    if dry_run or verbose:
        recipe, plan = planned(video, directory, dict(options), limits)
        if not quiet:
            click.echo(plan)
            if dry_run and budget is not None:
                click.echo(f"then with the fastest setting within the budget {budget}, by `vid2ev cost`")
        if dry_run:
            return recipe
    live = is_live(video)
    told = kept(directory, "checkpoint.npz", again=not live, others=others)
    with told, heard(gently=live) as check, bar(quiet, check) as report:
        manifest = conversion.convert(video, directory, report=report, **options)
    if not quiet:
        facts = [*summary.result_facts(manifest), *summary.file_facts(directory), *summary.speed_facts(manifest)]
        click.echo(lines(facts))
    return manifest


def check_shared(video: str, directory: Path, overwrite: bool, resume: bool) -> None:
    """Raise UsageError for what no worker need try."""
    from vid2ev.recording.folder import check_free
    from vid2ev.sources import is_live

    if is_live(video):
        raise UsageError(f"{video} passes once, here; leave --jobs and --scheduler out")
    check_free(directory, overwrite, resume, video)


def convert_on_worker(
    tell: Tell, video: str, directory: Path, options: dict[str, Any], named: set[str], link_s: float
) -> dict[str, Any] | GoOn:
    """Convert a video, as a task, or go on for so long and then leave it to another; returns the manifest.  `named`:
    the options of the command line."""
    from vid2ev.cluster.task import GoOn
    from vid2ev.making import conversion

    chosen, until_s = chosen_for(video, directory, True, dict(options), named), time.monotonic() + link_s
    chosen |= {"report": conversion.telling(tell), "pause": lambda: time.monotonic() > until_s}
    try:
        return conversion.convert(video, directory, **chosen)
    except conversion.Paused:
        again: dict[str, Any] = {"options": options | {"resume": True}, "named": named, "link_s": link_s}
        return GoOn(partial(convert_on_worker, video=video, directory=directory, **again))


def chosen_for(
    video: str, directory: Path, quiet: bool, options: dict[str, Any], named: set[str], dry_run: bool = False
) -> dict[str, Any]:
    """The options of a conversion, with the setting for its budget if there is one."""
    budget = options.pop("budget")
    return options if budget is None or dry_run else _within(budget, video, directory, quiet, options, named)


def _within(
    budget: str, video: str, directory: Path, quiet: bool, options: dict[str, Any], named: set[str]
) -> dict[str, Any]:
    """The options of a conversion with the setting for its budget, that of an interrupted one if it goes on; those
    `named` on the command line stay as they are.  What is refused anyway is so before anything is tried."""
    from vid2ev.commands.dry_run import checked
    from vid2ev.commands.progress import pass_bar
    from vid2ev.cost.choice import chosen, taken_up
    from vid2ev.cost.front import Budget
    from vid2ev.cost.ladder import Given
    from vid2ev.making.split import begun_part
    from vid2ev.recording.folder import begun_job, check_free
    from vid2ev.sources import is_live
    from vid2ev.tracks.outputs import Outputs

    check_free(directory, options["overwrite"], options["resume"], video)
    job = begun_job(directory) or begun_part(directory) if options["resume"] else {}
    begun = job.get("budget", {})
    choice = taken_up(begun, budget, Given(options, named))
    if choice is None:
        if not is_live(video):
            checked(video, directory, options, Budget.parse(budget))
        rest = dict(options)
        Outputs.taken_from(rest)
        threads, *_, device = (rest.pop(name) for name in ("threads", "overwrite", "resume", "device"))
        if device != "cpu" and not quiet:
            click.echo(f"budget {budget}: settings are timed on the CPU, whatever --device converts on", err=True)
        with pass_bar(quiet) as report:
            choice = chosen(video, budget, rest, given=named, threads=threads, report=report)
    if not quiet:
        click.echo(choice.line)
    return choice.rung.applied(options) | {"notes": {"budget": choice.note}}
