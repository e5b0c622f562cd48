"""Which setting to take: the front of those than which none is both faster and more accurate, and the budget.

A budget is a text such as `vR=0.05`, `us=50`, `time=10x`, or several with commas:

    vR, count   distance, and count error, from the reference
    us          median timing error of matched events
    lsb         error of frames
    time        how long it may take, in multiples of how long the clip is

Recommended is the fastest setting within all limits, and of those that are as fast to within 5 %, which is what a
machine's noise makes of them, the most accurate; where time is the only limit, the most accurate within it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from vid2ev.cost.errors import Errors
from vid2ev.cost.rung import Rung
from vid2ev.errors import UsageError, nearest
from vid2ev.requests import number_of

DEFAULT, DEFAULT_OF_FRAMES = "vR=0.05", "lsb=1"
AS_FAST = 1.05
T = TypeVar("T")
LIMITS = ("vR", "count", "us", "lsb", "time")


@dataclass(frozen=True)
class Row:
    """A setting as measured: its errors, and how long each pass took, in multiples of how long the clip is."""

    rung: Rung
    errors: Errors
    events: int
    times: tuple[float, ...]

    @property
    def time(self) -> float:
        """The shortest: what else a machine does only ever adds to it."""
        return min(self.times)


@dataclass(frozen=True)
class Budget:
    """Limits by name; `text` as it was asked for."""

    text: str
    limits: tuple[tuple[str, float], ...]

    @classmethod
    def parse(cls, text: str) -> Budget:
        """Raises UsageError for what is no budget."""
        limits: dict[str, float] = {}
        for part in text.split(","):
            name, found, number = (word.strip() for word in part.partition("="))
            if name not in LIMITS or not found:
                raise UsageError(
                    f"budget '{part.strip()}': expected NAME=LIMIT with one of {', '.join(LIMITS)}, such as vR=0.05,"
                    f" us=50 or time=10x{'' if name in LIMITS else nearest(name, LIMITS)}"
                )
            if name in limits:
                raise UsageError(f"budget '{text}': {name} is limited twice; expected one limit of each kind")
            limits[name] = _number(part.strip(), number.removesuffix("x") if name == "time" else number)
            if name == "time" and limits[name] == 0:
                raise UsageError(f"budget '{part.strip()}': no setting takes no time; expected more, such as time=10x")
        return cls(text, tuple(limits.items()))

    def check(self, kinds: Collection[str]) -> None:
        """Raise UsageError for errors of cameras of another kind than these, dvs or cis."""
        for name, _ in self.limits:
            if name != "time" and ("cis" if name == "lsb" else "dvs") not in kinds:
                raise UsageError(f"budget '{self.text}': {name} cannot be measured here; leave it out")

    def only_time(self) -> bool:
        """Whether it says nothing of errors."""
        return all(name == "time" for name, _ in self.limits)

    def holds(self, row: Row) -> bool:
        """Whether a setting is within all limits."""
        return all(figure(row, name) <= limit for name, limit in self.limits)


def figure(row: Row, name: str) -> float:
    """What a limit is held against; infinite where it could not be measured."""
    errors = row.errors
    timing_us = None if errors.timing_us is None else float(errors.timing_us[0])
    if errors.timing_us is None and errors.distance == 0:
        timing_us = 0.0  # (no events at all)
    found = {"vR": errors.distance, "count": errors.count_error, "us": timing_us, "lsb": errors.rms_lsb}.get(name)
    return row.time if name == "time" else math.inf if found is None else found


def recommended(rows: Sequence[Row], budget: Budget) -> Row | None:
    """The setting to take, of those that may be recommended; None where none is within the budget."""
    within = [row for row in _able(rows, budget) if budget.holds(row)]
    slowest = math.inf if budget.only_time() else AS_FAST * min((row.time for row in within), default=0.0)
    as_fast = [row for row in within if row.time <= slowest]
    return min(as_fast, key=lambda row: (_error(row), row.time), default=None)


def refusal(rows: Sequence[Row], budget: Budget) -> str:
    """Why nothing is within a budget, and how near one can come, as a sentence."""
    able = _able(rows, budget)
    best = [(name, min(figure(row, name) for row in able)) for name, _ in budget.limits]
    unmeasured = [name for name, least in best if math.isinf(least)]
    if unmeasured:
        return f"budget '{budget.text}': {unmeasured[0]} cannot be measured here; leave it out"
    each = ", ".join(f"{name}={least:.3g}{'x' * (name == 'time')}" for name, least in best)
    together = " each for itself" if len(best) > 1 else ""
    return f"budget '{budget.text}': the best settings come to {each}{together}; allow more"


def front(rows: Sequence[Row]) -> list[Row]:
    """Of the settings that may be recommended those than which none is as fast and more accurate, nor as accurate and
    faster; from the fastest on."""
    return ahead((row for row in rows if row.rung.offered and _is_seen(row)), lambda row: row.time, _error)


def ahead(rows: Iterable[T], time: Callable[[T], float], error: Callable[[T], float]) -> list[T]:
    """Of anything that takes time and is off by something, what nothing else is ahead of in both; from the fastest
    on."""
    kept: list[T] = []
    for row in sorted(rows, key=lambda row: (time(row), error(row))):
        if not kept or error(row) < error(kept[-1]):
            kept.append(row)
    return kept


def _able(rows: Sequence[Row], budget: Budget) -> list[Row]:
    """The settings that may be recommended for a budget: what changes frames alone only where it limits their error."""
    frames = any(name == "lsb" for name, _ in budget.limits)
    return [row for row in rows if row.rung.offered and (frames or _is_seen(row))]


def _is_seen(row: Row) -> bool:
    """Whether the headline error says anything of what the setting changes: that of events nothing of frames."""
    return row.rung.group != "frames" or row.errors.distance is None


def _error(row: Row) -> float:
    return math.inf if row.errors.headline is None else row.errors.headline


def _number(part: str, text: str) -> float:
    limit = number_of(text)
    if not 0 <= limit < math.inf:
        raise UsageError(
            f"budget '{part}': expected a number of at least 0, such as vR=0.05, us=50 or time=10x, with commas between"
            " several"
        )
    return limit
