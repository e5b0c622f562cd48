"""What a person sees of long work while it goes on: a progress bar, and what is kept when it is interrupted."""

from __future__ import annotations

from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from vid2ev.commands import KEPT, NOT_KEPT, say_interrupted
from vid2ev.commands.summary import of_the_clip
from vid2ev.errors import DataError, SavedError
from vid2ev.terminal import COMPILING, bar_of, counting

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from tqdm import tqdm

    from vid2ev.cost.turns import Report
    from vid2ev.formats.event_file import Recording
    from vid2ev.making.conversion import Progress
    from vid2ev.seen.recipe import Recipe

EVENTS = "{percentage:3.0f}% {bar} {n_fmt}/{total_fmt} events, {elapsed} gone, {remaining} left"
PASSES = "{percentage:3.0f}% {bar} pass {n_fmt}/{total_fmt}, {elapsed} gone, {remaining} left{postfix}"
FRAMES = "{percentage:3.0f}% {bar} {n_fmt}/{total_fmt} frames, {elapsed} gone, {remaining} left{postfix}"


@contextmanager
def kept(path: Path, record: str, *, again: bool = True, others: bool = False) -> Iterator[None]:
    """What goes wrong within, or asks to end, says so if it can be resumed: by a file of what is done, `record`, beside
    what is made.  What was kept and is damaged cannot.  Otherwise as `interruptible`."""
    from vid2ev.recording.destination import partial_of

    def begun() -> bool:
        return again and (partial_of(path) / record).exists()

    try:
        with interruptible(path, begun, again=again, others=others):
            yield
    except DataError as error:
        resumable = begun() and not isinstance(error, SavedError)
        raise DataError(f"{error}{f'; {KEPT}' * resumable}") from error


@contextmanager
def interruptible(path: Path, begun: Callable[[], bool], *, again: bool = True, others: bool = False) -> Iterator[None]:
    """What asks to end within says what becomes of what is made at `path`; `again`: its source can be read again.
    `others` that are done are kept, whatever becomes of this."""
    before = _which(path)
    try:
        yield
    except KeyboardInterrupt:
        made = _which(path) != before  # (it was put in its place before that was heard)
        say_interrupted(KEPT if begun() or others or (made and again) else NOT_KEPT * (not made))


def _which(path: Path) -> int | None:
    """What tells a file or a folder from another of its name; None if there is none."""
    with suppress(OSError):
        return path.stat().st_ino
    return None


@contextmanager
def bar(quiet: bool, check: Callable[[], bool]) -> Iterator[Callable[[Recipe, Progress], bool]]:
    """A progress bar: frames, time left, events per second, and time against the clip's; or that kernels are
    compiled."""
    from vid2ev.compiling.heard import telling_of

    shown: tqdm | None = None
    waiting: tqdm | None = None

    def report(recipe: Recipe, done: Progress) -> bool:
        nonlocal shown
        if shown is None:
            total, first = recipe.source.frames_expected, done.frames - 1
            shown = bar_of(quiet, FRAMES, total=total, initial=first)
        seconds, video_s = done.seconds or 1.0, max(done.end_ns - done.start_ns, 1) / 1e9
        text = f"{done.events / seconds:,.0f} events/s, {of_the_clip(seconds, video_s)}"
        shown.set_postfix_str(text, refresh=False)
        shown.update(done.frames - shown.n)
        return check()

    def compiling(begins: bool) -> None:
        nonlocal waiting
        if waiting is not None:
            waiting.close()
            waiting = None
        if shown is not None:
            shown.set_postfix_str(COMPILING * begins)
        elif begins:
            said = f"{COMPILING}, which takes seconds to minutes"
            waiting = bar_of(quiet, said)

    try:
        with telling_of(compiling):
            yield report
    finally:
        if shown is not None:
            shown.refresh()
            shown.close()


@contextmanager
def event_bar(quiet: bool) -> Iterator[Callable[[Recording, int], None]]:
    """A progress bar: events."""
    with counting(quiet, EVENTS, unit_scale=True) as report:
        yield lambda recording, events: report(events, recording.count)


def pass_bar(quiet: bool) -> AbstractContextManager[Report]:
    """A progress bar: passes."""
    return counting(quiet, PASSES)


def option(name: str) -> str:
    """An option of the command that runs, as a command line has it, by the name that the program knows it by."""
    command = click.get_current_context().command
    return next(max(each.opts, key=len) for each in command.params if each.name == name)


def given() -> set[str]:
    """The options of the command that runs which were given on its command line."""
    context = click.get_current_context()
    return {name for name in context.params if context.get_parameter_source(name) == ParameterSource.COMMANDLINE}
