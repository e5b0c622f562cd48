"""What commands that make films and folders of pictures have in common."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from vid2ev.commands import INTERRUPTED, tidy
from vid2ev.errors import DataError, UsageError
from vid2ev.requests import number_of


def contrast_of(text: str | None) -> tuple[float, float] | None:
    """Nats of an OFF and an ON event as people write them.  Raises UsageError."""
    if text is None:
        return None
    values = [number_of(word.strip()) for word in text.split(",")]
    if len(values) not in (1, 2) or not all(0 < value < 10 for value in values):
        raise UsageError(f"--contrast {text}: expected nats, such as 0.2, or of OFF and ON events, such as 0.2,0.25")
    return values[0], values[-1]


@contextmanager
def kept(path: Path) -> Iterator[None]:
    """What goes wrong within, or asks to end, says so if it can be resumed."""

    def remedy() -> str:
        done = path.with_name(f"{path.name}.partial") / "done.jsonl"
        return "; what is done is kept, the same command with --resume goes on" if done.exists() else ""

    try:
        with tidy():
            yield
    except DataError as error:
        raise DataError(f"{error}{remedy()}") from error
    except KeyboardInterrupt:
        click.echo(f"interrupted{remedy() or '; nothing is left behind'}", err=True)
        sys.exit(INTERRUPTED)


@contextmanager
def bar(quiet: bool, bar_format: str, unit: str) -> Iterator[Callable[[int, int | None], None]]:
    """A progress bar on a terminal: how much is done, of how much, how fast, and the time left."""
    from tqdm import tqdm

    with tqdm(total=None, bar_format=bar_format, leave=False, disable=quiet or None, unit=unit) as shown:

        def report(done: int, total: int | None) -> None:
            if shown.total is None:
                shown.total, shown.initial, shown.n = total, done, done
            shown.update(done - shown.n)

        yield report
