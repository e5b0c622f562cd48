"""How far a measurement is, for whoever wants to be told."""

from __future__ import annotations

from collections.abc import Callable

Report = Callable[[int, int, str], object]  # how many passes are done, of how many, and what comes next


class Turns:
    """Counts the passes for a report, of so many in all."""

    def __init__(self, report: Report | None, total: int):
        self._report, self._total, self._done = report, total, 0

    def next(self, name: str) -> None:
        """One begins."""
        if self._report is not None:
            self._report(self._done, self._total, name)
        self._done += 1
