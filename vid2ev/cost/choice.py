"""The setting that a conversion takes for its budget."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vid2ev.cost.front import Budget, refusal
from vid2ev.cost.ladder import Given
from vid2ev.cost.measure import measured
from vid2ev.cost.rung import Rung
from vid2ev.cost.table import recommendation
from vid2ev.cost.turns import Report
from vid2ev.errors import UsageError

FRAMES, REPEATS = 15, 2  # of 640x480 pixels: a short stretch
NOT_MEASURED = ("labels", "skip", "seed")  # what changes no error


@dataclass(frozen=True)
class Choice:
    """What was chosen, what it is known again by, and a line about it for people."""

    rung: Rung
    note: Mapping[str, Any]
    line: str


def chosen(
    video: str | Path,
    budget: str,
    options: Mapping[str, Any],
    *,
    given: Collection[str] = (),
    threads: int | None = None,
    report: Report | None = None,
) -> Choice:
    """The setting for a budget (`front`), by the ladder on a short stretch in the middle of a clip.

    options  of the conversion, those of `Recipe.of` and the effects; those `given` explicitly stay as they are, and
             rungs that are named there are not taken

    Raises UsageError where no setting is within the budget, and as `measured` does.
    """
    rest = {name: value for name, value in options.items() if name not in NOT_MEASURED}
    seed = options.get("seed") or 0
    cost = measured(
        video, given=given, budget=budget, frames=FRAMES, repeats=REPEATS, threads=threads, report=report, seed=seed,
        **rest,
    )  # fmt: skip
    best = cost.recommended
    if best is None:
        raise UsageError(refusal(cost.settings, cost.budget))
    rung = best.rung
    note = {
        "asked": budget,
        "setting": rung.name,
        "arguments": rung.arguments(),
        "options": dict(rung.options),
        "settings": dict(rung.settings),
        "errors": best.errors.describe(),
    }
    return Choice(rung, note, recommendation(cost))


def taken_up(note: Mapping[str, Any], budget: str, given: Given) -> Choice | None:
    """What was chosen by an interrupted conversion, from its `note`; None if another budget was asked for, or something
    was `given` since that it chose."""
    if note.get("asked") != Budget.parse(budget).text or given.any(*note["options"], *note["settings"]):
        return None
    rung = Rung(note["setting"], options=note["options"], settings=note["settings"])
    return Choice(rung, note, f"budget {budget}: {rung.name} ({rung.arguments() or 'nothing to set'}), as before")
