"""The ladder: which settings are tried on a recipe.

    finest      the finest of everything: all effects, exact times, twice the sub-frames that the fastest interval asks
                for in every interval (16 at least, where sensors take the logarithm of light to be straight: between
                that and light is more than motion asks for)
    reference   twice the sub-frames of that, so that what it is itself away from its limit is less than the finest is
                away from it; and lags of light in float64
    default     what `convert` does when nothing is said
    others      the default with one thing changed, and some with several

What has been given explicitly is the same on all rungs, the reference too, and rungs that cannot be told from the
default, because the sensor has no filter, say, or nothing moves, are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vid2ev.cost.rung import Rung
from vid2ev.seen.instants import instants
from vid2ev.seen.recipe import Recipe
from vid2ev.seen.sight import are_free
from vid2ev.sensors.cis_spec import NOISELESS, CisSpec
from vid2ev.sensors.spec import DvsSpec
from vid2ev.upsample import METHODS

MOST_STEPS = 64  # of an interval of the finest
STEPS_OF_LOG = 16  # at least, where logarithms are straight: what lies between that and light falls with their square
CAPS = (2, 4, 8, 16, 32)  # of the sub-frames of an interval
NAMES = {"none": "straight light", "linear": "linear", "flow": "flow"}


@dataclass(frozen=True)
class Ladder:
    """The reference, against which the others are measured, and the others."""

    reference: Rung
    rungs: tuple[Rung, ...]

    @property
    def all(self) -> tuple[Rung, ...]:
        """The reference first."""
        return (self.reference, *self.rungs)


class Given:
    """What has been given explicitly: names of options, and the keys of sensors in `overrides`; or names of rungs that
    cannot be taken."""

    def __init__(self, options: Mapping[str, Any], given: Collection[str]):
        keys = [text.partition("=")[0].strip().removeprefix("dvs.") for text in options.get("overrides", ())]
        self._names = {*given} | {*keys}

    def any(self, *names: str) -> bool:
        """Whether one of them is among it."""
        return not self._names.isdisjoint(names)


def ladder_of(recipe: Recipe, given: Given, steps: int) -> Ladder:
    """The ladder for a recipe whose fastest interval takes so many `steps` by default."""
    dvs = [mount.sensor.spec for mount in recipe.mounts if isinstance(mount.sensor.spec, DvsSpec)]
    cis = [mount.sensor.spec for mount in recipe.mounts if isinstance(mount.sensor.spec, CisSpec)]
    finest = _finest(recipe, given, steps, dvs)
    float64 = any(spec.filter == "before" and spec.pole_taus_us for spec in dvs)
    finer = {name: 2 * steps for name, steps in finest.options.items() if name == "subframes"}
    apart = float64 or bool(finer)
    reference = replace(
        finest, name="reference", options={**finest.options, **finer}, float64=float64, offered=not apart
    )
    ways = {
        "light": _light(recipe, given, steps),
        "timing": [] if given.any("timing") else _timing(dvs),
        "filter": [] if given.any("filter") else _filter(dvs),
        "effects": [] if given.any("effects") else _effects([*dvs, *cis], given),
        "frames": _frames(cis, given),
        "views": _views(recipe),
        "size": _size(recipe, given),
    }
    singles = [rung for rungs in ways.values() for rung in rungs]
    rungs = [*([finest] if apart else []), Rung("default"), *singles, *_several({r.name: r for r in singles})]
    return Ladder(reference, tuple(rungs))


def steps_of(recipe: Recipe, seen: Callable[[], object] = lambda: None) -> int:
    """Into how many steps the interval of the source with the most is divided; all of it is read.  `seen` is called
    at every frame of the source."""
    most = steps = 0
    with closing(instants(recipe)) as coming:
        for instant in coming:
            steps += 1
            if instant.original:
                most, steps = max(most, steps), 0
                seen()
    return max(most, 1)


def _finest(recipe: Recipe, given: Given, steps: int, dvs: list[DvsSpec]) -> Rung:
    options: dict[str, Any] = {}
    if _may_divide(recipe, given):
        least = STEPS_OF_LOG if any(_log_is_straight(spec) for spec in dvs) else 2
        options["subframes"] = min(max(2 * steps, least), max(MOST_STEPS, steps))
    inexact = [spec for spec in dvs if spec.timing != "response" and (spec.pole_taus_us or spec.filter == "before")]
    settings = {"timing": "response"} if inexact and not given.any("timing") else {}
    return Rung("finest", "", options, settings)


def _log_is_straight(spec: DvsSpec) -> bool:
    """Whether it is not light but its logarithm that a sensor takes to be straight from frame to frame."""
    return spec.filter == "after" or not spec.pole_taus_us


def _may_divide(recipe: Recipe, given: Given) -> bool:
    fixed = given.any("subframes", "max_subframes")
    return recipe.upsample == "flow" and not recipe.source.dense and not fixed


def _light(recipe: Recipe, given: Given, steps: int) -> list[Rung]:
    """Light between the frames: fewer sub-frames, other methods."""
    rungs: list[Rung] = []
    if _may_divide(recipe, given):
        rungs += [Rung(f"at most {cap} steps", "light", {"max_subframes": cap}) for cap in CAPS if cap < steps]
    if not given.any("upsample", "subframes") and not recipe.source.dense and steps > 1:
        others = [method for method in METHODS if method != recipe.upsample]
        rungs += [Rung(NAMES.get(method, method), "light", {"upsample": method}) for method in others]
    return rungs


def _timing(dvs: list[DvsSpec]) -> list[Rung]:
    straight = all(spec.filter == "after" and not spec.pole_taus_us for spec in dvs)
    ways = ("frame",) if straight else ("linear", "frame")
    names = {"linear": "times on a line", "frame": "times of frames"}
    return [
        Rung(names[way], "timing", settings={"timing": way}) for way in ways if any(spec.timing != way for spec in dvs)
    ]


def _filter(dvs: list[DvsSpec]) -> list[Rung]:
    used = {spec.filter for spec in dvs if spec.pole_taus_us}
    if len(used) != 1:
        return []
    other = "after" if used == {"before"} else "before"
    return [Rung(f"filter {other} log", "filter", settings={"filter": other})]


def _effects(specs: list[DvsSpec | CisSpec], given: Given) -> list[Rung]:
    if not any(spec.effects() for spec in specs):
        return []
    rungs = [Rung(f"effects {word}", "effects", {"effects": word}) for word in ("auto", "none")]
    return [rung for rung in rungs if not given.any(rung.name)]


def _frames(cis: list[CisSpec], given: Given) -> list[Rung]:
    blurred = any("exposure" in spec.effects() for spec in cis)
    ways: dict[str, dict[str, Any]] = {
        "frames without noise": {f"cis.{key}": value for key, value in NOISELESS.items()},
        "frames of an instant": {"cis.blur": False} if blurred else {},
        "lines together": {"cis.line_us": 0.0},
    }
    found = []
    for name, settings in ways.items():
        changes = {key for spec in cis for key, value in settings.items() if getattr(spec, key[4:]) != value}
        wanted = {key: value for key, value in settings.items() if key in changes}
        if wanted and not given.any(*wanted):
            found.append(Rung(name, "frames", settings=wanted))
    return found


def _views(recipe: Recipe) -> list[Rung]:
    """A plane in place of depth that differs from pixel to pixel."""
    if recipe.depth is None or recipe.plane_m is not None or are_free(recipe.rig.source, recipe.mounts):
        return []
    depth = next(recipe.source.frames()).depth
    known = [] if depth is None else depth[np.isfinite(depth) & (depth > 0)]
    if not len(known):
        return []
    return [Rung("plane", "views", {"depth": f"plane:{float(np.median(known)):.3g}"}, offered=False)]


def _size(recipe: Recipe, given: Given) -> list[Rung]:
    width, height = (side // 2 for side in recipe.source.size)
    if not recipe.alone or recipe.source.dense or given.any("size", "rig") or min(width, height) < 16:
        return []
    return [Rung("half the size", "size", {"size": f"{width}x{height}!"}, offered=False, coarse=2)]


def _several(singles: Mapping[str, Rung]) -> list[Rung]:
    """Some that change several things, from much to little; those of which only one part is there are left out."""
    ways = {
        "light": ("filter after log", "at most 8 steps"),
        "lighter": ("times on a line", "at most 4 steps"),
        "least": ("times of frames", "effects none", "straight light"),
    }
    found = []
    for name, parts in ways.items():
        there = [singles[part] for part in parts if part in singles]
        if len(there) > 1:
            together = Rung(name, "several")
            for part in there:
                together = together.with_(part)
            found.append(together)
    return [rung for k, rung in enumerate(found) if all(rung.arguments() != one.arguments() for one in found[:k])]
