"""The plans of a recording: every event camera's own, from one look at what all of them see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from vid2ev.errors import UsageError
from vid2ev.instants import instants
from vid2ev.plan.measure import Measure
from vid2ev.plan.plan import TOLERANCE, Plan, check_tolerance, names_of, plan_of
from vid2ev.recipe import Recipe
from vid2ev.sensors.spec import DvsSpec

Plans = Mapping[str, Plan]  # by the name of the camera, "" for the only one


def plans_of(recipe: Recipe, effects: str | Sequence[str] = "auto", tolerance: float = TOLERANCE) -> dict[str, Plan]:
    """The plan of each event camera; the source is read once, and made denser in time as for a recording.

    Raises UsageError for a source that cannot be read again, and as `plan_of` does.
    """
    check_effects(recipe, effects, tolerance)
    measures: list[Measure | None] = []
    for mount in recipe.mounts:
        spec = mount.sensor.spec
        measures.append(Measure(spec, mount.size) if isinstance(spec, DvsSpec) else None)
    with closing(instants(recipe)) as seen:
        for instant in seen:
            for measure, frame in zip(measures, instant.frames, strict=True):
                if measure is not None:
                    measure.see(frame)
    return {
        mount.name: plan_of(measure.scene(), measure.spec, tolerance, effects)
        for mount, measure in zip(recipe.mounts, measures, strict=True)
        if measure is not None
    }


def planned(recipe: Recipe, effects: str | Sequence[str], tolerance: float = TOLERANCE) -> tuple[Recipe, Plans]:
    """The recipe with what its plans leave of the sensors; of all effects it is the same, and there are no plans."""
    if effects == "all":
        return recipe, {}
    plans = plans_of(recipe, effects, tolerance)
    mounts = [
        replace(mount, sensor=mount.sensor._replace(spec=plans[mount.name].spec)) if mount.name in plans else mount
        for mount in recipe.mounts
    ]
    return replace(recipe, mounts=tuple(mounts)), plans


def check_effects(recipe: Recipe, effects: str | Sequence[str], tolerance: float) -> None:
    """Raise UsageError for effects that cannot be meant, or cannot be planned for this source."""
    check_tolerance(tolerance)
    if effects != "auto":
        names_of(effects)
    if effects != "all" and not recipe.source.rewindable:
        raise UsageError(f"{recipe.video} passes once and cannot be measured before; leave --effects out")


def described(plans: Plans) -> dict[str, Any]:
    """The plans, ready for the manifest; nothing where there are none."""
    return {"plan": {name: plan.describe() for name, plan in plans.items()}} if plans else {}
