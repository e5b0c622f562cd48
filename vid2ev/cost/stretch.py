"""Which part of a clip the ladder is run on: the middle of what is asked for, as beginnings are often black."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from typing import Any

from vid2ev.seen.recipe import Recipe

LONGEST_S, FRAMES = 2.0, 30  # of a clip of 640x480 pixels; less of larger ones, in proportion
FEWEST, VGA = 8, 640 * 480

Stretch = tuple[float | None, float | None]


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
    slowdown = float(options.get("slowdown") or 1)
    wanted = max(FEWEST, round(frames * _share(recipe.source.size))) + 1
    times = [float(frame.t_ns) / 1e9 * slowdown for frame in islice(recipe.source.frames(), wanted)]
    end, stop = times[-1] if duration_s is None else times[0] + duration_s, options.get("stop")
    return times[0], end if stop is None else min(end, float(stop))


def _share(size: tuple[int, int]) -> float:
    return min(1.0, VGA / (size[0] * size[1]))


def _wanted_s(frames: int, size: tuple[int, int], of_all: int | None, whole_s: float | None) -> float:
    share = _share(size)
    if not of_all or not whole_s:
        return LONGEST_S * share
    frame_s = whole_s / of_all
    return max(FEWEST * frame_s, share * min(LONGEST_S, frames * frame_s))
