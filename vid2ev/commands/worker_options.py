"""The options that say who does the work, the same for every command that shares it out."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from vid2ev.commands.options import adding

if TYPE_CHECKING:
    from vid2ev.cluster.workers import Workers

NAMES = ("jobs", "scheduler", "retries", "memory")


def worker_options(what: str, default: str = "1") -> Callable[..., Any]:
    """A decorator that adds the options to a command; `what` is done at a time, and so many without --jobs."""
    return adding(
        click.option(
            "--jobs", type=click.IntRange(1), metavar="N", help=f"{what} made at a time, each by a process of its own;"
            f" changes nothing but the time it takes.  [default: {default}]",
        ),
        click.option(
            "--scheduler", metavar="ADDRESS", help="Share the work out on a cluster instead: its Dask scheduler, such"
            " as tcp://host:8786. All machines need the same folders.",
        ),
        click.option(
            "--retries", type=click.IntRange(0), default=2, show_default=True, metavar="N",
            help="With --jobs or --scheduler: how often one is tried again after an error or the death of its worker.",
        ),
        click.option(
            "--memory", metavar="SIZE", help="With --jobs: what each process may take, such as 4GiB; one that takes"
            " more is ended.  [default: its share of the machine's]",
        ),
    )  # fmt: skip


def workers_of(options: dict[str, Any], jobs: int = 1) -> Workers:
    """The workers that the options, which are taken out, ask for; `jobs` where they say nothing.  Raises UsageError."""
    from vid2ev.cluster.workers import Workers
    from vid2ev.errors import UsageError

    asked = {name: options.pop(name) for name in NAMES}
    if asked["scheduler"] is not None:
        for name in ("jobs", "memory"):
            if asked[name] is not None:
                raise UsageError(f"--{name} with --scheduler, whose workers are there already; leave one of them out")
    workers = Workers(**asked | {"jobs": asked["jobs"] or (1 if asked["scheduler"] else jobs)})
    if workers.memory is not None and workers.alone:
        raise UsageError(f"--memory {workers.memory} of one process, this one, which is not limited; add --jobs")
    return workers
