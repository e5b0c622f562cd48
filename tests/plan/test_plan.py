"""Plans: what is left out changes no more than its bound, on clips of all kinds; decisions, tables, refusals."""

from __future__ import annotations

import json
import math
from functools import cache

import numpy as np
import pytest
from against.clips import clean

from vid2ev.bounds.chances import at_least, at_most, surely
from vid2ev.bounds.distance import added, delayed, off_by, together, unlike
from vid2ev.bounds.scene import Scene
from vid2ev.errors import UsageError
from vid2ev.physics.leak import _off
from vid2ev.physics.omission import by_itself, light_events, noise_events
from vid2ev.physics.peaks import taken
from vid2ev.physics.shading import shading_map
from vid2ev.plan.plan import EFFECTS, Plan, plan_of
from vid2ev.sensors.presets import load_sensor, preset_names
from vid2ev.sensors.spec import DvsSpec
from vid2ev.stream import Events, Frame

from .clips import clip, distance, sent, without
from .measured import scene_of

QUIET = {"mismatch": 0.0, "crossing_noise": 0.0}
NO_POLES = {"photoreceptor_tau_us": 0.0, "follower_tau_us": 0.0}
POLES = DvsSpec(**QUIET, refractory_us=0)


@cache
def scene(name: str, spec: DvsSpec = POLES) -> Scene:
    size, frames = clip(name)
    return scene_of(spec, size, frames)


def changed(name: str, spec: DvsSpec, effect: str) -> tuple[float, float]:
    """The distance that leaving an effect out makes, and its bound."""
    size, frames = clip(name)
    said = EFFECTS[effect].omission(scene(name, spec), spec)
    assert said.sure, said.why
    left = without(spec, effect, said)
    return distance(sent(spec, size, frames), sent(left, size, frames), size), said.distance


@pytest.mark.parametrize("effect", ["follower", "photoreceptor"])
def test_a_pole_that_gives_way_to_a_delay_changes_less_than_its_bound(effect: str) -> None:
    measured, bound = changed("edge", POLES, effect)
    assert 0 < measured <= bound <= 10 * measured


def test_auto_keeps_within_the_tolerance() -> None:
    """What auto leaves out of the paper's sensor changes no more than it says, and no more than was asked."""
    size, frames = clip("edge")
    spec = POLES
    for tolerance in (0.0, 0.005, 0.05):
        plan = plan_of(scene("edge"), spec, tolerance)
        assert plan.distance is not None and plan.distance <= tolerance
        assert distance(sent(spec, size, frames), sent(plan.spec, size, frames), size) <= plan.distance
    assert plan.spec.pole_taus_us == () and plan.spec.delay_us == 400
    assert [row.fate for row in plan.rows] == ["replaced", "replaced"]


def test_of_poles_the_first_does_not_go_without_the_second() -> None:
    plan = plan_of(scene("edge"), POLES, 1.0, among=["photoreceptor", "refractory"])
    assert plan.gone == () and plan.spec == POLES
    assert plan_of(scene("edge"), POLES, 1.0, among=["follower"]).gone == ("follower",)


@pytest.mark.parametrize("effects", ["auto", "bandwidth"])
def test_a_bandwidth_goes_with_its_pole(effects: str) -> None:
    """In light in which a pole of the bandwidth at light 1 is farther off than a delay in its place."""
    spec = clean(photoreceptor_tau_us=100.0, bandwidth="light", bandwidth_dark=1.0, random_phase=True)
    seen = scene_of(spec, (24, 16), ramps(size=(24, 16)))
    first, second = (EFFECTS[name].omission(seen, spec).distance for name in ("photoreceptor", "bandwidth"))
    assert first is not None and second is not None and first < second
    plan = plan_of(seen, spec, 1.001 * first, effects)
    assert plan.gone == ("photoreceptor", "bandwidth") and plan.spec.effects() == ["delay"] * (effects == "auto")
    assert plan.rows[1].omission.why.endswith("; goes with the first pole")
    assert plan.distance == (pytest.approx(first) if effects == "auto" else None)


@pytest.mark.parametrize("size", [(64, 48), (27, 60)])
def test_a_shading_is_looked_at_up_to_the_corners(size: tuple[int, int]) -> None:
    spec = clean(shading=(0.0, -0.5))
    frames = [Frame(np.full(size[::-1], 0.3, np.float32), k * 1_000_000) for k in range(3)]
    figure = EFFECTS["shading"].omission(scene_of(spec, size, frames), spec).figure
    assert f"light x {shading_map(spec.shading, *size).min():.2g} to 1 " in figure


def test_what_costs_nothing_and_what_is_an_estimate_stay() -> None:
    spec = DvsSpec(hot_probability=1e-9, cold_probability=1e-9, frame_rate_hz=1000)
    plan = plan_of(scene("edge", spec), spec, 1.0)
    fates = {row.effect: row.fate for row in plan.rows}
    assert [fates[name] for name in ("mismatch", "crossing_noise", "hot", "cold", "fixed_rate")] == ["kept"] * 5
    assert plan.spec.mismatch == spec.mismatch and plan.spec.frame_rate_hz == 1000


@pytest.mark.parametrize("name", preset_names())
def test_every_effect_of_every_preset_has_a_row(name: str) -> None:
    spec = load_sensor(name)
    plan = plan_of(scene("edge", spec), spec)
    assert [row.effect for row in plan.rows] == spec.effects()
    for row in plan.rows:
        assert row.omission.why and (row.omission.distance is None or np.isfinite(row.omission.distance))
        assert row.effect in str(plan)
    assert json.loads(json.dumps(plan.describe(), allow_nan=False))["rows"] == plan.describe()["rows"]


