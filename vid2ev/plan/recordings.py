"""The plans of a recording: every camera's own, from one look at what all of them see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from vid2ev.plan.expose import Expose
from vid2ev.plan.frame_camera import frame_plan_of, frame_plan_unseen
from vid2ev.plan.measure import Measure
from vid2ev.plan.plan import TOLERANCE, Plan, check_tolerance, names_of, plan_of, plan_unseen
from vid2ev.plan.subframes import Subframes
from vid2ev.plan.views import DepthRange, view_row
from vid2ev.seen.instants import Instant, instants
from vid2ev.seen.mounts import Mount
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.spec import DvsSpec
from vid2ev.sources import Source

Plans = Mapping[str, Plan]  # by the name of the camera, "" for the only one
PASSES = "the source passes once: what is to come is not known"
ASKED = "as asked for: the source was not measured"


def plans_of(
    recipe: Recipe, effects: str | Sequence[str] = "auto", tolerance: float = TOLERANCE, threads: int = 1
) -> dict[str, Plan]:
    """The plan of each camera, from a look at the whole source, made denser in time as for a recording, which does
    without (`plan.planner`).  `threads` see and measure, and change nothing but the time it takes.

    A camera that goes on and on is not looked at, and auto keeps all of it.  Raises UsageError as `plan_of` does.
    """
    check_effects(effects, tolerance)
    if _is_endless(recipe.source):
        return plans_unseen(recipe, PASSES, effects, tolerance)
    look = Look(recipe, threads)
    with closing(instants(recipe, threads=threads)) as seen:
        for instant in seen:
            look.see(instant)
    return look.plans(effects, tolerance)


class Look:
    """A look at what the cameras of a recipe see: `see` each instant, then ask for the `plans`."""

    def __init__(self, recipe: Recipe, threads: int):
        self.recipe = recipe
        self._cameras = {mount.name: _measure(mount, threads) for mount in recipe.mounts}
        self._subframes, self._depth = Subframes(), DepthRange()

    def see(self, instant: Instant) -> None:
        """The next instant."""
        self._subframes.see(instant)
        self._depth.see(instant.depth if instant.original else None)
        for mount, frame in zip(self.recipe.mounts, instant.frames, strict=True):
            if mount.name in self._cameras:
                self._cameras[mount.name].see(frame)

    def forget(self, name: str) -> None:
        """Look no longer at what a camera sees; there are no more plans for it."""
        del self._cameras[name]

    def plans(
        self,
        effects: str | Sequence[str],
        tolerance: float,
        among: Mapping[str, Sequence[str]] | None = None,
    ) -> dict[str, Plan]:
        """The plan of each camera that is looked at, for what was seen so far; `among` limits what auto may leave out,
        by the camera's name."""
        recipe, plans = self.recipe, dict[str, Plan]()
        shared = () if recipe.source.dense or recipe.upsample != "flow" else (self._subframes.row(),)
        for mount in recipe.mounts:
            if mount.name in self._cameras:
                able = None if among is None else among[mount.name]
                speed_px_per_s = self._subframes.speed_px_per_s
                plan = _plan(self._cameras[mount.name], effects, tolerance, speed_px_per_s, able)
                view = () if recipe.alone else (view_row(mount, recipe, self._depth),)
                plans[mount.name] = replace(plan, rows=(*view, *shared, *plan.rows))
        return plans


def plans_unseen(recipe: Recipe, why: str, effects: str | Sequence[str], tolerance: float) -> dict[str, Plan]:
    """The plans of cameras that were not looked at, and `why`."""
    plans: dict[str, Plan] = {}
    for mount in recipe.mounts:
        spec = mount.sensor.spec
        if isinstance(spec, DvsSpec):
            plans[mount.name] = plan_unseen(spec, why, tolerance, effects)
        else:
            plans[mount.name] = frame_plan_unseen(spec, why, tolerance, effects)
    return plans


def _is_endless(source: Source) -> bool:
    """Whether a source may never end: a camera that is not told when to stop."""
    return not source.rewindable and source.kept is None and source.duration_expected_s is None


def _measure(mount: Mount, threads: int) -> Measure | Expose:
    spec = mount.sensor.spec
    return Measure(spec, mount.size, threads) if isinstance(spec, DvsSpec) else Expose(spec, mount.size)


def _plan(
    camera: Measure | Expose,
    effects: str | Sequence[str],
    tolerance: float,
    speed_px_per_s: float | None,
    among: Sequence[str] | None,
) -> Plan:
    if isinstance(camera, Measure):
        return plan_of(camera.scene(), camera.spec, tolerance, effects, among)
    return frame_plan_of(camera.exposed(speed_px_per_s), camera.spec, tolerance, effects, among)


def planned(recipe: Recipe, effects: str | Sequence[str], tolerance: float = TOLERANCE) -> tuple[Recipe, Plans]:
    """The recipe with what is left of the sensors by effects other than "auto", and the plans that say so; of all
    effects it is the same, and there are none.  The source is not looked at."""
    if effects == "all":
        return recipe, {}
    check_effects(effects, tolerance)
    plans = plans_unseen(recipe, ASKED, effects, tolerance)
    return left_of(recipe, plans), plans


def left_of(recipe: Recipe, plans: Plans) -> Recipe:
    """The recipe with what its plans leave of the sensors."""
    mounts = [
        replace(mount, sensor=mount.sensor._replace(spec=plans[mount.name].spec)) if mount.name in plans else mount
        for mount in recipe.mounts
    ]
    return replace(recipe, mounts=tuple(mounts))


def check_effects(effects: str | Sequence[str], tolerance: float) -> None:
    """Raise UsageError for effects that cannot be meant."""
    check_tolerance(tolerance)
    if effects != "auto":
        names_of(effects)


def described(plans: Plans) -> dict[str, Any]:
    """The plans, ready for the manifest; nothing where there are none."""
    return {"plan": {name: plan.describe() for name, plan in plans.items()}} if plans else {}
