"""What a page has done for it (`gui.jobs`): conversions, plans of whole clips, the cost of accuracy, statistics."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from vid2ev.gui.command import options_of
from vid2ev.gui.jobs import Tell
from vid2ev.gui.setup import Setup
from vid2ev.terminal import counted

EVERY_S = 0.1  # a report, at most


def converted(tell: Tell, setup: Setup, directory: str, overwrite: bool = False) -> dict[str, Any]:
    """The manifest of the recording of a setup; cancelled work leaves what it would leave on the command line."""
    from vid2ev.making.conversion import convert
    from vid2ev.seen.recipe import Recipe
    from vid2ev.tracks.recorder import Progress

    told_s = 0.0

    def report(recipe: Recipe, done: Progress) -> None:
        nonlocal told_s
        if time.monotonic() - told_s > EVERY_S:
            told_s = time.monotonic()
            said = f"{counted(done.frames, 'frame')}, {counted(done.events, 'event')}"
            tell(done.frames, recipe.source.frames_expected, said)

    tell(0, None, "opening the source")
    with tempfile.TemporaryDirectory() as folder:
        options = options_of(setup, Path(folder))
        return convert(options.pop("video"), directory, overwrite=overwrite, report=report, **options)


def planned(tell: Tell, setup: Setup) -> dict[str, Any]:
    """The plan of each camera for the whole clip, by its name."""
    from contextlib import closing

    from vid2ev.cores import usable_cores
    from vid2ev.plan.plan import TOLERANCE
    from vid2ev.plan.recordings import Look
    from vid2ev.seen.instants import instants
    from vid2ev.seen.recipe import Recipe

    tell(0, None, "opening the source")
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe.of(**options_of(setup, Path(folder)))
        look, seen = Look(recipe, usable_cores()), 0
        with closing(instants(recipe)) as coming:
            for instant in coming:
                look.see(instant)
                seen += instant.original
                tell(seen, recipe.source.frames_expected, counted(seen, "frame"))
    return look.plans("auto", TOLERANCE)


def costed(tell: Tell, setup: Setup, repeats: int = 1, duration_s: float | None = None) -> dict[str, Any]:
    """What `vid2ev cost` says of a setup, as its JSON has it."""
    from vid2ev.cost.measure import measured

    with tempfile.TemporaryDirectory() as folder:
        options = options_of(setup, Path(folder))
        found = measured(
            options.pop("video"), given=[*setup.options], repeats=repeats, duration_s=duration_s,
            report=tell, **options,
        )  # fmt: skip
    return found.describe()


def gathered(tell: Tell, path: str) -> Any:
    """The statistics of an event file, or of a recording that has one event camera: over its time, or where it does not
    say when it begins from its first event on, as of files that are compared."""
    from vid2ev.compare.statistics import Gathering
    from vid2ev.formats import of_only_camera, open_events, survey

    file = open_events(of_only_camera(path))
    recording = survey(file)
    gathering, seen = Gathering(recording.size), 0
    for events in recording.blocks():
        gathering.add(events)
        seen += len(events)
        tell(seen, recording.count, counted(seen, "event"))
    start_us = recording.start_us
    return gathering.statistics((start_us, start_us + recording.duration_us) if file.says_start else None)
