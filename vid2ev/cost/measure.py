"""`measured`: the ladder on a stretch of a clip, each setting timed several times, in turn.

First every setting runs once for its errors; what has to be compiled is compiled then.  Then all run again, several
times over, so that a slow minute of the machine hits all alike, every other round backwards.  Only these are timed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vid2ev.cores import usable_cores
from vid2ev.cost.errors import Errors, Reference
from vid2ev.cost.front import DEFAULT, DEFAULT_OF_FRAMES, Budget, Row, front, recommended
from vid2ev.cost.ladder import Given, Ladder, ladder_of, steps_of
from vid2ev.cost.passes import run
from vid2ev.cost.quality import Quality, interpolated, triples_of
from vid2ev.cost.rung import Rung
from vid2ev.cost.stretch import FRAMES, Stretch, seen_stretch
from vid2ev.cost.turns import Report, Turns
from vid2ev.errors import UsageError
from vid2ev.plan.plan import TOLERANCE
from vid2ev.recording.manifest import machine
from vid2ev.seen.recipe import Recipe

REPEATS = 3


@dataclass(frozen=True)
class Cost:
    """What was measured: the reference, and a row for each setting.

    clip           what was converted, and from when to when on its own clock [s]
    size, span_s   of the source [px]; from the first light to the last on the recording's clock [s]
    steps          into how many the fastest interval was divided by default
    between        how well each way to make light between the frames makes a frame that is left out
    warnings       of the source
    """

    clip: str
    stretch_s: Stretch
    size: tuple[int, int]
    span_s: float
    threads: int
    steps: int
    reference: Row
    rows: tuple[Row, ...]
    between: Mapping[str, Quality | None]
    budget: Budget
    warnings: tuple[str, ...] = ()

    @property
    def settings(self) -> list[Row]:
        """All that a conversion can be asked for; so can the reference, if it differs from the finest in nothing."""
        return [row for row in (self.reference, *self.rows) if not row.rung.float64]

    @property
    def front(self) -> list[Row]:
        """The settings than which none is both faster and more accurate, from the fastest on."""
        return front(self.settings)

    @property
    def recommended(self) -> Row | None:
        """The setting to take, if one is within the budget."""
        return recommended(self.settings, self.budget)

    def describe(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        best, ahead = self.recommended, self.front
        rows = [_described(row) | {"front": row in ahead} for row in self.rows]
        return {
            "clip": self.clip,
            "start_s": self.stretch_s[0],
            "stop_s": self.stretch_s[1],
            "size": list(self.size),
            "seconds": self.span_s,
            "threads": self.threads,
            "machine": machine(),
            "steps": self.steps,
            "reference": _described(self.reference) | {"front": self.reference in ahead},
            "settings": rows,
            "interpolation": {name: found and found._asdict() for name, found in self.between.items()},
            "budget": self.budget.text,
            "recommended": None if best is None else best.rung.name,
            "warnings": list(self.warnings),
        }


def measured(
    video: str | Path,
    *,
    given: Collection[str] = (),
    budget: str | None = None,
    duration_s: float | None = None,
    frames: int = FRAMES,
    repeats: int = REPEATS,
    threads: int | None = None,
    report: Report | None = None,
    clock: Callable[[], float] = time.perf_counter,
    **options: Any,
) -> Cost:
    """Run the ladder on the middle of a clip.

    given       names of options that have been given explicitly: they are the same in all settings
    budget      limits of error and time (`front`); by default vR=0.05, or lsb=1 where there are frame cameras only
    duration_s  how much of the clip to take, on its own clock; by default as many `frames` of 640x480 pixels, less of
                larger ones, and at most 2 s
    repeats     how often each setting is timed
    report      called before each pass
    The rest are the options of `Recipe.of`, and `effects` and `tolerance` as for `convert`.

    Raises UsageError for a source that passes once and for what cannot be meant, DataError as the source does.
    """
    limits = None if budget is None else Budget.parse(budget)
    if repeats < 1 or (duration_s is not None and not duration_s > 0):
        raise UsageError(f"repeats {repeats}, duration {duration_s}: expected at least 1, and more than 0 s")
    threads = threads or usable_cores()
    options = {"tolerance": TOLERANCE, "video": video} | options
    asked = Recipe.of(**_of_recipe(options))
    if limits is not None:
        limits.check({mount.kind for mount in asked.mounts})
    if not asked.source.rewindable:
        raise UsageError(f"{video} passes once and cannot be converted many times over; give a file")
    stretch = seen_stretch(asked, _of_recipe(options), duration_s, frames)
    options |= dict(zip(("start", "stop"), stretch, strict=True))
    recipe = Recipe.of(**_of_recipe(options))
    explicit, steps = Given(options, given), 1
    if not recipe.source.dense:
        steps = steps_of(recipe)
    ladder = ladder_of(recipe, explicit, steps)
    turns = Turns(report, (1 + repeats) * len(ladder.all))
    rows, span_ns = _rows(options, ladder, threads, turns, repeats, clock)
    return Cost(
        str(video),
        stretch,
        recipe.source.size,
        (span_ns[1] - span_ns[0]) / 1e9,
        threads,
        steps,
        rows[0],
        tuple(rows[1:]),
        _between(recipe, ladder),
        limits or Budget.parse(DEFAULT if any(mount.kind == "dvs" for mount in recipe.mounts) else DEFAULT_OF_FRAMES),
        tuple(recipe.source.warnings),
    )


def _rows(
    options: Mapping[str, Any],
    ladder: Ladder,
    threads: int,
    turns: Turns,
    repeats: int,
    clock: Callable[[], float],
) -> tuple[list[Row], tuple[int, int]]:
    """A row for each setting, the reference first; and the span of the clip [ns]."""
    views = any(rung.group == "views" for rung in ladder.rungs)
    turns.next(ladder.reference.name)
    first = run(options, ladder.reference, threads, keep=True, views=views)
    if first.span_ns[0] >= first.span_ns[1]:
        raise UsageError(
            f"{options['video']}: a single frame in the stretch that settings are tried on; expected two or more, of a"
            " clip with more frames or by vid2ev cost with a longer --duration"
        )
    reference = Reference(first.sent, (first.span_ns[0] // 1000, first.span_ns[1] // 1000))
    found = [(reference.errors_of_itself(), first.events)]
    for rung in ladder.rungs:
        turns.next(rung.name)
        found.append(_tried(options, rung, threads, reference))
    lasting_s = (first.span_ns[1] - first.span_ns[0]) / 1e9
    times = _timed(options, ladder, threads, turns, repeats, clock, lasting_s)
    rows = [
        Row(rung, errors, events, tuple(times[rung.name]))
        for rung, (errors, events) in zip(ladder.all, found, strict=True)
    ]
    return rows, first.span_ns


def _tried(options: Mapping[str, Any], rung: Rung, threads: int, reference: Reference) -> tuple[Errors, int]:
    """The errors of a setting, and how many events it has."""
    views = rung.group == "views"
    done = run(options, rung, threads, keep=True, views=views)
    return reference.errors(done.sent, rung.coarse, views), done.events


def _timed(
    options: Mapping[str, Any],
    ladder: Ladder,
    threads: int,
    turns: Turns,
    repeats: int,
    clock: Callable[[], float],
    lasting_s: float,
) -> dict[str, list[float]]:
    times: dict[str, list[float]] = {rung.name: [] for rung in ladder.all}
    for again in range(repeats):
        for rung in ladder.all[:: -1 if again % 2 else 1]:
            turns.next(rung.name)
            began = clock()
            run(options, rung, threads)
            times[rung.name].append((clock() - began) / lasting_s)
    return times


def _between(recipe: Recipe, ladder: Ladder) -> dict[str, Quality | None]:
    """How well the ways to make light between the frames make a frame that is left out."""
    light = [rung.options for rung in ladder.rungs if rung.group == "light"]
    ways = [str(options["upsample"]) for options in light if "upsample" in options]
    if not ways:
        return {}
    triples = triples_of(recipe.source, recipe.threshold)
    return {way: interpolated(triples, way, recipe.threshold) for way in (recipe.upsample, *ways)}


def _of_recipe(options: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if name not in ("effects", "tolerance")}


def _described(row: Row) -> dict[str, Any]:
    rung = row.rung
    return {
        "name": rung.name,
        "group": rung.group,
        "arguments": rung.arguments(),
        "offered": rung.offered,
        "times": list(row.times),
        "time": row.time,
        "events": row.events,
        **row.errors.describe(),
    }
