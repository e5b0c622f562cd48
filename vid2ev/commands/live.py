"""What a person sees of work that is shared out: a live line of all of it, and a line for each thing that is done."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from vid2ev.commands import KEPT, say_interrupted
from vid2ev.interrupts import heard
from vid2ev.terminal import COMPILING, bar_of, counted

if TYPE_CHECKING:
    from vid2ev.cluster.task import Task
    from vid2ev.cluster.work import Outcome
    from vid2ev.cluster.workers import Workers

LINE = "{percentage:3.0f}% {bar:12}{postfix}, {elapsed} gone, {remaining} left"


@dataclass
class _Task:
    """How far a task is: its share 0 ... 1, and its events now and when they were first told of."""

    share: float = 0.0
    events: int = 0
    events_before: int = 0
    running: bool = False
    compiling: bool = False
    told: bool = False


class Live:
    """The line: how many of `count` are done, failed and running, events and events per second, and the time left.

    `watch` may be called in any thread.
    """

    def __init__(self, count: int, noun: str, quiet: bool):
        self._count, self._noun = count, noun
        self._tasks: dict[str, _Task] = {}
        self._done = self._failed = 0
        self._began_s, self._lock = time.monotonic(), threading.Lock()
        self._bar = bar_of(quiet, LINE, total=count)
        self._show()

    def watch(self, name: str, facts: Mapping[str, Any]) -> None:
        """What a task tells: `begun`, its `share`, its `events`, whether it is `compiling`."""
        with self._lock:
            task = self._tasks.setdefault(name, _Task())
            task.running, task.share = True, facts.get("share", task.share)
            task.compiling = facts.get("compiling", task.compiling and not facts.get("begun"))
            if "events" in facts:
                task.events = facts["events"]
                task.events_before = task.events_before if task.told else task.events
                task.told = True
            self._show()

    def end(self, name: str, failed: bool, events: int | None, text: str) -> None:
        """A task is over, with so many events; `text` is said of it."""
        with self._lock:
            task = self._tasks.setdefault(name, _Task())
            if events is not None:
                task.events, task.events_before = events, task.events_before if task.told else events
            task.running, task.compiling, task.share = False, False, 1.0
            self._failed, self._done = self._failed + failed, self._done + (not failed)
            if not self._bar.disable:
                self._bar.clear()
            click.echo(f"[{self._done + self._failed}/{self._count}] {text}", err=failed)
            self._show()

    def close(self) -> None:
        """Take the line away."""
        self._bar.close()

    @property
    def text(self) -> str:
        """What the line says."""
        tasks = self._tasks.values()
        parts = [f"{self._done}/{self._count} {self._noun}"]
        parts += [f"{self._failed} failed"] * bool(self._failed)
        parts.append(f"{sum(task.running for task in tasks)} running")
        if compiling := sum(task.compiling for task in tasks):
            parts.append(f"{compiling} {COMPILING}")
        if events := sum(task.events for task in tasks):
            made = sum(task.events - task.events_before for task in tasks)
            parts += [counted(events, "event"), f"{made / (time.monotonic() - self._began_s):,.0f}/s"]
        return ", ".join(parts)

    def _show(self) -> None:
        if not self._bar.disable:
            self._bar.set_postfix_str(self.text, refresh=False)
            self._bar.n = sum(task.share for task in self._tasks.values())
            self._bar.refresh()


class Said(NamedTuple):
    """What is said of a task that is over."""

    text: str
    events: int | None = None
    failed: bool = False


def said_of(outcome: Outcome) -> Said:
    """That it is done, or why it is not."""
    error = outcome.error
    return Said(f"{outcome.name}: error: {error}", failed=True) if error else Said(f"{outcome.name}: done")


def shared_out(
    tasks: Sequence[Task],
    workers: Workers,
    noun: str,
    quiet: bool,
    said: Callable[[Outcome], Said] = said_of,
) -> Iterator[Outcome]:
    """The outcomes of tasks, in whatever order they come, with a live line and what is `said` of each unless `quiet`.

    What asks the program to end does so, and it says that it can be resumed.
    """
    from vid2ev.cluster.work import outcomes

    live = None if quiet else Live(len(tasks), noun, quiet)
    try:
        with heard():
            for outcome in outcomes(tasks, workers, live.watch if live else None):
                if live:
                    text, events, failed = said(outcome)
                    live.end(outcome.name, failed, events, text)
                yield outcome
    except KeyboardInterrupt:
        say_interrupted(KEPT)
    finally:
        if live:
            live.close()
