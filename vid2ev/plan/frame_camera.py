"""The plan of a frame camera: which of its effects a clip calls for.

As for an event camera, `auto` leaves out what costs something and whose bounds together stay within the tolerance, here
in the distance of `bounds.exposed`: 0.01 lets no level of any exposure change by more than 0.029 LSB.  The exposure
gives way to the light in the middle of it.  A rolling shutter costs nothing and stays, and so do the range and the
rounding of the ADC, which make what the camera sends.

What is left out together changes levels by the sum of the bounds at most: each holds without those before it in the
order noise, fixed pattern, well, shading, exposure.  There is none for exposure and rolling shutter at once, which only
a person asks for.

Costs are nanoseconds per value of an exposure, of one thread; the exposure's is that of the frames of light in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from vid2ev.bounds.distance import together
from vid2ev.bounds.exposed import ROUNDING, Exposed, LevelChange
from vid2ev.physics import adc, electrons, fixed_pattern, shading, shutter
from vid2ev.plan.plan import TOLERANCE, Plan, Row, check_tolerance, chosen, names_of
from vid2ev.sensors.cis_spec import CisSpec
from vid2ev.sensors.record import changed


class FrameEffect(NamedTuple):
    """An effect of a frame camera: its omission, the keys that switch it off, and its cost."""

    omission: Callable[[Exposed, Any], LevelChange]
    off: dict[str, Any]
    ns: float


FRAME_EFFECTS = {
    "exposure": FrameEffect(shutter.omission_of_exposure, {"blur": False}, 0.35),
    "rolling_shutter": FrameEffect(shutter.omission_of_rolling_shutter, {"line_us": 0.0}, 0),
    "shading": FrameEffect(shading.omission_of_levels, {"shading": ()}, 1),
    "fixed_pattern": FrameEffect(fixed_pattern.omission, {"prnu": 0.0, "dsnu": 0.0}, 2),
    "shot_noise": FrameEffect(electrons.omission_of_shot_noise, {"shot_noise": False}, 10),
    "full_well": FrameEffect(electrons.omission_of_full_well, {"full_well_e": 0.0}, 1),
    "read_noise": FrameEffect(electrons.omission_of_read_noise, {"read_noise_e": 0.0}, 5),
    "noise": FrameEffect(adc.omission_of_noise, {"noise_lsb": 0.0}, 5),
}
ALWAYS = {"clip": adc.clipped, "rounding": adc.rounding}


@dataclass(frozen=True)
class FrameRow(Row):
    """An effect in the plan of a frame camera."""

    omission: LevelChange

    def describe(self) -> dict[str, Any]:
        """The row, ready for JSON."""
        levels = self.omission.levels
        return super().describe() | {"max_lsb": levels.most, "rms_lsb": levels.rms}


@dataclass(frozen=True)
class FramePlan(Plan):
    """What of a frame camera is simulated; `distance` is that of `bounds.exposed`."""

    @property
    def max_lsb(self) -> float | None:
        """Bound on the change of a level by all that is left out together [LSB]; None where there is none."""
        return None if self.distance is None else (self.distance / ROUNDING) ** 0.5

    def describe(self) -> dict[str, Any]:
        """The plan, ready for JSON."""
        return super().describe() | {"max_lsb": self.max_lsb}

    def in_all(self) -> str:
        """What all that is left out changes, in words."""
        allowed = f"tolerance {self.tolerance:g}: {(self.tolerance / ROUNDING) ** 0.5:.2g} LSB"
        if self.max_lsb is None:
            return f"what all that is left out changes has no bound, {allowed}"
        return f"all that is left out changes no level by more than {self.max_lsb:.2g} LSB, {allowed}"


def frame_plan_of(
    seen: Exposed,
    spec: CisSpec,
    tolerance: float = TOLERANCE,
    effects: str | Sequence[str] = "auto",
    among: Sequence[str] | None = None,
) -> FramePlan:
    """The plan of a frame camera, for what it sees; `effects`, `among` and errors as for `plan_of`."""
    check_tolerance(tolerance)
    omissions = {name: FRAME_EFFECTS[name].omission(seen, spec) for name in spec.effects()}
    plan = _planned(omissions, spec, tolerance, effects, seen.frames_each, among)
    always = tuple(FrameRow(name, "kept", omission(seen, spec), 0.0, 0.0) for name, omission in ALWAYS.items())
    return replace(plan, rows=(*plan.rows, *always), scene=seen.describe())


def frame_plan_unseen(
    spec: CisSpec, why: str, tolerance: float = TOLERANCE, effects: str | Sequence[str] = "auto"
) -> FramePlan:
    """The plan of a frame camera for what was not measured, and `why`: "auto" keeps all."""
    check_tolerance(tolerance)
    return _planned(
        dict.fromkeys(spec.effects(), LevelChange(None, "no bound yet", "-", why)), spec, tolerance, effects, 1.0
    )


def _planned(
    omissions: dict[str, LevelChange],
    spec: CisSpec,
    tolerance: float,
    effects: str | Sequence[str],
    frames_each: float,
    among: Sequence[str] | None = None,
) -> FramePlan:
    if effects == "auto":
        gone = _within(chosen(omissions, among), tolerance)
    else:
        kept = names_of(effects)
        gone = [name for name in omissions if name not in kept]
    changes = {key: value for name in gone for key, value in FRAME_EFFECTS[name].off.items()}
    bounds = [omissions[name].distance for name in gone]
    known = None not in bounds and not {"exposure", "rolling_shutter"} <= {*gone}
    distance = together(*(bound for bound in bounds if bound is not None)) if known else None
    costs = {name: _cost(name, frames_each) for name in omissions}
    rows = tuple(FrameRow(name, _fate(name, gone, said), said, costs[name], 0.0) for name, said in omissions.items())
    shown = effects if isinstance(effects, str) else ",".join(effects)
    return FramePlan(shown, tolerance, rows, changed(spec, changes), distance, {})


def _within(omissions: dict[str, LevelChange], tolerance: float) -> list[str]:
    """The effects to leave out, in order of their bounds."""
    gone: list[str] = []
    bounds = {
        name: said.distance
        for name, said in omissions.items()
        if said.distance is not None and FRAME_EFFECTS[name].ns > 0
    }
    for name in sorted(bounds, key=bounds.__getitem__):
        if together(*(bounds[each] for each in [*gone, name])) <= tolerance:
            gone.append(name)
    return gone


def _cost(name: str, frames_each: float) -> float:
    each = FRAME_EFFECTS[name].ns
    return round(each * max(frames_each, 1.0), 2) if name == "exposure" else each


def _fate(name: str, gone: Sequence[str], said: LevelChange) -> Any:
    if name not in gone:
        return "kept"
    return "replaced" if said.replace else "dropped"
