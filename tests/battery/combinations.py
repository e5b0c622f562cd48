"""Combinations of what a sensor can be: options, timings, types of light, with as few kernels compiled as can be.

An axis is a choice; a combination takes one of each.  There are millions, and 1 038 kernels among them (four times as
many with the types of light), each of which takes seconds to compile.  So:

    everyday()     kernels that other tests compile as well, crossed in pairs with all that needs no other kernel
    covering(2)    every pair of choices of any two axes, in some combination; covering(3): every three
    share(k, n)    of the whole product, every n-th combination of a fixed shuffle, beginning with the k-th

The everyday ones are in the long suite, covering(2) is in the slow one.  The whole product, in as many shares as one
likes, is

    VID2EV_SHARE=1/1000 python -m pytest tests/battery -m slow

`test_combinations.py` holds that every parameter is on some axis.
"""

from __future__ import annotations

import functools
import itertools
import os
import random
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from against.clips import AFTER_TRACKING, EVERYTHING, clean, noisy, uneven

from vid2ev.sensors.dvs import DvsSpec

Choices = dict[str, Any]  # of one axis, by name
Combination = dict[str, str]  # of each axis, the name of the choice

POLES: Choices = {
    "none": (0.0, 0.0),
    "first": (300.0, 0.0),
    "second": (0.0, 100.0),
    "two": (300.0, 100.0),
    "equal": (200.0, 200.0),
    "nearly equal": (200.0, 200.0 * (1 + 1e-7)),
    "far apart": (1e5, 0.1),
}
# What needs no other kernel: it is data, or comes behind the walk.
FREE: dict[str, Choices] = {
    "thresholds": {"alike": {}, "apart": {"threshold_on": 0.31, "threshold_off": 0.08}},
    "phase": {"in step": {"random_phase": False}, "random": {"random_phase": True}},
    "cold": {"none": {}, "some": {"cold_probability": 0.2}},
    "delay": {"none": {}, "some": {"delay_us": 1234.5}},
    "readout": {"free": {}, "fixed rate": {"frame_rate_hz": 700.0},
                "causal": {"frame_rate_hz": 700.0, "rounding": "causal"}},
    "crossings": {"many": {}, "few": {"max_crossings": 3}},
    "dark": {"some": {}, "little": {"dark_level": 1e-12, "bandwidth_dark": 1e-3, "shot_light_factor": 0.0},
             "much": {"dark_level": 1.0, "bandwidth_dark": 1.0, "shot_light_factor": 1.0}},
}  # fmt: skip
KERNEL: dict[str, Choices] = {
    "poles": {name: dict(zip(("photoreceptor_tau_us", "follower_tau_us"), taus, strict=True))
              for name, taus in POLES.items()},
    "filter": {name: {"filter": name} for name in ("before", "after")},
    "bandwidth": {name: {"bandwidth": name} for name in ("constant", "light")},
    "curve": {name: {"log_curve": name} for name in ("offset", "toe", "v2e")},
    "timing": {name: {"timing": name} for name in ("response", "linear", "frame")},
    "dead time": {"none": {"refractory_us": 0.0}} | {
        name: {"refractory_us": 150.0, "refractory": name} for name in ("quantised", "track")},
    "mismatch": {"none": {}, "some": {"mismatch": 0.02}, "beyond the clip": {"mismatch": 0.5}},
    "crossing noise": {"none": {}, "some": {"crossing_noise": 0.03}, "beyond the clip": {"crossing_noise": 0.5}},
    "leak": {"none": {}, "some": {"leak_rate_hz": 5.0}},
    "forced": {"none": {}, "shot": {"shot_rate_hz": 20.0}, "hot": {"hot_probability": 0.1, "hot_rate_hz": 300.0}},
    "photoreceptor noise": {"none": {}, "some": {"photoreceptor_noise": 0.03}},
    "shading": {"none": {}, "some": {"shading": (0.0, -0.3)}},
}  # fmt: skip
OUTSIDE: dict[str, Choices] = {
    "light": {name: np.dtype(name) for name in ("float32", "float64", "uint8", "uint16")},
    "labels": {"none": False, "some": True},
}
AXES = KERNEL | FREE | OUTSIDE

TWO_POLES = {"photoreceptor_tau_us": 300.0, "follower_tau_us": 100.0}
DEAD = {"refractory_us": 150.0}
COMPILED = {
    "nothing": clean(),
    "ideal": clean(filter="after"),
    "one pole": clean(photoreceptor_tau_us=300),
    "one pole, after": clean(photoreceptor_tau_us=300, filter="after"),
    "two poles": clean(**TWO_POLES),
    "two poles, after": clean(**TWO_POLES, filter="after"),
    "linear": clean(timing="linear"),
    "linear, two poles": clean(**TWO_POLES, timing="linear"),
    "quantised": clean(**TWO_POLES, **DEAD),
    "track, after": clean(**TWO_POLES, **DEAD, filter="after", refractory="track"),
    "leak, shots, hot pixels": noisy(leak_rate_hz=5, shot_rate_hz=20, hot_probability=0.1, hot_rate_hz=300),
    "uneven": uneven(mismatch=0.02, crossing_noise=0.03),
    "paper": DvsSpec(),
    "everything": EVERYTHING,
    "after, tracking": AFTER_TRACKING,
}


