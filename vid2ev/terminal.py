"""What a terminal shows, of commands and of long work within: facts in a column, and a bar."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm

NAME = 10  # width of the names
COMPILING = "compiling kernels, once"  # it takes seconds to minutes


def lines(facts: Iterable[tuple[str, str]]) -> str:
    """Facts under each other, their names in a column."""
    facts = list(facts)
    width = max(NAME, *(len(name) + 1 for name, _ in facts))
    return "\n".join(f"{name:<{width}}{text}" for name, text in facts)


def counted(count: int, name: str) -> str:
    """A number of things that have a name."""
    return f"{count:,} {name}{'s' * (count != 1)}"


@contextmanager
def counting(quiet: bool, bar_format: str, **look: Any) -> Iterator[Callable[..., None]]:
    """A progress bar on a terminal; what this yields is told how many are done, of how many, and perhaps a name."""
    from tqdm import tqdm

    shown: tqdm | None = None

    def report(done: int, count: int | None, name: str = "") -> None:
        nonlocal shown
        if shown is None:
            shown = tqdm(total=None, bar_format=bar_format, leave=False, disable=quiet or None, **look)
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
