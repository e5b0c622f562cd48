"""The plans of a recording: every camera's own, from one look at what all of them see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from vid2ev.instants import instants
from vid2ev.mounts import Mount
from vid2ev.plan.expose import Expose
from vid2ev.plan.frame_camera import frame_plan_of, frame_plan_unseen
from vid2ev.plan.measure import Measure
from vid2ev.plan.plan import TOLERANCE, Plan, check_tolerance, names_of, plan_of, plan_unseen
from vid2ev.plan.subframes import Subframes
from vid2ev.plan.views import DepthRange, view_row
from vid2ev.recipe import Recipe
from vid2ev.sensors.spec import DvsSpec

Plans = Mapping[str, Plan]  # by the name of the camera, "" for the only one
PASSES = "the source passes once: what is to come is not known"
ASKED = "as asked for: the source was not measured"


def plans_of(
    recipe: Recipe, effects: str | Sequence[str] = "auto", tolerance: float = TOLERANCE, threads: int = 1
) -> dict[str, Plan]:
    """The plan of each camera; the source is read once, and made denser in time as for a recording, which then does
    the same again.  `threads` measure, and change nothing but the time it takes.

    A source that passes once is not read: all that auto keeps of it is all.  Raises UsageError as `plan_of` does.
    """
    check_effects(recipe, effects, tolerance)
    if not recipe.source.rewindable:
        return _unseen(recipe, PASSES, effects, tolerance)
    cameras = [_measure(mount, threads) for mount in recipe.mounts]
    subframes, depth = Subframes(), DepthRange()
    with closing(instants(recipe)) as seen:
        for instant in seen:
            subframes.see(instant)
            depth.see(instant.depth if instant.original else None)
            for camera, frame in zip(cameras, instant.frames, strict=True):
                camera.see(frame)
    shared = () if recipe.source.dense or recipe.upsample != "flow" else (subframes.row(),)
    plans: dict[str, Plan] = {}
    for mount, camera in zip(recipe.mounts, cameras, strict=True):
        plan = _plan(camera, effects, tolerance, subframes.speed_px_per_s)
        view = () if recipe.alone else (view_row(mount, recipe, depth),)
        plans[mount.name] = replace(plan, rows=(*view, *shared, *plan.rows))
    return plans


def _unseen(recipe: Recipe, why: str, effects: str | Sequence[str], tolerance: float) -> dict[str, Plan]:
    plans: dict[str, Plan] = {}
    for mount in recipe.mounts:
        spec = mount.sensor.spec
        if isinstance(spec, DvsSpec):
            plans[mount.name] = plan_unseen(spec, why, tolerance, effects)
        else:
            plans[mount.name] = frame_plan_unseen(spec, why, tolerance, effects)
    return plans


def _measure(mount: Mount, threads: int) -> Measure | Expose:
    spec = mount.sensor.spec
    return Measure(spec, mount.size, threads) if isinstance(spec, DvsSpec) else Expose(spec, mount.size)


def _plan(
    camera: Measure | Expose, effects: str | Sequence[str], tolerance: float, speed_px_per_s: float | None
) -> Plan:
    if isinstance(camera, Measure):
        return plan_of(camera.scene(), camera.spec, tolerance, effects)
    return frame_plan_of(camera.exposed(speed_px_per_s), camera.spec, tolerance, effects)


def planned(
    recipe: Recipe, effects: str | Sequence[str], tolerance: float = TOLERANCE, threads: int = 1
) -> tuple[Recipe, Plans]:
    """The recipe with what its plans leave of the sensors; of all effects it is the same, and there are no plans.

    Only "auto" has to look at the source for it.
    """
    if effects == "all":
        return recipe, {}
    check_effects(recipe, effects, tolerance)
    asked = effects != "auto"
    plans = _unseen(recipe, ASKED, effects, tolerance) if asked else plans_of(recipe, effects, tolerance, threads)
    mounts = [
        replace(mount, sensor=mount.sensor._replace(spec=plans[mount.name].spec)) if mount.name in plans else mount
        for mount in recipe.mounts
    ]
    return replace(recipe, mounts=tuple(mounts)), plans


def check_effects(recipe: Recipe, effects: str | Sequence[str], tolerance: float) -> None:
    """Raise UsageError for effects that cannot be meant."""
    check_tolerance(tolerance)
    if effects != "auto":
        names_of(effects)


def described(plans: Plans) -> dict[str, Any]:
    """The plans, ready for the manifest; nothing where there are none."""
    return {"plan": {name: plan.describe() for name, plan in plans.items()}} if plans else {}
