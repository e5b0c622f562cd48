"""What is seen of commands, and of long work within: facts in a column, and a bar, or lines in a log."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from typing import TYPE_CHECKING, Any, TextIO

from vid2ev.errors import plain

if TYPE_CHECKING:
    from tqdm import tqdm

NAME = 10  # width of the names
COMPILING = "compiling kernels, once"  # it takes seconds to minutes
BAR = re.compile(r" {bar(:\d+)?}")
END = re.compile(r"{percentage[^}]*}% (?:{bar[^}]*} )?|/{total_fmt}|, {remaining} left")  # what is said of an end
SELDOM_S, MORE = 10.0, 0.1  # between lines of a log at least, and of the time that is gone


def lines(facts: Iterable[tuple[str, str]]) -> str:
    """Facts under each other, their names in a column; without control characters, as they may be quoted of files."""
    facts = [(plain(name), plain(str(text))) for name, text in facts]
    width = max(NAME, *(len(name) + 1 for name, _ in facts))
    return "\n".join(f"{name:<{width}}{text}" for name, text in facts)


def counted(count: int, name: str) -> str:
    """A number of things that have a name."""
    return f"{count:,} {name}{'s' * (count != 1)}"


def bar_of(quiet: bool, bar_format: str, **look: Any) -> tqdm:
    """A progress bar on a terminal; where that is none, as in the log of a cluster, a line of the same now and then.
    Neither with TQDM_DISABLE=1 in the environment.  As long as there is no `total`, nothing is said of the end."""
    bars = _bars()
    if quiet or sys.stderr is None:
        return bars(disable=True)
    if sys.stderr.isatty():
        return bars(bar_format=bar_format, leave=False, **look)
    return bars(bar_format=BAR.sub("", bar_format), leave=False, file=Log(sys.stderr), mininterval=1.0, **look)


@cache
def _bars() -> type[tqdm]:
    from tqdm import tqdm

    class Bar(tqdm):
        """(tqdm says that no time is left where it does not know how much there is to do.)"""

        @property
        def format_dict(self) -> Any:
            facts = super().format_dict
            return facts if facts["total"] else facts | {"bar_format": END.sub("", facts["bar_format"])}

    return Bar


class Log:
    """Where what a bar shows goes to in lines: the first after 10 s, then one whenever a tenth more time is gone."""

    def __init__(self, file: TextIO):
        self._file = file
        self._began_s = self._told_s = time.monotonic()

    def write(self, text: str) -> None:
        """What the bar shows now, or nothing where it is taken away."""
        line, now_s = text.strip(), time.monotonic()
        if line and now_s - self._told_s >= max(SELDOM_S, MORE * (now_s - self._began_s)):
            self._told_s = now_s
            with suppress(OSError):  # (nobody reads it any more; the work goes on)
                print(line, file=self._file, flush=True)

    def flush(self) -> None:
        """Lines are whole as they are written."""


@contextmanager
def counting(quiet: bool, bar_format: str, **look: Any) -> Iterator[Callable[..., None]]:
    """A bar; what this yields is told how many are done, of how many, and perhaps a name."""
    shown: tqdm | None = None

    def report(done: int, count: int | None, name: str = "") -> None:
        nonlocal shown
        if shown is None:
            shown = bar_of(quiet, bar_format, **look)
        shown.total = count
        shown.set_postfix_str(name, refresh=False)
        shown.update(done - shown.n)
        if name:
            shown.refresh()

    try:
        yield report
    finally:
        if shown is not None:
            shown.close()