class Sensor(NamedTuple):
    """A combination, ready to be made."""

    name: str
    spec: DvsSpec
    light: np.dtype = np.dtype(np.float32)
    labels: bool = False


def everyday() -> list[Sensor]:
    """The kernels that other tests compile, with every choice that is free, and each two of these somewhere."""
    axes = {"kernel": COMPILED} | FREE
    chosen = [_named(c) | {"spec": _free(COMPILED[c["kernel"]], c)} for c in covering_of(axes, 2)]
    return [Sensor(**each) for each in chosen]


def covering(strength: int) -> list[Sensor]:
    """Sensors among which any `strength` choices of different axes that can be together are together somewhere."""
    return [_made(combination) for combination in covering_of(AXES, strength)]


def share(k: int, n: int) -> Iterator[Sensor]:
    """The k-th of n shares of the whole product, k from 1."""
    sizes = [len(choices) for choices in AXES.values()]
    total, rng = int(np.prod(sizes, dtype=object)), random.Random(0)
    step = next(step for step in iter(lambda: rng.randrange(total), None) if np.gcd(step, total) == 1)
    for index in range(k - 1, total, n):
        places = np.unravel_index(index * step % total, sizes)
        combination = {axis: [*choices][place] for (axis, choices), place in zip(AXES.items(), places, strict=True)}
        if _can_be(combination):
            yield _made(combination)


def slow_ones() -> list[Sensor] | Iterator[Sensor]:
    """Every pair of choices, or the share of all that VID2EV_SHARE asks for."""
    if asked := os.environ.get("VID2EV_SHARE"):
        k, n = (int(part) for part in asked.split("/"))
        return share(k, n)
    return covering(2)


@functools.cache
def _groups(names: tuple[str, ...], strength: int) -> list[tuple[str, ...]]:
    return list(itertools.combinations(names, strength))


def covering_of(axes: dict[str, Choices], strength: int) -> list[Combination]:
    """Combinations that together hold each `strength` choices that can be together; greedy, always the same."""
    groups, rng = _groups(tuple(axes), strength), random.Random(strength)
    open_ = {
        tuple(zip(group, choice, strict=True))
        for group in groups
        for choice in itertools.product(*(axes[axis] for axis in group))
        if _can_be(dict(zip(group, choice, strict=True)))
    }
    found: list[Combination] = []
    while open_:
        first = dict(min(open_))
        candidates = [_filled(first, axes, open_, groups, rng) for _ in range(6)]
        best = max(candidates, key=lambda c: len(_held(c, groups) & open_))
        open_ -= _held(best, groups)
        found.append({axis: best[axis] for axis in axes})
    return found


def _filled(first: Combination, axes: dict[str, Choices], open_: set, groups: list, rng: random.Random) -> Combination:
    """A combination with `first` in it, axis by axis the choice that covers most of what is open."""
    chosen, left = dict(first), [axis for axis in axes if axis not in first]
    rng.shuffle(left)
    for axis in left:
        mine = [group for group in groups if axis in group]
        choices = [name for name in axes[axis] if _can_be(chosen | {axis: name})]
        rng.shuffle(choices)
        chosen[axis] = max(choices, key=lambda name: len(_held(chosen | {axis: name}, mine) & open_))
    return chosen


def _held(combination: Combination, groups: Sequence[tuple[str, ...]]) -> set:
    return {
        tuple((axis, combination[axis]) for axis in group) for group in groups if all(a in combination for a in group)
    }


def _can_be(combination: Combination) -> bool:
    """Photoreceptor noise needs two poles."""
    single = combination.get("poles") in ("none", "first", "second")
    return not (single and combination.get("photoreceptor noise") == "some")


def _made(combination: Combination) -> Sensor:
    keys = {key: value for axis in KERNEL for key, value in AXES[axis][combination[axis]].items()}
    spec = _free(clean(**keys), combination)
    light, labels = (OUTSIDE[axis][combination[axis]] for axis in OUTSIDE)
    return Sensor(**_named(combination), spec=spec, light=light, labels=labels)


def _free(spec: DvsSpec, combination: Combination) -> DvsSpec:
    return DvsSpec(**(spec.model_dump() | {k: v for a in FREE for k, v in FREE[a][combination[a]].items()}))


def _named(combination: Combination) -> dict[str, str]:
    """What is not the first choice of its axis."""
    axes: dict[str, Any] = AXES | {"kernel": {}}
    parts = [f"{axis} {name}" if axis != "kernel" else name for axis, name in combination.items()
             if name != next(iter(axes[axis]), None)]  # fmt: skip
    return {"name": ", ".join(parts) or "nothing"}
