"""Effects left out of sensors, one at a time: the measured change and its bound; drawn sensors; the table of all."""

from __future__ import annotations

import math
import random
from collections import defaultdict
from collections.abc import Iterable
from statistics import median
from typing import NamedTuple

import pytest

from vid2ev.plan.plan import ASKED_FOR, EFFECTS, TOLERANCE, plan_of
from vid2ev.sensors.spec import DvsSpec

from .clips import clip, distance, is_there, sent, without
from .measured import scene_of

MATTERS = TOLERANCE / 5


class Trial(NamedTuple):
    """An effect left out of a sensor that sees a clip."""

    effect: str
    measured: float
    bound: float
    fate: str
    sure: bool

    @property
    def in_vain(self) -> bool:
        """Whether it costs something, changes next to nothing, and stays."""
        effect = EFFECTS[self.effect]
        costs = effect.ns_per_pixel > 0 or effect.ns_per_event > 0
        return costs and self.effect not in ASKED_FOR and self.fate == "kept" and self.measured < MATTERS

    @property
    def broken(self) -> bool:
        """Whether it changes more than its bound; estimates have none."""
        return self.sure and self.measured > self.bound

    def __str__(self) -> str:
        marks = "?" * self.in_vain + "!" * self.broken + "~" * (not self.sure)
        return f"{self.effect} {self.measured:.2g}/{self.bound:.2g}{self.fate[0]}{marks}"


class Outcome(NamedTuple):
    """A sensor that sees a clip: each effect left out, and what all that `auto` leaves out changes together."""

    sensor: str
    trials: list[Trial]
    changed: float
    frames: int


def tried(name: str, sensor: str, spec: DvsSpec, seed: int = 0) -> Outcome:
    """Every effect of a sensor left out of a clip; a line of it is printed."""
    if not is_there(name):
        pytest.skip(f"the data of {name} are not there")
    size, frames = clip(name)
    plan, full = plan_of(scene_of(spec, size, frames), spec), sent(spec, size, frames, seed)
    trials = []
    for row in plan.rows:
        if row.omission.distance is not None:
            left = sent(without(spec, row.effect, row.omission), size, frames, seed)
            said = row.omission
            trials.append(Trial(row.effect, distance(full, left, size), float(said.distance), row.fate, said.sure))
    changed = distance(full, sent(plan.spec, size, frames, seed), size)
    print(f"{sensor:10}{name:18}{changed:8.2g}  {'  '.join(map(str, trials))}", flush=True)
    return Outcome(sensor, trials, changed, len(frames))


def hold(outcome: Outcome) -> None:
    """No change beyond its bound, nor all that auto leaves out beyond the tolerance."""
    assert outcome.frames >= 30
    assert not [str(trial) for trial in outcome.trials if trial.broken]
    assert outcome.changed <= TOLERANCE


def table(outcomes: Iterable[Outcome]) -> dict[tuple[str, str], list[float]]:
    """Bound / measured by sensor and effect, where the effect matters; the table of all is printed."""
    trials, ratios = defaultdict(list), {}
    for outcome in outcomes:
        for trial in outcome.trials:
            trials[outcome.sensor, trial.effect].append(trial)
    print(f"{'sensor':10}{'effect':20}clips  broken  bound/measured: median, most, of  small ones left out")
    for (sensor, effect), each in sorted(trials.items()):
        found = ratios[sensor, effect] = [t.bound / t.measured for t in each if t.measured > MATTERS]
        small = [t.fate != "kept" for t in each if t.measured <= MATTERS]
        loose = f"{median(found):6.1f} {max(found):8.1f} {len(found):4}" if found else " " * 20
        broken = sum(t.broken for t in each)
        print(f"{sensor:10}{effect:20}{len(each):5}{broken:8}{'':16}{loose}{sum(small):9} of {len(small)}")
    return ratios


def drawn(seed: int) -> DvsSpec:
    """A sensor of drawn parameters: all effects that the plan knows but noise of the photoreceptor, delays and event
    frames."""
    draws = random.Random(seed)

    def between(least: float, most: float) -> float:
        return math.exp(draws.uniform(math.log(least), math.log(most)))

    def some(chance: float, value: float, otherwise: float = 0.0) -> float:
        return value if draws.random() < chance else otherwise

    threshold = between(0.08, 0.5)
    return DvsSpec(
        threshold_on=threshold,
        threshold_off=threshold * some(0.5, between(0.7, 1.4), 1.0),
        mismatch=some(0.7, threshold * between(0.01, 0.2)),
        crossing_noise=some(0.5, threshold * between(0.01, 0.25)),
        refractory_us=some(0.8, between(5, 3000)),
        refractory=draws.choice(["quantised", "track"]),
        leak_rate_hz=some(0.6, between(0.01, 3)),
        shot_rate_hz=some(0.4, between(0.01, 5)),
        shot_light_factor=draws.uniform(0, 1),
        photoreceptor_tau_us=some(0.85, between(10, 3000)),
        follower_tau_us=some(0.7, between(5, 1000)),
        filter=draws.choice(["before", "after"]),
        bandwidth=draws.choice(["constant", "light"]),
        bandwidth_dark=between(0.01, 1),
        dark_level=between(1e-4, 0.03),
        log_curve=draws.choice(["offset", "offset", "toe", "v2e"]),
        shading=draws.choice([(), (0.0, -0.5), (0.1, -0.3), (-0.3, -0.2, 0.1)]),
        hot_probability=some(0.3, between(1e-4, 0.01)),
        cold_probability=some(0.3, between(1e-4, 0.01)),
        random_phase=draws.random() < 0.8,
    )
