"""Plan: which effects of a sensor a scene calls for.

For each effect: what leaving it out changes, what kind of statement that is, and what it costs.  `auto` leaves out, or
replaces, the effects that cost something and whose bounds together stay within the tolerance.  As the root of the
distance is a metric, bounds b_1, b_2, ... are together

    (sqrt b_1 + sqrt b_2 + ...)^2 <= tolerance

Estimates leave out nothing, and what costs nothing stays.  Of pixels whose memory jumps to the signal after each
event (`refractory = "track"`) nearly all are estimates, so of these sensors hardly anything is left out; and all are
where light and leak may cross more levels at once than `max_crossings`, as bounds count all that are crossed, and where
leak alone sends events within the time constant of the distance, as bounds take these to be by themselves.  Of pixels
that start in step with thresholds that are all the same, a bound says only how far apart recordings with nothing in
common are.
Effects are tried in the order of their bounds; the second pole before both.

Costs are of one thread at 1280x720, from the tables of the README and of the kernels' benchmark: nanoseconds per pixel
and frame, and per event.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

from vid2ev.bounds.distance import together
from vid2ev.bounds.scene import DISTANCE_TAU_S, Omission, Scene
from vid2ev.errors import UsageError, nearest
from vid2ev.physics import (
    bad_pixels,
    crossing_noise,
    delay,
    fixed_rate,
    leak,
    mismatch,
    photoreceptor_noise,
    photoreceptor_omission,
    refractory,
    shading,
    shot,
)
from vid2ev.physics.slopes import farthest
from vid2ev.physics.thresholds import least, spread_of
from vid2ev.sensors.cis_spec import EFFECTS as OF_FRAMES
from vid2ev.sensors.record import changed
from vid2ev.sensors.spec import DvsSpec

TOLERANCE = 0.01  # of the distance: a tenth of what 8 bits of a video change, and less
NEAR_S = 10 * DISTANCE_TAU_S  # events of a pixel so far apart add up to 1.0001 times what each counts by itself
FEW = 50  # events: their number is what it is said to be to a seventh, the standard deviation
WORDS = ("auto", "all", "none")
TOO_STEEP = "light jumps by more, and faster, than is measured"


class Effect(NamedTuple):
    """An effect: its omission, the keys that switch it off, and its cost."""

    omission: Callable[[Scene, Any], Omission]
    off: dict[str, Any]
    ns_per_pixel: float
    ns_per_event: float


EFFECTS = {
    "shading": Effect(shading.omission, {"shading": ()}, 0.03, 0),
    "photoreceptor": Effect(photoreceptor_omission.omission, {"photoreceptor_tau_us": 0.0}, 0.6, 20),
    "follower": Effect(photoreceptor_omission.omission_of_follower, {"follower_tau_us": 0.0}, 0.5, 10),
    "bandwidth": Effect(photoreceptor_omission.omission_of_bandwidth, {"bandwidth": "constant"}, 0.6, 5),
    "photoreceptor_noise": Effect(photoreceptor_noise.omission, {"photoreceptor_noise": 0.0}, 0.9, 0),
    "mismatch": Effect(mismatch.omission, {"mismatch": 0.0}, 0, 0),
    "crossing_noise": Effect(crossing_noise.omission, {"crossing_noise": 0.0}, 0, 12),
    "refractory": Effect(refractory.omission, {"refractory_us": 0.0}, 0, 5),
    "leak": Effect(leak.omission, {"leak_rate_hz": 0.0}, 0.05, 5),
    "shot": Effect(shot.omission, {"shot_rate_hz": 0.0}, 0.03, 0),
    "hot": Effect(bad_pixels.omission_of_hot, {"hot_probability": 0.0}, 0, 0),
    "cold": Effect(bad_pixels.omission_of_cold, {"cold_probability": 0.0}, 0, 0),
    "delay": Effect(delay.omission, {"delay_us": 0.0}, 0, 1),
    "fixed_rate": Effect(fixed_rate.omission, {"frame_rate_hz": 0.0}, 0, 100),
}
KNOWN = tuple(dict.fromkeys((*EFFECTS, *OF_FRAMES)))
ASKED_FOR = ("delay", "fixed_rate")  # what events are to be, not what makes them so: never left out by itself


@dataclass(frozen=True)
class Row:
    """An effect in a plan: what becomes of it, what that changes, and why."""

    effect: str
    fate: Literal["kept", "dropped", "replaced"]
    omission: Omission
    ns_per_pixel: float
    ns_per_event: float

    def describe(self) -> dict[str, Any]:
        """The row, ready for JSON."""
        said = self.omission
        return {
            "effect": self.effect,
            "fate": self.fate,
            "distance": said.distance,
            "kind": said.kind,
            "figure": said.figure,
            "why": said.why,
            "ns_per_pixel": self.ns_per_pixel,
            "ns_per_event": self.ns_per_event,
        }


@dataclass(frozen=True)
class Plan:
    """What of a sensor is simulated: a row for each of its effects, and the specification that is left.

    distance   bound on what all that is dropped or replaced changes; None where it was asked for and has no bound
    """

    effects: str
    tolerance: float
    rows: tuple[Row, ...]
    spec: Any  # DvsSpec, or CisSpec of a frame camera
    distance: float | None
    scene: dict[str, Any]

    @property
    def gone(self) -> tuple[str, ...]:
        """The effects that are left out or replaced."""
        return tuple(row.effect for row in self.rows if row.effect in KNOWN and row.fate != "kept")

    def kept_for(self, names: Collection[str], why: str) -> Plan:
        """The plan in which rows of these effects that are kept say why, too."""
        rows = tuple(
            replace(row, omission=replace(row.omission, why=f"{row.omission.why}; {why}"))
            if row.effect in names and row.fate == "kept"
            else row
            for row in self.rows
        )
        return replace(self, rows=rows)

    def describe(self) -> dict[str, Any]:
        """The plan, ready for JSON."""
        rows = [row.describe() for row in self.rows]
        whole = {"effects": self.effects, "tolerance": self.tolerance, "distance": self.distance}
        return whole | {"scene": self.scene, "rows": rows}

    def __str__(self) -> str:
        """The table."""
        head = ("effect", "fate", "distance", "kind", "figure", "cost", "why")
        table = [head, *(_cells(row) for row in self.rows)]
        widths = [max(len(line[k]) for line in table) for k in range(len(head) - 1)]
        lines = ["  ".join(map(str.ljust, line, [*widths, 0])) for line in table]
        return "\n".join([*lines, self.in_all()])

    def in_all(self) -> str:
        """What all that is left out changes, in words."""
        what = "has no bound" if self.distance is None else f"changes the distance by at most {self.distance:.2g}"
        return f"all that is left out {what}, tolerance {self.tolerance:g}"


def _cells(row: Row) -> tuple[str, ...]:
    said = row.omission
    distance = "-" if said.distance is None else f"{said.distance:.2g}"
    costs = ((row.ns_per_pixel, "ns/px"), (row.ns_per_event, "ns/event"))
    cost = ", ".join(f"{ns:g} {unit}" for ns, unit in costs if ns > 0) or "0"
    return row.effect, row.fate, distance, said.kind, said.figure, cost, said.why


def plan_of(
    scene: Scene,
    spec: DvsSpec,
    tolerance: float = TOLERANCE,
    effects: str | Sequence[str] = "auto",
    among: Sequence[str] | None = None,
) -> Plan:
    """The plan for a scene that was measured for `spec`.

    effects  "auto", "all", "none", or the names of those to keep; those without a bound go, too, where that is asked
    among    names of those that auto may leave out, None for any
    Raises UsageError for an effect that there is not, or a specification that cannot be without what is left out.
    """
    check_tolerance(tolerance)
    if scene.finite:
        omissions = {name: _said(EFFECTS[name].omission(scene, spec), scene, spec) for name in spec.effects()}
    else:
        omissions = dict.fromkeys(spec.effects(), Omission(None, "no bound yet", "-", TOO_STEEP))
    return _planned(omissions, spec, tolerance, effects, scene.describe(), among)


def _said(omission: Omission, scene: Scene, spec: DvsSpec) -> Omission:
    """What an omission is said to change: where thresholds differ and light changes, but hardly any event is expected,
    that is no bound, for the few are those of pixels whose thresholds happen to be low; nor is it where light and leak
    may cross more levels at once than are solved one by one, for what bounds count is what is crossed, nor where events
    of the leak come so soon after each other that a distance counts them together."""
    leaked_nat_s = spec.leak_rate_hz * spec.threshold_on
    way_nat = (0.0 if scene.still else float(farthest(scene, spec).max())) + leaked_nat_s * scene.longest_interval_s
    if omission.sure and way_nat >= spec.max_crossings * least(spec):
        why = f"{omission.why}; with max_crossings = {spec.max_crossings} some of it may not be sent"
        return replace(omission, kind="estimate", why=why)
    if omission.sure and leaked_nat_s * NEAR_S > least(spec):
        why = f"{omission.why}; at leak_rate_hz = {spec.leak_rate_hz:g} events of the leak are near each other"
        return replace(omission, kind="estimate", why=why)
    few = scene.events < FEW and scene.slope_max.any() and spread_of(spec) > 0
    return replace(omission, kind="estimate") if few and omission.kind == "99.9 % bound" else omission


def plan_unseen(spec: DvsSpec, why: str, tolerance: float = TOLERANCE, effects: str | Sequence[str] = "auto") -> Plan:
    """The plan for what was not measured, and `why`: "auto" keeps all.

    So it is with what cannot be kept to begin again (`plan.planner` says why).
    Raises UsageError as `plan_of` does.
    """
    check_tolerance(tolerance)
    unseen = Omission(None, "no bound yet", "-", why)
    return _planned(dict.fromkeys(spec.effects(), unseen), spec, tolerance, effects, {})


def _planned(
    omissions: dict[str, Omission],
    spec: DvsSpec,
    tolerance: float,
    effects: str | Sequence[str],
    seen: dict[str, Any],
    among: Sequence[str] | None = None,
) -> Plan:
    used = list(omissions)
    if effects == "auto":
        able = chosen(omissions, among)
        if "follower" in used and "follower" not in able:  # (without which the first pole does not go)
            able.pop("photoreceptor", None)
        gone = _within(able, tolerance)
        changes = dict(change for name in gone for change in omissions[name].replace or EFFECTS[name].off.items())
    else:
        kept = names_of(effects)
        gone = [name for name in used if name not in kept]
        changes = {key: value for name in gone for key, value in EFFECTS[name].off.items()}
    if "photoreceptor" in gone and "bandwidth" in used:
        gone = [*dict.fromkeys([*gone, "bandwidth"])]
        said = omissions["bandwidth"]
        omissions |= {"bandwidth": replace(said, why=f"{said.why}; goes with the first pole")}
    bounds = [omissions[name].distance for name in _counted(gone) if omissions[name].sure]
    distance = together(*bounds) if len(bounds) == len(_counted(gone)) else None  # type: ignore[arg-type]
    if effects != "auto" and {"photoreceptor", "follower", "delay"} & {*gone}:
        distance = None  # (the bounds of the poles are those of a delay in their place)
        omissions |= {name: _without_delay(omissions[name]) for name in gone if omissions[name].replace}
    fates = {name: _fate(name, gone, said, effects == "auto") for name, said in omissions.items()}
    rows = tuple(Row(name, fates[name], said, *EFFECTS[name][2:]) for name, said in omissions.items())
    shown = effects if isinstance(effects, str) else ",".join(effects)
    return Plan(shown, tolerance, rows, changed(spec, changes), distance, seen)


def _without_delay(omission: Omission) -> Omission:
    """What is known of leaving a pole out with nothing in its place."""
    return replace(omission, distance=None, kind="no bound yet", why="all comes earlier: no delay takes its place")


def chosen(omissions: dict[str, Any], among: Sequence[str] | None) -> dict[str, Any]:
    """The omissions of these effects; of all for None."""
    return {name: said for name, said in omissions.items() if among is None or name in among}


def check_tolerance(tolerance: float) -> None:
    """Raise UsageError for a tolerance that is no distance."""
    if not 0 <= tolerance <= 1:
        raise UsageError(f"tolerance {tolerance}: expected a distance from 0 to 1, such as {TOLERANCE}")


def names_of(effects: str | Sequence[str]) -> list[str]:
    """The effects to keep, of a word other than auto, a text with commas, or names; raises UsageError."""
    if effects == "all":
        return list(KNOWN)
    names = [] if effects == "none" else effects.split(",") if isinstance(effects, str) else list(effects)
    for name in names:
        if name not in KNOWN:
            raise UsageError(f"effect '{name}': expected {', '.join([*WORDS, *KNOWN])}{nearest(name, KNOWN)}")
    return names


def _within(omissions: dict[str, Omission], tolerance: float) -> list[str]:
    """The effects to leave out, in order of their bounds."""
    gone: list[str] = []
    able = [name for name in omissions if _costs(name) and name not in ASKED_FOR]
    sure = {name: omissions[name].distance or 0.0 for name in able if omissions[name].sure}
    for name in sorted(sure, key=lambda name: (sure[name], name != "follower")):
        if name in gone:  # (with the first pole, whose delay is that of both)
            continue
        asked = [*gone, name]
        if name == "photoreceptor" and "follower" in omissions and "follower" not in gone:
            asked = [*gone, "follower", name]
        if together(*(sure.get(each, 0.0) for each in _counted(asked))) <= tolerance:
            gone = asked
    return gone


def _counted(gone: Sequence[str]) -> list[str]:
    """Those whose bounds count: that of both poles has the second's in it, and that of the first's bandwidth."""
    return [name for name in gone if name not in ("follower", "bandwidth") or "photoreceptor" not in gone]


def _costs(name: str) -> bool:
    return EFFECTS[name].ns_per_pixel > 0 or EFFECTS[name].ns_per_event > 0


def _fate(name: str, gone: Sequence[str], said: Omission, auto: bool) -> Literal["kept", "dropped", "replaced"]:
    if name not in gone:
        return "kept"
    return "replaced" if auto and said.replace else "dropped"