@pytest.mark.parametrize("shots", [False, True])
@pytest.mark.parametrize("name", preset_names())
def test_where_no_time_passes_nothing_is_sent_and_nothing_changes(name: str, shots: bool) -> None:
    """In a single picture, or where a shot begins with every one."""
    spec = load_sensor(name)
    frames = [Frame(np.full((8, 8), 0.1 + 0.2 * k, np.float32), k * 1_000_000, cut=True) for k in range(1 + 3 * shots)]
    plan = plan_of(scene_of(spec, (8, 8), frames), spec)
    assert all(row.omission.distance in (0.0, None) for row in plan.rows if row.effect == "leak")
    assert all(row.omission.distance is None or np.isfinite(row.omission.distance) for row in plan.rows)


@pytest.mark.parametrize("pictures", [30, 60])
def test_of_few_events_more_may_be_rounded_up_than_is_to_be_expected(pictures: int) -> None:
    """A delay of half a microsecond in place of a pole: each event is off by 0 or 1."""
    spec = DvsSpec(**QUIET, refractory_us=0, photoreceptor_tau_us=0.0, follower_tau_us=0.5)
    rounds, beyond = 40, 0
    for phase in range(rounds):
        lights = [0.3 * (1 + 0.9 * math.sin(0.4 * k + 0.1571 * phase)) for k in range(pictures)]
        frames = [Frame(np.full((1, 1), light, np.float32), 5_000_000 * k) for k, light in enumerate(lights)]
        said = EFFECTS["follower"].omission(scene_of(spec, (1, 1), frames), spec)
        left = without(spec, "follower", said)
        beyond += distance(sent(spec, (1, 1), frames), sent(left, (1, 1), frames), (1, 1)) > said.distance
    assert beyond == 0


def test_effects_by_name() -> None:
    spec = DvsSpec()
    seen = scene("edge", spec)
    assert plan_of(seen, spec, effects="all").spec == spec
    none = plan_of(seen, spec, effects="none")
    assert none.spec.effects() == [] and none.distance is None and "no bound" in str(none)
    for names in ("mismatch,refractory", ["refractory", "mismatch"]):
        assert plan_of(seen, spec, effects=names).spec.effects() == ["mismatch", "refractory"]


def test_of_poles_that_are_left_out_by_name_with_no_delay_in_their_place_nothing_is_known() -> None:
    rows = {row.effect: row for row in plan_of(scene("edge"), POLES, effects="photoreceptor").rows}
    assert rows["follower"].fate == "dropped" and rows["follower"].omission.distance is None
    assert rows["photoreceptor"].fate == "kept" and rows["photoreceptor"].omission.distance


