"""Which part of a clip the ladder is run on: the middle of what is asked for, as beginnings are often black.

Where that is, a header says; how far it goes, the times of the pictures there: a header's rate is a mean, or a claim.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from typing import Any

from vid2ev.errors import Vid2evError
from vid2ev.seen.recipe import Recipe
from vid2ev.sources.source import Source

LONGEST_S, FRAMES = 2.0, 30  # of a clip of 640x480 pixels; less of larger ones, in proportion
FEWEST, VGA = 8, 640 * 480

Stretch = tuple[float | None, float | None]


def seen_stretch(
    recipe: Recipe, options: Mapping[str, Any], duration_s: float | None = None, frames: int = FRAMES
) -> Stretch:
    """`stretch_of`, where there are pictures: of footage as many of those from there on as are wanted, or all of the
    `duration_s` that is given; the first pictures of what is asked for where hardly any are left.  `options` are all
    that the recipe was made of."""
    stretch = stretch_of(recipe, options, duration_s, frames)
    counted = duration_s is None and not recipe.source.dense
    part = {"start": stretch[0], "stop": options.get("stop") if counted else stretch[1]}
    wanted = _pictures(frames, recipe.source.size) if counted else 2
    try:
        times = _times(Recipe.of(**{**options, **part}).source, options, wanted + 1)
    except Vid2evError:  # (the middle of a clip that is cut short)
        times = []
    if len(times) < min(wanted, FEWEST) and stretch[0] != options.get("start"):
        return beginning_of(recipe, options, duration_s, frames)
    near = sum(time - times[0] <= LONGEST_S * _share(recipe.source.size) for time in times)
    taken = times[: min(wanted, max(near, FEWEST))]
    if not counted or len(taken) < 2 or (len(taken) == len(times) and stretch[0] == options.get("start")):
        return stretch
    return taken[0], taken[-1]


def stretch_of(
    recipe: Recipe, options: Mapping[str, Any], duration_s: float | None = None, frames: int = FRAMES
) -> Stretch:
    """The start and stop [s on the source's own clock] of the middle of what is asked for; None for its ends."""
    source, slowdown = recipe.source, float(options.get("slowdown") or 1)
    start, stop, whole_s = options.get("start"), options.get("stop"), source.duration_expected_s
    whole_s = None if whole_s is None else whole_s * slowdown
    wanted_s = duration_s or _wanted_s(frames, source.size, source.frames_expected, whole_s)
    if whole_s is not None and whole_s <= wanted_s:
        return start, stop
    begin_s = start
    if begin_s is None:
        begin_s = next(source.frames()).t_ns / 1e9 * slowdown
    begin_s += 0 if whole_s is None else (whole_s - wanted_s) / 2
    return round(float(begin_s), 6), round(float(begin_s) + wanted_s, 6)


def beginning_of(
    recipe: Recipe, options: Mapping[str, Any], duration_s: float | None = None, frames: int = FRAMES
) -> Stretch:
    """The start and stop of the first pictures of what is asked for, likewise."""
    times = _times(recipe.source, options, _pictures(frames, recipe.source.size) + 1)
    end, stop = times[-1] if duration_s is None else times[0] + duration_s, options.get("stop")
    return times[0], end if stop is None else min(end, float(stop))


def _times(source: Source, options: Mapping[str, Any], most: int) -> list[float]:
    """When its first pictures are [s on the source's own clock]."""
    slowdown = float(options.get("slowdown") or 1)
    return [frame.t_ns / 1e9 * slowdown for frame in islice(source.frames(), most)]


def _pictures(frames: int, size: tuple[int, int]) -> int:
    return max(FEWEST, round(frames * _share(size)))


def _share(size: tuple[int, int]) -> float:
    return min(1.0, VGA / (size[0] * size[1]))


def _wanted_s(frames: int, size: tuple[int, int], of_all: int | None, whole_s: float | None) -> float:
    share = _share(size)
    if not of_all or not whole_s:
        return LONGEST_S * share
    frame_s = whole_s / of_all
    return max(FEWEST * frame_s, share * min(LONGEST_S, frames * frame_s))
