"""Plans of frame cameras: what is left out changes no more than its bound, on clips of all kinds; decisions, tables.

Measured with an ADC of 16 bits and I16 as its codes, a 55th of an LSB of 10 bits: rounding then adds up to one code.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections import defaultdict
from functools import cache

import numpy as np
import pytest
from scipy.stats import binom, norm, poisson

from vid2ev.bounds.exposed import (
    Change,
    Exposed,
    LevelChange,
    level_change,
    normal_most,
    poisson_most,
    surely_square,
)
from vid2ev.errors import UsageError
from vid2ev.plan.expose import Expose
from vid2ev.plan.exposure_sums import OVERFULL, SUMS, add_change, add_light
from vid2ev.plan.frame_camera import ALWAYS, FRAME_EFFECTS, frame_plan_of, frame_plan_unseen
from vid2ev.plan.plan import KNOWN, names_of
from vid2ev.seen.instants import instants
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.cis import Cis
from vid2ev.sensors.cis_spec import EFFECTS, CisSpec
from vid2ev.sensors.presets import cis_names, load_cis
from vid2ev.stream import Frame

from .clips import MADE, REAL, SCENES, VIDEOS, clip

slow = pytest.mark.slow
QUICK = ("edge", "sine", "karma")
FINE = 55.0  # codes of this test to an LSB of 10 bits
PLAIN = CisSpec(colour=False, bits=16, slope=1, min_illuminance=0, frame_rate_hz=60, exposure_us=0, noise_lsb=0)
USES = {
    "exposure": {"exposure_us": 9000},
    "rolling_shutter": {"line_us": 60, "exposure_us": 2000},
    "shading": {"shading": (-0.1, -0.3), "exposure_us": 2000},
    "fixed_pattern": {"prnu": 0.01, "dsnu": 3},
    "shot_noise": {"shot_noise": True, "white_e": 5000},
    "full_well": {"full_well_e": 2500, "white_e": 5000},
    "full_well of a gain": {"full_well_e": 2500, "white_e": 2500, "exposure_gain": 2},
    "full_well of shots": {"full_well_e": 2500, "white_e": 5000, "shot_noise": True, "prnu": 0.01},
    "read_noise": {"read_noise_e": 3, "white_e": 5000},
    "noise": {"noise_lsb": 5.2 * FINE},
}
ratios: dict[str, list[float]] = defaultdict(list)


@cache
def frames(name: str) -> tuple[tuple[int, int], list[Frame]]:
    if name in REAL and not VIDEOS.is_dir():
        pytest.skip(f"{VIDEOS} is not there")
    if name not in SCENES:
        return clip(name)
    recipe = Recipe.of(f"scene:{name},size=64x48", sensor="ideal", stop=0.15)
    return recipe.mounts[0].size, [instant.frames[0] for instant in instants(recipe)]


def exposed(spec: CisSpec, size: tuple[int, int], light: list[Frame]) -> Exposed:
    measure = Expose(spec, size)
    for frame in light:
        measure.see(frame)
    return measure.exposed()


def codes(spec: CisSpec, size: tuple[int, int], light: list[Frame]) -> np.ndarray:
    return np.array([each.codes for each in Cis(spec, size, seed=3).run(light)], np.float64)


def changed(spec: CisSpec, effect: str, size: tuple[int, int], light: list[Frame]) -> tuple[float, float, LevelChange]:
    """The greatest change of a code that leaving an effect out makes, the rms of all, and what is said of it."""
    said = FRAME_EFFECTS[effect].omission(exposed(spec, size, light), spec)
    one, other = codes(spec, size, light), codes(spec.model_copy(update=FRAME_EFFECTS[effect].off), size, light)
    change = one - other[: len(one)]
    assert said.sure and len(one) > 5
    return float(np.abs(change).max()), float(np.sqrt(np.mean(change**2))), said


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else slow) for name in [*MADE, *REAL, *SCENES]]
)
def test_what_is_left_out_changes_less_than_its_bound(name: str) -> None:
    size, light = frames(name)
    for use, keys in USES.items():
        effect = use.partition(" ")[0]
        most, rms, said = changed(PLAIN.model_copy(update=keys), effect, size, light)
        assert most <= said.levels.most + 1, use
        assert rms <= said.levels.rms + 1, use
        if most > FINE * math.sqrt(0.01 / 5 / 12):  # (where it matters: a fifth of the tolerance)
            ratios[use].append(said.levels.most / most)
            ratios[f"{use}, rms"].append(said.levels.rms / rms)


def test_bounds_are_near_what_they_bound() -> None:
    """Of the clips before: medians of bound / measured where the effect matters."""
    if not ratios:
        pytest.skip("the clips were not looked at")
    medians = {use: float(np.median(found)) for use, found in ratios.items()}
    print("\n" + "\n".join(f"{use:26} {median:6.3f} of {len(ratios[use])}" for use, median in medians.items()))
    assert max(medians.values()) <= 10
    assert all(medians[f"{use}{end}"] < 1.05 for use in ("exposure", "rolling_shutter") for end in ("", ", rms"))


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("electrons", [{}, {"shot_noise": True, "prnu": 0.02, "read_noise_e": 5}])
def test_light_beyond_the_range_makes_no_bound_loose(use: str, electrons: dict) -> None:
    """Lamps 50 times as bright as white, and much that is nearly black."""
    size, light = frames("edge")
    lamps = [Frame(np.where(frame.light > 0.4, 50 * frame.light, frame.light), frame.t_ns) for frame in light]
    noisy = PLAIN.model_copy(update=USES[use] | (electrons if use in ("exposure", "shading") else {}))
    spec = noisy.model_copy(update={"min_illuminance": 9000})
    most, rms, said = changed(spec, use.partition(" ")[0], size, lamps)
    allowed = 1 if not electrons else 65535 / spec.white_e + 1  # (an electron more or less, by the same draw)
    assert most <= said.levels.most + allowed
    assert rms <= said.levels.rms + allowed
    assert said.levels.most <= 10 * max(most, FINE * math.sqrt(0.01 / 12))


@pytest.mark.parametrize("name", ["phone", "rolling-shutter"])
@pytest.mark.parametrize("noise", [{}, {"shot_noise": False}, {"shot_noise": False, "read_noise_e": 0.0}])
def test_a_well_that_is_full_near_white_changes_what_is_left_to_white(name: str, noise: dict) -> None:
    """However bright: of lamps, and of much that is a little darker and a little brighter than the well."""
    spec = load_cis(name, ["cis.colour=false"]).model_copy(update=noise)
    full = spec.full_well_e / (spec.white_e * spec.exposure_gain)
    ramp = np.linspace(0.9 * full, 1.1 * full, 40 * 30, dtype=np.float32).reshape(30, 40)
    lamps = np.where(ramp > 1.05 * full, 50 * ramp, ramp)
    light = [Frame(lamps, k * 10_000_000) for k in range(30)]
    most, rms, said = changed(spec, "full_well", (40, 30), light)
    assert most <= math.floor(said.levels.most) + 1
    assert rms <= said.levels.rms + 1
    assert said.levels.most <= 5 * max(most, 1)  # (read noise of 10^12 values, of which these are a few thousand)


@pytest.mark.parametrize("name", cis_names())
@pytest.mark.parametrize("tolerance", [0.0, 0.01, 1.0])
def test_auto_keeps_within_the_tolerance(name: str, tolerance: float) -> None:
    """What auto leaves out changes codes by what it says, and rounding; each effect has a row, and free ones stay."""
    size, light = frames("edge")
    spec = load_cis(name, ["cis.colour=false"])
    plan = frame_plan_of(exposed(spec, size, light), spec, tolerance)
    assert plan.distance is not None and plan.distance <= tolerance
    assert f"tolerance {tolerance:g}: {math.sqrt(tolerance / 12):.2g} LSB" in plan.in_all()
    change = codes(spec, size, light) - codes(plan.spec, size, light)
    assert np.abs(change).max(initial=0) <= math.floor(plan.max_lsb) + 1
    assert [row.effect for row in plan.rows] == [*spec.effects(), *ALWAYS]
    assert plan.spec.line_us == spec.line_us
    assert all(row.effect in str(plan) and row.omission.why for row in plan.rows)
    assert all((row.ns_per_pixel, row.fate) == (0, "kept") for row in plan.rows if row.effect in ALWAYS)
    assert json.loads(json.dumps(plan.describe(), allow_nan=False))["max_lsb"] == plan.max_lsb


def test_auto_leaves_out_as_much_as_there_is_room_for_together() -> None:
    """Roots of distances add up; with any effect more that costs something it would be too much."""
    size, light = frames("edge")
    faint = {"noise_lsb": 0.01, "read_noise_e": 0.05, "prnu": 2e-5, "shading": (-2e-5,), "exposure_us": 0}
    spec = CisSpec(colour=False, **faint)
    seen = exposed(spec, size, light)
    roots = {name: math.sqrt(FRAME_EFFECTS[name].omission(seen, spec).distance) for name in spec.effects()}
    assert len(roots) == 4 and min(roots.values()) > 0 and sum(roots.values()) < 1
    for count in range(1, 5):
        for share in (0.99, 1.01):
            tolerance = (share * sum(sorted(roots.values())[:count])) ** 2
            plan = frame_plan_of(seen, spec, tolerance)
            gone = plan.gone
            room = math.sqrt(tolerance) - sum(roots[name] for name in gone)
            assert room >= 0 and all(roots[name] > room for name in roots.keys() - {*gone})
            assert len(gone) >= (count if share > 1 else count - 1)
            assert plan.max_lsb == pytest.approx(sum(roots[name] for name in gone) / math.sqrt(12))
    for some in ((), ("noise",), ("noise", "shading")):
        assert {*frame_plan_of(seen, spec, 1.0, among=some).gone} == {*some}


def test_a_still_clip_needs_no_exposure_and_keeps_its_times() -> None:
    still = [Frame(np.full((6, 8), 0.3, np.float32), k * 4_000_000) for k in range(30)]
    spec = CisSpec(colour=False, exposure_us=7000, line_us=30)
    plan = frame_plan_of(exposed(spec, (8, 6), still), spec, 1e-5)
    assert plan.spec == spec.model_copy(update={"blur": False})
    fates = {row.effect: row.fate for row in plan.rows}
    assert fates["exposure"] == "replaced" and fates["noise"] == fates["rolling_shutter"] == "kept"
    times = [
        [(each.index, each.start_ns, each.end_ns) for each in Cis(one, (8, 6)).run(still)] for one in (spec, plan.spec)
    ]
    assert times[0] == times[1] and len(times[0]) > 2


@pytest.mark.parametrize("line_us", [0, 700])
def test_without_blur_a_row_sees_the_middle_of_its_window(line_us: float) -> None:
    """Light that is a straight line is as before; of any light, what an instant of the same delay sees."""
    draws = np.random.default_rng(1)
    t_ns = np.cumsum(draws.integers(1, 9_000_000, 60))
    light = [Frame(frame, int(t)) for frame, t in zip(draws.random((60, 6, 8)).astype(np.float32), t_ns, strict=True)]
    spec = PLAIN.model_copy(update={"exposure_us": 11_000, "line_us": line_us, "blur": False})
    made = list(Cis(spec, (8, 6), linear=True).run(light))
    for each in made:
        for row in range(6):
            middle_ns = each.start_ns + 1000 * (row * line_us + 5500)
            seen = [np.interp(middle_ns, t_ns, [frame.light[row, x] for frame in light]) for x in range(8)]
            assert each.light is not None and np.allclose(each.light[row], seen, atol=1e-6)
    straight = [Frame(np.full((6, 8), 0.1 + 1e-9 * t, np.float32), int(t)) for t in range(0, 400_000_000, 7_000_000)]
    assert exposed(spec.model_copy(update={"blur": True}), (8, 6), straight).changes["exposure"].most < 1e-6


def test_what_is_seen_is_all_there_is() -> None:
    """Extremes, means, what is clipped and what a well does not hold, from every value of every exposure."""
    draws = np.random.default_rng(2)
    light = [Frame(draws.random((6, 8, 3)).astype(np.float32) * 3, k * 10_000_000) for k in range(40)]
    spec = CisSpec(frame_rate_hz=50, exposure_us=9000, full_well_e=9000, shading=(-0.5,))
    seen = exposed(spec, (8, 6), light)
    plain = CisSpec(frame_rate_hz=50, exposure_us=9000, shading=(-0.5,)).noiseless()
    made = np.array([each.light for each in Cis(plain, (8, 6), linear=True).run(light)], np.float64)
    assert (seen.exposures, seen.values, seen.rows) == (len(made), 6 * 8 * 3, 6)
    found = seen.light_min, seen.light_max, seen.light_mean
    assert found == pytest.approx((made.min(), made.max(), made.mean()), rel=1e-6)
    white = (4096 + 1023 * 55) / 65535
    lit = np.where((made >= 4096 / 65535) & (made <= white), made, 0)
    found = seen.lit_max, seen.lit_mean, seen.lit_square
    assert found == pytest.approx((lit.max(), lit.mean(), (lit**2).mean()), rel=1e-6)
    bare = Cis(plain.model_copy(update={"shading": ()}), (8, 6), linear=True).run(light)
    shaded = np.clip(made, 4096 / 65535, white) - np.clip([each.light for each in bare], 4096 / 65535, white)
    found = seen.changes["shading"].most, seen.changes["shading"].square
    assert found == pytest.approx((np.abs(shaded).max(), (shaded**2).mean()), rel=1e-5)
    for scale in (1, 0.01):  # (mostly beyond white, and all below black)
        levels = (scale * made * 65535 - 4096) / 55
        clipped = levels - np.clip(levels, 0, 1023)
        found = exposed(spec, (8, 6), [Frame(np.float32(scale) * frame.light, frame.t_ns) for frame in light])
        said = ALWAYS["clip"](found, spec).levels
        assert (said.most, said.square) == pytest.approx((np.abs(clipped).max(), (clipped**2).mean()), rel=1e-5)
    assert seen.changes["full_well"].most == pytest.approx(white - 0.9, rel=1e-5)
    within = exposed(spec, (8, 6), [Frame(frame.light / 6 + 0.1, frame.t_ns) for frame in light])
    assert ALWAYS["clip"](within, spec).levels.most == 0 and ALWAYS["clip"](within, spec).kind == "exact"


def test_effects_by_name() -> None:
    size, light = frames("edge")
    spec = load_cis("phone", ["cis.colour=false"])
    seen = exposed(spec, size, light)
    assert frame_plan_of(seen, spec, effects="all").spec == spec
    none = frame_plan_of(seen, spec, effects="none")
    assert none.spec.effects() == [] and none.max_lsb is None and "no bound" in str(none)
    assert frame_plan_of(seen, spec, effects="noise,exposure").spec.effects() == ["exposure", "noise"]
    for gone, known in ((("exposure",), True), (("rolling_shutter",), True), (("exposure", "rolling_shutter"), False)):
        plan = frame_plan_of(seen, spec, effects=[name for name in spec.effects() if name not in gone])
        assert {*plan.gone} == {*gone} and (plan.max_lsb is not None) == known
    assert set(FRAME_EFFECTS) == set(EFFECTS) and names_of("all") == list(KNOWN)
    with pytest.raises(UsageError, match="did you mean shot_noise"):
        frame_plan_of(seen, spec, effects="shot_nois")


def test_what_was_not_looked_at_is_kept_and_says_why() -> None:
    spec = load_cis("phone", ["cis.colour=false"])
    plan = frame_plan_unseen(spec, "it passes once")
    assert plan.spec == spec and plan.gone == () and plan.max_lsb == 0
    assert [row.effect for row in plan.rows] == spec.effects()
    for row in plan.rows:
        assert (row.fate, row.omission.why, row.omission.sure) == ("kept", "it passes once", False)
        assert row.ns_per_pixel == FRAME_EFFECTS[row.effect].ns and row.ns_per_event == 0
    without = frame_plan_unseen(spec, "it passes once", effects="none")
    assert without.spec.effects() == [] and without.distance is None
    with pytest.raises(UsageError, match=r"tolerance 1\.5"):
        frame_plan_unseen(spec, "it passes once", 1.5)
    with pytest.raises(UsageError, match=r"tolerance 1\.5"):
        frame_plan_of(Expose(spec, (8, 6)).exposed(), spec, 1.5)


def test_light_shorter_than_an_exposure_changes_nothing() -> None:
    spec = load_cis("phone", ["cis.colour=false"])
    plan = frame_plan_of(exposed(spec, (8, 6), [Frame(np.ones((6, 8), np.float32), 0)]), spec)
    assert plan.distance == 0 and plan.scene["exposures"] == 0
    assert frame_plan_of(Expose(spec, (8, 6)).exposed(), spec).scene["frames"] == 0


def test_laws_of_random_changes() -> None:
    """Of 1000 clips of noise at most a few exceed the 99.9 % bounds, and the bounds are not far."""
    draws = np.random.default_rng(4)
    for number, mean in ((50, 0.5), (2000, 30.0)):
        noise = draws.normal(0, 2, (1000, number))
        bound = surely_square(4.0, 2 * normal_most(number), number)
        assert np.mean(np.abs(noise).max(axis=1) > bound.most) <= 0.003
        assert np.mean((noise**2).mean(axis=1) > bound.square) <= 0.003
        shots = draws.poisson(mean, (1000, number)) - mean
        assert np.mean(np.abs(shots).max(axis=1) > poisson_most(mean, number)) <= 0.003
        assert poisson_most(mean, number) < 4 * np.abs(shots).max()
    assert surely_square(1.0, 1.0, 0) == (0, 0, 1)


def test_a_change_counts_by_its_greatest_against_that_of_rounding() -> None:
    """In units of the mean square of rounding, which is 1/12."""
    change = Change(0.1, 0.0004)
    omission = level_change(change, "bound", "it is small")
    assert omission.distance == pytest.approx(0.12) and omission.levels is change
    assert omission.figure == "max 0.1, rms 0.02 LSB" and omission.sure
    assert change.times(3.0) == pytest.approx((0.3, 0.0036, 1.0))


def test_all_values_of_all_exposures_are_drawn_and_things_move_while_they_are() -> None:
    seen = Exposed(12, 3, 5, 9, 2.0, 0.0, 1.0, 0.5, 1.0, 0.5, 0.3, {}, speed_px_per_s=200.0)
    assert seen.draws == 60 and seen.moved(500.0) == ", in which things move up to 0.1 px"
    assert dataclasses.replace(seen, speed_px_per_s=None).moved(500.0) == ""


def test_chances_of_random_changes_are_what_is_said() -> None:
    """By exact distributions: of normal and Poisson's numbers, and of changes that are all or nothing, whose sum is
    spread most."""
    for number in (1, 3, 10, 50, 2000, 10**6):
        assert number * 2 * norm.sf(normal_most(number)) < 1 / 2000
        means, shares = np.geomspace(1e-6, 1e5, 300), np.geomspace(1e-8, 0.9, 200)
        most = np.array([poisson_most(mean, number) for mean in means.tolist()])
        beyond = poisson.sf(means + most, means) + poisson.cdf(np.ceil(means - most) - 1, means)
        assert (number * beyond < 1 / 2000).all()
        squares = np.array([surely_square(share, 1.0, number).square for share in shares.tolist()])
        assert (binom.sf(np.floor(squares * number * (1 + 1e-12)), number, shares) < 1 / 2000).all()


@pytest.mark.parametrize("name", ["edge", "sine"])
def test_bounds_add_up(name: str) -> None:
    """Of everything that auto may leave out, at once."""
    size, light = frames(name)
    spec = PLAIN.model_copy(
        update={
            "exposure_us": 9000,
            "shading": (0.4, -0.9),
            "prnu": 0.05,
            "dsnu": 2,
            "full_well_e": 6000,
            "noise_lsb": 9,
        }
    )
    seen = exposed(spec, size, light)
    gone = [effect for effect in spec.effects() if FRAME_EFFECTS[effect].ns > 0]
    changes = {key: value for effect in gone for key, value in FRAME_EFFECTS[effect].off.items()}
    change = codes(spec, size, light) - codes(spec.model_copy(update=changes), size, light)
    bounds = [FRAME_EFFECTS[effect].omission(seen, spec).levels for effect in gone]
    assert np.abs(change).max() <= sum(bound.most for bound in bounds) + 1
    assert np.sqrt(np.mean(change**2)) <= sum(bound.rms for bound in bounds) + 1


def test_an_exposure_costs_as_many_frames_of_light_as_are_in_it_and_one_at_least() -> None:
    """Of 1000 frames a second, whenever the first of them was, and however few there are."""

    def cost_ns(exposure_us: float, frames: int) -> float:
        spec = PLAIN.model_copy(update={"exposure_us": exposure_us})
        light = [Frame(np.full((4, 4), 0.5, np.float32), 7 * 10**9 + k * 10**6) for k in range(frames)]
        rows = frame_plan_of(exposed(spec, (4, 4), light), spec).rows
        return next(row.ns_per_pixel for row in rows if row.effect == "exposure")

    for frames in (2, 4, 101):
        for exposure_us, each in ((9000, 9), (1000, 1), (100, 1)):
            assert cost_ns(exposure_us, frames) == pytest.approx(each * FRAME_EFFECTS["exposure"].ns, abs=0.006), frames
    assert cost_ns(9000, 1) == FRAME_EFFECTS["exposure"].ns


def test_light_is_measured_before_a_lens_and_behind_it_and_wells_by_the_most_sensitive_pixel() -> None:
    one, other = np.array([[0.2, 0.9, 0.5]], np.float32), np.array([[0.6, 0.4, 0.5]], np.float32)
    for gain in (0.5, 1.5):
        sums = np.zeros((2, 3))
        add_change(one, other, np.full((1, 3), gain, np.float32), 0.0, 10.0, sums)
        np.testing.assert_allclose(sums[0], max(gain, 1) * np.abs(one - other)[0])
    sums = np.zeros((SUMS, 3))
    add_light(one, np.ones((1, 3), np.float32), 0.0, 10.0, 0.0, 10.0, 1.5, 0.6, 10.0, sums)
    np.testing.assert_allclose(sums[OVERFULL], [0, 0.75, 0.15], rtol=1e-6, atol=1e-7)