@pytest.mark.parametrize(
    ("effects", "tolerance", "words"),
    [("mismach", 0.01, "did you mean mismatch"), ("auto", 2.0, "tolerance 2.0"), ("auto", float("nan"), "tolerance")],
)
def test_what_cannot_be_meant_is_refused(effects: str, tolerance: float, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        plan_of(scene("edge"), POLES, tolerance, effects)


def test_noise_without_its_poles_is_refused() -> None:
    spec = DvsSpec(photoreceptor_noise=0.03)
    with pytest.raises(UsageError, match="photoreceptor_noise"):
        plan_of(scene("edge", spec), spec, effects="photoreceptor_noise")
    assert plan_of(scene("edge", spec), spec, 1.0).spec.pole_taus_us == (300.0, 100.0)


def test_of_pixels_in_step_nothing_is_known() -> None:
    spec = clean(photoreceptor_tau_us=300, follower_tau_us=100, random_phase=False)
    plan = plan_of(scene("edge", spec), spec, 1.0)
    assert all((row.omission.distance or 0.0) > 1.0 for row in plan.rows) and plan.spec == spec


def test_a_still_scene_needs_no_poles() -> None:
    frames = [Frame(np.full((8, 8), 0.3, np.float32), k * 1_000_000) for k in range(5)]
    spec = DvsSpec(shot_rate_hz=10)
    plan = plan_of(scene_of(spec, (8, 8), frames), spec, 0.0)
    assert plan.spec.pole_taus_us == () and plan.spec.delay_us == 0 and plan.spec.shot_rate_hz == 10
    assert isinstance(plan, Plan) and plan.distance == 0.0


@pytest.mark.long
def test_where_nothing_moves_the_leak_still_sends_events_that_move_with_the_thresholds() -> None:
    frames = [Frame(np.full((8, 8), 0.3, np.float32), k * 100_000_000) for k in range(20)]
    spec = DvsSpec(mismatch=0.02, leak_rate_hz=3.0, refractory_us=0, crossing_noise=0, **NO_POLES)
    bound = EFFECTS["mismatch"].omission(scene_of(spec, (8, 8), frames), spec).distance
    left = without(spec, "mismatch", EFFECTS["mismatch"].omission(scene_of(spec, (8, 8), frames), spec))
    assert 0.2 < distance(sent(spec, (8, 8), frames), sent(left, (8, 8), frames), (8, 8)) <= bound


@pytest.mark.long
@pytest.mark.parametrize("moving", [0, 3, 384])
@pytest.mark.parametrize(
    ("effect", "more"),
    [("refractory", {"refractory": "track"}), ("refractory", {"timing": "frame"}), ("fixed_rate", {})],
)
def test_noise_that_comes_while_a_pixel_is_blind_from_noise_is_bounded(effect: str, more: dict, moving: int) -> None:
    """Where nothing moves, too: all that is sent is noise."""
    size, times = (24, 16), range(0, 300_000_000, 5_000_000)
    across, number = np.arange(24), np.arange(384).reshape(16, 24)
    for noise, blind_s in (({"shot_rate_hz": 20.0}, 0.02), ({"shot_rate_hz": 100.0}, 0.001),
                           ({"shot_rate_hz": 5.0, "hot_probability": 0.1, "hot_rate_hz": 100.0}, 0.005)):  # fmt: skip
        moved = (0.5 * np.exp(0.3 * np.sin(0.8 * (across - 2e-8 * t_ns))) for t_ns in times)
        frames = [
            Frame(np.where(number < moving, light, 0.5).astype(np.float32), t_ns)
            for light, t_ns in zip(moved, times, strict=True)
        ]
        how = {"refractory_us": 1e6 * blind_s} if effect == "refractory" else {"frame_rate_hz": 1 / blind_s}
        spec = DvsSpec(**(NO_POLES | {"threshold_on": 0.2, "threshold_off": 0.2} | noise | how | more))
        said = EFFECTS[effect].omission(scene_of(spec, size, frames), spec)
        left = without(spec, effect, said)
        assert 0.005 < distance(sent(spec, size, frames), sent(left, size, frames), size) <= said.distance


@pytest.mark.long
@pytest.mark.parametrize("step", [0.05, 0.3])
def test_without_a_readouts_clock_events_are_as_near_each_other_as_light_makes_them(step: float) -> None:
    lights = [0.3 * math.exp(8 * step * abs(k % 8 - 4)) for k in range(48)]
    frames = [Frame(np.full((4, 4), light, np.float32), 5_000_000 * k) for k, light in enumerate(lights)]
    spec = DvsSpec(**NO_POLES, threshold_on=0.1, threshold_off=0.1, refractory_us=0, frame_rate_hz=100)
    said = EFFECTS["fixed_rate"].omission(scene_of(spec, (4, 4), frames), spec)
    left = without(spec, "fixed_rate", said)
    assert 0.5 < distance(sent(spec, (4, 4), frames), sent(left, (4, 4), frames), (4, 4)) <= said.distance


def test_by_what_is_argued_of_memories_that_jump_nothing_is_left_out() -> None:
    """Whatever noise there is; the refractory period's own bound is how dense events are, and no estimate."""
    for noise in (0.0, 0.03):
        spec = DvsSpec(mismatch=0, crossing_noise=noise, refractory="track", shot_rate_hz=0.1, leak_rate_hz=0.1)
        plan = plan_of(scene("edge", spec), spec, 0.5)
        kinds = {row.effect: row.omission.kind for row in plan.rows}
        assert {kinds[name] for name in ("follower", "photoreceptor", "leak", "shot")} == {"estimate"}
        assert plan.gone == () and plan.distance == 0.0 and kinds["refractory"] == "99.9 % bound"


def test_errors_of_memories_that_jump_stay_what_share_of_a_cycle_they_are() -> None:
    """Two pixels on one signal, a little apart, when the slope changes: on average over even phases the error grows as
    the way from event to event does, theta + R slope."""
    threshold, blind, before, after, start, bend = 0.2, 5e-4, 300.0, 900.0, 0.0, 0.02

    def crossing(level: np.ndarray) -> np.ndarray:
        return np.where(level < bend * before, level / before, bend + (level - bend * before) / after)

    def signal(t_s: np.ndarray) -> np.ndarray:
        return np.where(t_s < bend, before * t_s, before * bend + after * (t_s - bend))

    way = threshold + blind * before
    memories = np.linspace(start, start + way, 200_000, endpoint=False)[:, None] + np.array([0.0, 1e-6])
    for _ in range(60):  # (events, well beyond the bend)
        memories = signal(crossing(memories + threshold) + blind)
    grown = float(np.abs(memories[:, 1] - memories[:, 0]).mean()) / 1e-6
    assert grown == pytest.approx((threshold + blind * after) / way, rel=0.01)


@pytest.mark.parametrize("ratio", [0.003, 0.01, 0.03, 0.1, 0.3, 0.7, 0.95, 1.001, 3.0])
def test_a_turn_is_rounded_off_by_the_second_pole_no_more_than_is_said(ratio: float) -> None:
    """The peak of a signal that turns from slope r to -r', behind both poles and behind the first, delayed; and where
    the poles are far from each other and r' is not much less than r, not much less, either."""
    tau1, tau2 = 1.0, ratio
    t = np.concatenate([np.linspace(0, 20 * tau, 200_001) for tau in (tau1, tau2)])
    t = np.unique(np.concatenate([t, np.geomspace(1e-6, 20 * max(tau1, tau2), 100_000)]))
    for share in np.geomspace(1e-4, 0.9999, 50):  # r'
        before, after = 1.0 - share, share
        first = -after * (t - tau1) - tau1 * np.exp(-t / tau1)
        both = -after * (t - tau1 - tau2)
        both -= (tau1**2 * np.exp(-t / tau1) - tau2**2 * np.exp(-t / tau2)) / (tau1 - tau2)
        lower = float(first.max() - both.max())
        said = float(taken(*map(np.float32, (before, after, 0.0, tau1, tau2))))
        assert lower <= said * 1.001
        assert said <= 1.3 * lower or ratio > 0.3 or share > 0.9


@pytest.mark.parametrize("left", [-0.5, -0.1, 0.1, 0.5])
def test_what_is_left_of_earlier_bends_is_counted_at_a_turn(left: float) -> None:
    """Light that is bent a while before it turns, behind poles near each other: worst if that was long before."""
    tau1, tau2, t = 1.0, 0.4, np.linspace(0, 25, 1_000_001)
    for share in np.linspace(0.05, 0.95, 10):
        before, after = 1.0 - share, share
        if before + left < 0.0:
            continue  # (it turned before)
        bend = before + left + after  # (what the first pole's slope is at the turn is `before` and what is left)
        first = -after * (t - tau1) - tau1 * bend * np.exp(-t / tau1)
        late = -left * tau2**2 / (tau1 - tau2)  # of the second pole, behind a slope that decays
        both = -after * (t - tau1 - tau2) + late * np.exp(-t / tau2)
        both -= bend * (tau1**2 * np.exp(-t / tau1) - tau2**2 * np.exp(-t / tau2)) / (tau1 - tau2)
        said = float(taken(*map(np.float32, (before, after, abs(left), tau1, tau2))))
        assert abs(first.max() - both.max()) <= said * 1.001


def test_recordings_with_nothing_in_common_are_no_further_apart_than_by_their_density() -> None:
    seen = scene("edge")
    assert unlike(seen, 3.0, 0.0) == pytest.approx(3.0) and unlike(seen, 3.0) == pytest.approx(6.0)
    assert unlike(seen, 3.0, 0.0) < unlike(seen, 3.0, 1e-4) <= unlike(seen, 3.0, 1.0) <= unlike(seen, 3.0)


def test_a_recording_is_no_denser_than_light_and_blind_pixels_let_it_be() -> None:
    """D of events that are each R after the last is n / 2 coth(R / (2 tau))."""
    seen = scene("edge")
    assert by_itself(seen, POLES) == seen.bunched > 1.2
    for blind in ({"refractory_us": 3001.0}, {"frame_rate_hz": 1e6 / 3000}):
        spec = POLES.model_copy(update=blind)
        assert by_itself(seen, spec) == pytest.approx(1 / math.tanh(1.5)) and by_itself(seen, spec) < seen.bunched
    events = Events(np.arange(0, 6_000_000, 3000), *(np.zeros(2000, kind) for kind in (np.uint16, np.uint16, np.uint8)))
    assert distance(events, Events.empty(), (1, 1)) == pytest.approx(1 / math.tanh(1.5), rel=1e-3)


def test_event_frames_bring_events_nearer_to_each_other() -> None:
    """By times that are off by up to half a frame, at random."""
    seen, rate_hz = scene("edge"), 10_000.0
    x = np.random.default_rng(2).uniform(-0.5, 0.5, (2, 400_000)) / rate_hz * 1e3
    nearer = np.exp(x[0] - x[1]).mean()
    found = by_itself(seen, POLES.model_copy(update={"frame_rate_hz": rate_hz}))
    assert found == pytest.approx(1 + nearer * (seen.bunched - 1), rel=1e-4) and nearer > 1.0005


def test_a_leak_costs_by_the_time_that_levels_drift() -> None:
    """Half of the clip if the light moves evenly, and no longer than to the next event of shot noise that is sure to
    set both memories: also those of pixels that are blind, but not where memories jump to the signal."""
    size, frames = clip("sine")
    bounds = {}
    for kind, blind_us in (("quantised", 0.0), ("quantised", 100.0), ("track", 100.0)):
        for rate_hz in (0.0, 40.0):
            blind = {"refractory": kind, "refractory_us": blind_us}
            spec = DvsSpec(**QUIET, leak_rate_hz=0.02, shot_rate_hz=rate_hz, **blind)
            bounds[kind, blind_us, rate_hz] = _off(scene_of(spec, size, frames), spec)
    seen = scene("sine")
    plain = off_by(
        seen, np.full(len(seen.travel), 0.02 * POLES.threshold_on * seen.seconds), echoes=False, one_way=True
    )
    for blind_us in (0.0, 100.0):
        assert bounds["quantised", blind_us, 0] == pytest.approx(0.5 * plain, rel=0.1)
        assert bounds["quantised", blind_us, 40] < 0.35 * bounds["quantised", blind_us, 0]
    assert bounds["track", 100, 40] == pytest.approx(bounds["track", 100, 0])


def test_laws_of_the_bounds() -> None:
    seen = scene("edge")
    error = np.full(len(seen.travel), 1e-3)
    assert 0 < off_by(seen, error, echoes=False) < off_by(seen, 2 * error, echoes=False)
    assert delayed(seen, 0 * error, 0 * error, 0 * seen.by_bends) == 0
    few, some = 1e-5 * error, 1e-2 * error
    assert delayed(seen, few, some, seen.by_peaks) >= delayed(seen, few, some, 0 * seen.by_peaks)
    assert surely(seen, 1e-3) > 1e-3 and surely(seen, 0.0) == 0
    assert together(0.01, 0.04) == pytest.approx(0.09)
    assert added(10.0, 0.0, 0.0) == 0 and added(10.0, 20.0, 0.0) == pytest.approx(0.5)
    for mean in (3.0, 40.0):
        draws = np.random.default_rng(1).poisson(mean, 100_000)
        assert np.mean(draws > at_most(mean)) < 1e-3 and np.mean(draws < at_least(mean)) < 1e-3


def trembling(reach_nat: float, frames: int = 300) -> list[Frame]:
    """Light of all pixels that falls and rises, again and again, so far [nat]."""
    level = reach_nat * np.abs((0.03 * np.arange(frames) + 0.5) % 1 * 2 - 1)
    return [Frame(np.full((48, 64), 0.2 * np.exp(-each), np.float32), k * 1_000_000) for k, each in enumerate(level)]


@pytest.mark.long
@pytest.mark.parametrize("effect", ["follower", "photoreceptor", "mismatch", "crossing_noise"])
def test_light_that_trembles_below_the_mean_threshold_moves_pixels_of_lower_ones(effect: str) -> None:
    size, spec, frames = (64, 48), DvsSpec(), trembling(0.12)
    seen = scene_of(spec, size, frames)
    said = EFFECTS[effect].omission(seen, spec)
    full, left = sent(spec, size, frames), sent(without(spec, effect, said), size, frames)
    assert len(full) > 50 and 0 < distance(full, left, size) <= said.distance


def test_of_hardly_any_events_of_thresholds_that_differ_nothing_is_sure() -> None:
    spec = DvsSpec()
    plan = plan_of(scene_of(spec, (64, 48), trembling(0.01)), spec, 1.0)
    assert plan.gone in ((), ("refractory",)) and "estimate" in {row.omission.kind for row in plan.rows}


def test_of_light_that_crosses_more_levels_at_once_than_are_solved_nothing_is_sure() -> None:
    """What bounds count is what is crossed; beyond `max_crossings` not all of it is sent."""
    size, frames = (32, 24), ramps()
    for cap in (1, 2, 4096):
        spec = POLES.model_copy(update={"max_crossings": cap})
        plan, full = plan_of(scene_of(spec, size, frames), spec, 1.0), sent(spec, size, frames)
        assert plan.gone == (("photoreceptor", "follower") if cap == 4096 else ())
        assert (f"max_crossings = {cap}" in str(plan)) == (cap != 4096)
        for row in plan.rows:
            changed = distance(full, sent(without(spec, row.effect, row.omission), size, frames), size)
            assert row.omission.sure == (changed <= row.omission.distance) == (cap == 4096)


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("apart_ms", [10, 1000])
def test_of_a_leak_that_crosses_more_levels_at_once_than_are_solved_nothing_is_sure(apart_ms: int, moves: bool) -> None:
    """In the longest interval, whatever the light does; 40 levels are crossed in a second."""
    size = (4, 3)
    lights = [np.full(size[::-1], 0.3 * (1 + 0.9 * moves * math.sin(k)), np.float32) for k in range(4)]
    frames = [Frame(light, k * apart_ms * 1_000_000) for k, light in enumerate(lights)]
    spec = clean(leak_rate_hz=40.0, random_phase=True, shot_rate_hz=0.1, max_crossings=39)
    plan = plan_of(scene_of(spec, size, frames), spec, 1.0)
    capped = apart_ms == 1000
    assert all(("max_crossings = 39" in row.omission.why) == capped != row.omission.sure for row in plan.rows)


@pytest.mark.parametrize("hz", [20.0, 2000.0])
def test_of_a_leak_whose_events_are_near_each_other_nothing_is_sure(hz: float) -> None:
    """2000 a second by themselves are coth(1/4) = 4.1 from none, four times what nothing in common counts."""
    size, frames = (4, 3), [Frame(np.full((3, 4), 0.3, np.float32), k * 100_000_000) for k in range(11)]
    spec = clean(leak_rate_hz=hz, random_phase=True)
    plan, said = plan_of(scene_of(spec, size, frames), spec, 1.0), EFFECTS["leak"]
    changed = distance(sent(spec, size, frames), sent(spec.model_copy(update=said.off), size, frames), size)
    (row,) = plan.rows
    assert row.omission.sure == (changed <= row.omission.distance * (1 + 1e-3)) == (hz == 20.0)
    assert plan.gone == (("leak",) if hz == 20.0 else ()) and ("near each other" in str(plan)) == (hz != 20.0)


@pytest.mark.long
@pytest.mark.parametrize("share", [0.6, 3.0])
def test_pixels_of_low_thresholds_send_more_densely(share: float) -> None:
    """What is spread as far as thresholds may be: mismatch, and pixels that are silent."""
    spec = clean(filter="after", random_phase=True, mismatch=0.1 * share, cold_probability=0.2, threshold_on=0.1)
    spec = spec.model_copy(update={"threshold_off": 0.1})
    phase = np.linspace(0, 6, 64)[None] + np.zeros((48, 1))
    lights = [0.2 * np.exp(1.5 * np.sin(0.03 * k + phase)).astype(np.float32) for k in range(300)]
    size, frames = (64, 48), [Frame(light, k * 1_000_000) for k, light in enumerate(lights)]
    for effect in ("mismatch", "cold"):
        said = EFFECTS[effect].omission(scene_of(spec, size, frames), spec)
        left = sent(without(spec, effect, said), size, frames)
        assert distance(sent(spec, size, frames), left, size) <= said.distance


@pytest.mark.long
@pytest.mark.parametrize("effect", ["cold", "delay", "refractory"])
def test_events_of_a_frame_that_come_at_once_are_dense(effect: str) -> None:
    more = {"cold": {"cold_probability": 0.2}, "delay": {"delay_us": 300.0}, "refractory": {"refractory_us": 100.0}}
    spec = clean(filter="after", random_phase=True, timing="frame", threshold_on=0.1, threshold_off=0.1, **more[effect])
    bright = np.exp(1.2 * np.random.default_rng(0).random((48, 64)))
    lights = [(0.1 * (bright if k % 2 else 1 + 0 * bright)).astype(np.float32) for k in range(20)]
    size, frames = (64, 48), [Frame(light, k * 33_000_000) for k, light in enumerate(lights)]
    said = EFFECTS[effect].omission(scene_of(spec, size, frames), spec)
    left = sent(without(spec, effect, said), size, frames)
    assert 0 < distance(sent(spec, size, frames), left, size) <= said.distance


@pytest.mark.parametrize("curve", ["toe", "v2e"])
def test_curves_with_a_knee_are_as_steep_as_they_are(curve: str) -> None:
    """Light that is straight between frames: the slope is that of the curve in the darker of the two."""
    for dark, bright in ((0.01, 0.012), (0.078, 0.0784), (0.08, 0.09), (0.5, 0.6)):
        frames = [Frame(np.full((4, 4), light, np.float32), k * 1_000_000) for k, light in enumerate((dark, bright))]
        slope = scene_of(clean(log_curve=curve), (4, 4), frames).slope_max[0]
        per_nat = {"toe": 20 / 255, "v2e": 20 / 255 / math.log(20)}[curve] if dark < 20 / 255 else dark
        assert slope == pytest.approx((bright - dark) / 1e-3 / per_nat, rel=1e-4)


@pytest.mark.parametrize("curve", ["offset", "toe", "v2e"])
def test_while_a_pixel_is_blind_a_signal_goes_no_farther_than_its_light(curve: str) -> None:
    """However steep it is, and for however long that is; of light of 0.3 nat no event is swallowed by 0.4."""
    dark = 1e-3 if curve == "offset" else 0.0
    for dim, bright in ((0.3, 0.4), (0.1, 0.9)):
        lights = [np.full((4, 4), light, np.float32) for light in (dim, bright)]
        frames = [Frame(light, k * 1_000_000) for k, light in enumerate(lights)]
        nat = math.log((bright + dark) / (dim + dark))
        for bandwidth, blind_us in (("constant", 1e3), ("constant", 1e6), ("light", 1e6)):
            more = {"refractory_us": blind_us, "bandwidth": bandwidth, "photoreceptor_tau_us": 50.0}
            spec = clean(log_curve=curve, threshold_on=0.4, threshold_off=0.4, **more)
            said = EFFECTS["refractory"].omission(scene_of(spec, (4, 4), frames), spec)
            assert float(said.figure.split()[2]) <= nat * 1.05
            assert (said.distance == 0.0) == (nat < 0.4)


def test_both_poles_give_way_to_the_delay_of_both() -> None:
    """Also where the bound of both is the less, as their delay is nearer to a whole microsecond."""
    frames = [Frame(np.full((16, 16), 0.05 * 1.1**k, np.float32), k * 1_000_000) for k in range(30)]
    spec = DvsSpec(**QUIET, refractory_us=0, photoreceptor_tau_us=41.7, follower_tau_us=172.3)
    plan = plan_of(scene_of(spec, (16, 16), frames), spec, 1.0)
    distances = {row.effect: row.omission.distance for row in plan.rows}
    assert distances["photoreceptor"] < distances["follower"]
    assert plan.gone == ("photoreceptor", "follower") and plan.spec.delay_us == 214


@pytest.mark.parametrize("effect", ["cold", "delay"])
def test_where_nothing_moves_events_of_the_leak_are_later_or_missing_all_the_same(effect: str) -> None:
    frames = [Frame(np.full((48, 64), 0.3, np.float32), k * 20_000_000) for k in range(60)]
    spec = DvsSpec(**QUIET, **NO_POLES, refractory_us=0, leak_rate_hz=3.0, cold_probability=0.1, delay_us=500)
    said = EFFECTS[effect].omission(scene_of(spec, (64, 48), frames), spec)
    left = sent(without(spec, effect, said), (64, 48), frames)
    assert 0 < distance(sent(spec, (64, 48), frames), left, (64, 48)) <= said.distance


@pytest.mark.parametrize("readout", [{}, {"refractory_us": 5000}, {"refractory_us": 300, "frame_rate_hz": 200.0}])
@pytest.mark.parametrize("noise", [
    {"shot_rate_hz": 3e3}, {"hot_probability": 0.3, "hot_rate_hz": 2e4}, {"hot_probability": 0.3, "hot_rate_hz": 9.0},
])  # fmt: skip
def test_noise_is_sent_as_often_as_is_said_also_where_pixels_are_blind(noise: dict, readout: dict) -> None:
    spec, size = clean(**({"refractory_us": 0.0} | noise | readout)), (64, 48)
    frames = [Frame(np.full((48, 64), 0.25, np.float32), k * 10_000_000) for k in range(31)]
    least, most = noise_events(scene_of(spec, size, frames), spec)
    many = len(sent(spec, size, frames))
    assert 0 < least <= many <= most and least > 0.5 * many


def flashing(contrast_nat: float, dt_ns: int, frames: int, size: tuple[int, int] = (32, 24)) -> list[Frame]:
    """Light of all pixels that is bright in every other frame."""
    lights = [np.full(size[::-1], 0.2 * math.exp(contrast_nat * (k % 2)), np.float32) for k in range(frames)]
    return [Frame(light, k * dt_ns) for k, light in enumerate(lights)]


def ramps(frames: int = 40, size: tuple[int, int] = (32, 24)) -> list[Frame]:
    """Light that goes up and down by 1.2 nat in 12 ms, and stays as long at its ends, each pixel a little later."""
    width, height = size
    phase = np.linspace(0, 1, width * height).reshape(height, width)
    lights = [0.2 * np.exp(1.2 * np.clip(2 - np.abs((k / 3 + phase) % 8 - 4), -0.5, 0.5)) for k in range(frames)]
    return [Frame(light.astype(np.float32), k * 4_000_000) for k, light in enumerate(lights)]


def held(spec: DvsSpec, size: tuple[int, int], frames: list[Frame], *effects: str) -> None:
    """Hold the bounds of these effects against what leaving them out changes."""
    seen, full = scene_of(spec, size, frames), sent(spec, size, frames)
    for effect in effects:
        said = EFFECTS[effect].omission(seen, spec)
        assert said.kind == "99.9 % bound"
        changed = distance(full, sent(without(spec, effect, said), size, frames), size)
        assert 0 < changed <= said.distance, effect


@pytest.mark.parametrize("cut", [None, 2])
def test_what_a_shading_has_set_apart_by_the_end_of_a_shot_stays_so(cut: int | None) -> None:
    """Of light that goes one way no pixel turns before."""
    texture = np.exp(np.random.default_rng(91).normal(-1.5, 1, (32, 48)))
    levels = [0.0, -0.1, -0.2] if cut is None else [0.0, -0.1, 1.0, 0.9]
    frames = [
        Frame((texture * math.exp(level)).astype(np.float32), 80_000 * k, cut=k == cut)
        for k, level in enumerate(levels)
    ]
    thresholds = {"threshold_on": 0.09, "threshold_off": 0.09 if cut else 0.14}
    spec = clean(shading=(-0.3, -0.2, 0.1), dark_level=0.08, random_phase=True, **thresholds)
    held(spec, (48, 32), frames, "shading")


@pytest.mark.long
@pytest.mark.parametrize("more", [{"mismatch": 0.015}, {"crossing_noise": 0.01}, {"threshold_off": 0.2}])
def test_what_trembling_light_has_brought_to_rest_is_not_counted_on(more: dict) -> None:
    """Levels that are farther apart than light goes: plays have hundreds of events for each one that is sent."""
    spec = clean(random_phase=True, shot_rate_hz=0.05, hot_probability=0.02, hot_rate_hz=10.0, **more)
    level = 0.2 * np.abs((np.arange(1500) / 20) % 1 * 2 - 1)
    frames = [Frame(np.full((24, 32), 0.2 * math.exp(each), np.float32), k * 1_000_000) for k, each in enumerate(level)]
    held(spec, (32, 24), frames, "shot", "hot")


@pytest.mark.long
def test_less_is_sent_at_least_than_by_any_thresholds() -> None:
    """Of trembling light, of light that goes one way all pixels send what plays have."""
    size, thresholds = (64, 48), {"threshold_on": 0.15, "threshold_off": 0.2}
    spec = clean(random_phase=True, crossing_noise=0.02, filter="after", **thresholds)
    rising = [Frame(np.full((48, 64), 0.01 * math.exp(0.05 * k), np.float32), k * 1_000_000) for k in range(60)]
    for frames, all_of_it in ((trembling(0.3), False), (trembling(1.0), False), (rising, True)):
        least = light_events(scene_of(spec, size, frames), spec)
        many = len(sent(spec, size, frames))
        assert least <= 1.01 * many and (not all_of_it or least >= 0.95 * many)


@pytest.mark.long
@pytest.mark.parametrize("timing", ["response", "frame"])
def test_pixels_that_are_blind_may_be_set_to_the_other_half_of_a_flicker(timing: str) -> None:
    """Shots have them send ON events of light whose OFF events they would send; other pixels see a slow ramp."""
    spec = clean(random_phase=True, shot_rate_hz=2.5, shot_light_factor=1.0, refractory_us=90.0, timing=timing)
    frames = flashing(0.2, 50_000, 800)
    for frame in frames:
        frame.light[:, 16:] = 0.2 * math.exp(frame.t_ns * 1e-7)
    held(spec, (32, 24), frames, "shot")


@pytest.mark.long
def test_events_that_hot_pixels_do_not_send_of_light_are_as_dense_as_these() -> None:
    spec = clean(random_phase=True, hot_probability=0.1, hot_rate_hz=1.0, threshold_on=0.1, threshold_off=0.1)
    held(spec, (32, 24), flashing(3.0, 200_000, 200), "hot")


@pytest.mark.long
def test_pixels_that_send_nothing_of_light_leave_the_bounds_of_other_effects_true() -> None:
    """Even where most are cold: events of light and those that effects add are counted in all pixels."""
    bad = {"hot_probability": 0.4, "hot_rate_hz": 20.0, "cold_probability": 0.7}
    spec = clean(random_phase=True, threshold_on=0.1, threshold_off=0.1, shot_rate_hz=0.5, leak_rate_hz=0.2, **bad)
    held(spec, (64, 48), trembling(0.3, 120), "shot", "leak", "hot", "cold")


@pytest.mark.long
def test_where_nothing_moves_the_photoreceptors_noise_sends_events() -> None:
    """Which move with thresholds, are swallowed, missing and late; and auto leaves out nothing that they depend on."""
    frames = [Frame(np.full((24, 32), 0.3, np.float32), k * 1_000_000) for k in range(40)]
    noisy = {"photoreceptor_noise": 0.04, "photoreceptor_tau_us": 300.0, "follower_tau_us": 100.0}
    spec = DvsSpec(**noisy, mismatch=0.05, crossing_noise=0.03, refractory_us=3000.0, cold_probability=0.1, delay_us=50)
    held(spec, (32, 24), frames, "photoreceptor_noise", "mismatch", "crossing_noise", "refractory", "cold", "delay")
    plan = plan_of(scene_of(spec, (32, 24), frames), spec, 0.5)
    assert not {"crossing_noise", "refractory"} & {*plan.gone}


def scrolling(px_s: float, fps: float, seconds: float, size: tuple[int, int] = (48, 32)) -> list[Frame]:
    """Blocks of 4 pixels, bright and dark as 19 to 1, that scroll to the left."""
    blocks = np.random.default_rng(5).random((size[1] // 4, 150)) < 0.5
    wide = 0.05 + 0.9 * np.kron(blocks, np.ones((4, 4)))
    frames = []
    for k in range(round(seconds * fps) + 1):
        whole, part = divmod(px_s * k / fps, 1)
        shown = [wide[:, int(whole) + by : int(whole) + by + size[0]] for by in (0, 1)]
        light = (1 - part) * shown[0] + part * shown[1]
        frames.append(Frame(light.astype(np.float32), round(1e9 * k / fps)))
    return frames


@pytest.mark.long
@pytest.mark.parametrize("theta", [0.15, 0.05, 0.02])
@pytest.mark.parametrize("mismatch", [0.0, 0.3])
@pytest.mark.parametrize(("px_s", "fps"), [(120, 120), (3000, 6000)])
def test_where_signals_are_several_levels_apart_their_number_counts_squared(
    theta: float, mismatch: float, px_s: float, fps: float
) -> None:
    frames = scrolling(px_s, fps, min(0.4, 240 / fps))
    spec = DvsSpec(
        threshold_on=theta, threshold_off=theta, mismatch=mismatch * theta, crossing_noise=0.0, refractory_us=0
    )
    held(spec, (48, 32), frames, "follower", "photoreceptor", *["mismatch"] * (mismatch > 0))


@pytest.mark.long
@pytest.mark.parametrize("dt_us", [30, 100, 300, 1000])
@pytest.mark.parametrize("taus_us", [(300.0, 100.0), (0.0, 18.0), (40.0, 0.0)])
def test_shots_that_end_before_the_poles_have_answered(dt_us: int, taus_us: tuple[float, float]) -> None:
    """Where a delay in their place lets nothing through."""
    draw = np.random.default_rng(3)
    lights = [draw.uniform(0.1, 1.0, (24, 32)).astype(np.float32) for _ in range(2)]
    frames = [Frame(light, 1000 * dt_us * k) for k, light in enumerate(lights)]
    spec = DvsSpec(photoreceptor_tau_us=taus_us[0], follower_tau_us=taus_us[1], refractory_us=0)
    held(spec, (32, 24), frames, *["follower"] * (taus_us[1] > 0), *["photoreceptor"] * (taus_us[0] > 0))


@pytest.mark.parametrize(("rounding", "border_us"), [("causal", 0), ("nearest", 500)])
def test_at_a_fixed_rate_what_comes_a_little_later_may_come_a_period_later(rounding: str, border_us: int) -> None:
    """Light that moves for a tenth of each period of the readout, and ends just before the border of event frames."""
    texture, level = np.random.default_rng(1).uniform(0.3, 1, (24, 32)), 0.0
    frames = [Frame(texture.astype(np.float32), 0)]
    for k in range(1, 600):
        begin, end = 1000 * k + border_us - 110, 1000 * k + border_us - 10
        frames.append(Frame((texture * np.exp(level)).astype(np.float32), 1000 * begin))
        level += 0.002 if k // 300 % 2 == 0 else -0.002
        frames.append(Frame((texture * np.exp(level)).astype(np.float32), 1000 * end))
    spec = DvsSpec(
        frame_rate_hz=1000, rounding=rounding, photoreceptor_tau_us=0.0, follower_tau_us=10.0, refractory_us=0
    )
    held(spec, (32, 24), frames, "follower")


@pytest.mark.parametrize("thresholds", [(0.03, 0.03), (0.1, 0.03), (0.15, 0.15)])
def test_of_thresholds_as_wide_as_they_are_spread_nothing_is_said_by_levels(thresholds: tuple[float, float]) -> None:
    draw = np.random.default_rng(8)
    texture = np.random.default_rng(7).uniform(0.02, 1, (36, 48))
    codes = [np.clip(np.rint(255 * (texture + draw.normal(0, 0.01, texture.shape))), 0, 255) for _ in range(80)]
    frames = [Frame((each / 255).astype(np.float32), 12_000_000 * k) for k, each in enumerate(codes)]
    spec = DvsSpec(
        threshold_on=thresholds[0], threshold_off=thresholds[1], mismatch=0.7 * thresholds[1],
        crossing_noise=0.7 * thresholds[1], refractory_us=0,
    )  # fmt: skip
    held(spec, (48, 36), frames, "follower", "photoreceptor", "mismatch", "crossing_noise")


def test_a_change_of_every_event_is_its_mean_however_few_there_are() -> None:
    size, frames = clip("edge")
    seen = scene_of(POLES, size, frames)
    for mean in (1e-9, 1e-6, 1e-3, 0.5):
        assert surely(seen, mean) >= mean


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("more", [{}, {"refractory": "track"}, {"shading": (0.0, -0.5)}, {"bandwidth": "light"}])
def test_of_light_that_jumps_beyond_all_slopes_nothing_is_known(more: dict) -> None:
    """From the dark to the brightest light in a nanosecond: a slope beyond float32, of which no bound is a number."""
    spec = DvsSpec(leak_rate_hz=0.1, shot_rate_hz=1.0, **more)
    frames = [Frame(np.full((3, 4), level, np.float32), k) for k, level in enumerate((0.0, np.inf, 0.5, 0.5, 0.2))]
    plan = plan_of(scene_of(spec, (4, 3), frames), spec, 1.0)
    assert plan.spec == spec and {row.omission.kind for row in plan.rows} == {"no bound yet"}
    assert "jumps" in str(plan) and json.dumps(plan.describe(), allow_nan=False)
