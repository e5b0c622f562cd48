"""Strips that sleep through still light show it in nothing: events, state and counts are the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from against.clips import EVERYTHING, clean
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev import load_sensor
from vid2ev.sensors.dvs import Dvs, DvsSpec
from vid2ev.stream.frames import Frame
from vid2ev.stream.still import Still
from vid2ev.upsample.stillness import still_strips

SIZE = (96, 70)  # three blocks of eight strips, two strips and a part of one
VIDEOS = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos"

TRACKING = {"leak_rate_hz": 3.0, "refractory": "track", "refractory_us": 900.0}
SENSORS = {
    "ideal": load_sensor("ideal"),
    "paper": load_sensor("paper"),
    "v2e-noisy": load_sensor("v2e-noisy"),
}
MORE = {
    "davis346": load_sensor("davis346", ["leak_rate_hz=2"]),
    "imx636": load_sensor("imx636", ["shot_rate_hz=3", "hot_probability=0.01"]),
    "v2e-clean": load_sensor("v2e-clean"),
    "dvxplorer": load_sensor("dvxplorer"),
    "prophesee-gen41": load_sensor("prophesee-gen41"),
    "photoreceptor noise": EVERYTHING,
    "after, tracking": DvsSpec(filter="after", crossing_noise=0.03, cold_probability=0.1, **TRACKING),
    "tracking without poles": clean(filter="after", **TRACKING),
    "before, one pole, leak, a lin-log": clean(photoreceptor_tau_us=400, leak_rate_hz=4, log_curve="v2e"),
    "after, one pole, shots": clean(filter="after", follower_tau_us=900, shot_rate_hz=9, mismatch=0.03),
    "slow poles": DvsSpec(photoreceptor_tau_us=20_000, follower_tau_us=30_000, timing="linear"),
    "shading, hot, frame times": clean(
        shading=(0.0, -0.4), hot_probability=0.02, hot_rate_hz=200, timing="frame", photoreceptor_tau_us=100
    ),
}
sensors = pytest.mark.parametrize(
    "spec",
    [*SENSORS.values(), *(pytest.param(spec, marks=pytest.mark.slow) for spec in MORE.values())],
    ids=[*SENSORS, *MORE],
)

Scene = list[tuple[str, int, int]]
WHAT = ["still", "still", "pixel", "rows", "flicker", "all", "back", "bad", "restart", "resume", "look"]
happenings = st.lists(
    st.tuples(st.sampled_from(WHAT), st.integers(1, 90), st.integers(0, 2**16)), min_size=3, max_size=7
)


def frames_of(scene: Scene, dtype: type, seed: int):
    """(light, what to do with it) frame by frame: long still stretches with something between."""
    width, height = SIZE
    rng = np.random.default_rng(seed)
    first = np.exp(rng.normal(-2.0, 1.5, (height, width)))
    light = first = first if dtype is not np.uint8 else np.clip(255 * first, 0, 255)
    for what, count, place in scene:
        y, x = place % height, place % width
        for k in range(1 + count % 8 if what in ("rows", "flicker") else 1):
            light = light.copy()
            if what == "pixel":
                light[y, x] *= 0.4
            elif what == "rows":
                light[max(0, y - 3) : y + k] = rng.permutation(light[max(0, y - 3) : y + k])
            elif what == "flicker":
                light[y:, :x] = first[y:, :x] * (1.0 + 0.5 * (k % 2))
            elif what == "all":
                light *= 1.3
            elif what == "back":
                light = first.copy()
            elif what == "bad" and dtype is not np.uint8:
                light[y, x] = np.nan
            yield np.clip(light, 0, 255).astype(dtype), what if k == 0 else "still"
        for _ in range(count):
            yield np.clip(light, 0, 255).astype(dtype), "still"


def times_ns(count: int, seed: int) -> np.ndarray:
    """Mostly steady times, with other steps now and then."""
    rng = np.random.default_rng(seed)
    steady = [40_000, 1_000_000, 33_000_000][seed % 3]
    return np.cumsum(np.where(rng.random(count) < 0.9, steady, rng.integers(2_000, 5_000_000, count)))


def assert_same_state(one: Dvs, other: Dvs) -> None:
    ours, theirs = one.state(), other.state()
    assert ours.keys() == theirs.keys()
    for name, array in ours.items():
        assert array.tobytes() == theirs[name].tobytes(), name


def told_of(before: np.ndarray, light: np.ndarray, seed: int) -> Still | None:
    """Now and then what is the same in two frames, or some of it."""
    rng = np.random.default_rng(seed)
    still = still_strips(before, light)
    return Still(before, still & (rng.random(still.size) < rng.choice([0.5, 1.0]))) if rng.random() < 0.7 else None


def play_both(
    spec: DvsSpec, scene: Scene, dtype: type, seed: int, threads=1, labels=False, told=False
) -> tuple[int, int]:
    """Both ways through a scene, compared at every frame; returns what has slept, of how much."""
    options = {"seed": seed, "transfer": "srgb", "labels": labels}
    skips = Dvs(spec, SIZE, threads=threads, **options)
    walks = Dvs(spec, SIZE, skip=False, **options)
    frames = list(frames_of(scene, dtype, seed))
    slept = total = 0
    before = frames[0][0]
    for (light, what), t_ns in zip(frames, times_ns(len(frames), seed), strict=True):
        if what == "resume":
            saved, slept, total = skips.state(), slept + skips.slept[0], total + skips.slept[1]
            skips = Dvs(spec, SIZE, threads=3 - threads, **options)
            skips.restore(saved)
        see = "restart" if what == "restart" else "step"
        still = (told_of(before, light, seed + t_ns),) if told and see == "step" else ()
        ours, theirs = getattr(skips, see)(light, int(t_ns), *still), getattr(walks, see)(light, int(t_ns))
        before = light
        for name in ("t", "x", "y", "p", "label"):
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
        if what == "look":
            places = np.array([0, 255, 2047, 2048, SIZE[0] * SIZE[1] - 1])
            assert np.array_equal(skips.inside(places), walks.inside(places))
        if what in ("look", "all"):
            assert_same_state(skips, walks)
    assert_same_state(skips, walks)
    assert skips.counts == walks.counts and walks.slept[0] == 0
    return slept + skips.slept[0], total + skips.slept[1]


@sensors
@settings(max_examples=20)
@given(happenings, st.integers(0, 1000), st.sampled_from([1, 2]), st.booleans())
def test_sleep_changes_no_bit(spec, scene, seed, threads, told):
    play_both(spec, scene, np.float32, seed, threads, told=told)


@pytest.mark.parametrize(
    "name", ["ideal", *(pytest.param(name, marks=pytest.mark.slow) for name in [*SENSORS, *MORE][1:])]
)
@settings(max_examples=20)
@given(happenings, st.integers(0, 1000), st.booleans())
def test_nor_does_it_with_codes_and_labels(name, scene, seed, labels):
    spec = (SENSORS | MORE)[name]
    play_both(spec, scene, np.uint8, seed, labels=labels and name != "ideal")


@sensors
def test_still_light_is_slept_through(spec):
    """What changes in a corner keeps most strips asleep, unless leak or noise of the photoreceptor do not."""
    scene = [("still", 20, 0), ("pixel", 40, 5), ("rows", 60, 2), ("flicker", 90, 69), ("back", 90, 0)]
    slept, total = play_both(spec, scene, np.float32, 6)
    least = 0.0 if spec.photoreceptor_noise > 0 else 0.05 if spec.leak_rate_hz > 0 else 0.7
    assert slept >= least * total
    assert (slept > 0) == (spec.photoreceptor_noise == 0)


def test_light_may_come_in_one_buffer_that_changes():
    light = np.full(SIZE[::-1], 0.5, np.float32)
    dvs = Dvs(load_sensor("ideal"), SIZE)
    for k in range(4):
        assert len(dvs.step(light, (k + 1) * 1_000_000)) == 0
    light[3, 4] = 1.0
    assert len(dvs.step(light, 5_000_000)) == 4
    assert dvs.slept == (27 + 27 + 27 + 26, 4 * 27)


def test_a_leak_that_goes_into_the_memories_wakes_who_sleeps():
    """2 nat a second for two seconds: strips fall asleep again and again, and the leak begins anew four times or so."""
    light = np.full(SIZE[::-1], 0.5, np.float32)
    spec = clean(threshold_on=0.2, leak_rate_hz=10, random_phase=False)
    skips, walks = (Dvs(spec, SIZE, skip=skip) for skip in (True, False))
    for k in range(200):
        ours, theirs = skips.step(light, k * 10_000_000), walks.step(light, k * 10_000_000)
        assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.x, theirs.x)
    assert skips.slept[0] > 0
    assert_same_state(skips, walks)


def test_a_leak_wakes_who_sleeps_however_far_above_their_levels_are():
    """A threshold of 100 nat is beyond what float32 has between light and level."""
    spec = clean(threshold_on=100.0, leak_rate_hz=10, random_phase=False)
    t_ns = np.array([0, 10, 20, 500, 600, 610, 2_000, 2_001, 2_400]) * 1_000_000
    assert_alike(spec, np.full((len(t_ns), *SIZE[::-1]), 0.5, np.float32), t_ns)


def test_light_of_another_type_is_other_light():
    light = np.full(SIZE[::-1], 0.5, np.float32)
    skips, walks = (Dvs(load_sensor("ideal"), SIZE, skip=skip, transfer="linear") for skip in (True, False))
    for k in range(12):
        other = [light, light.view(np.uint8)[:, :96] + np.uint8(k // 6), light.astype(np.float64)][(k // 2) % 3]
        ours, theirs = skips.step(other, (k + 1) * 1_000_000), walks.step(other, (k + 1) * 1_000_000)
        assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.x, theirs.x)
    assert_same_state(skips, walks)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["intel_bottle-detection.mp4", "nasa_13013.mp4"])
@pytest.mark.parametrize("sensor", ["ideal", "paper", pytest.param("v2e-noisy", marks=pytest.mark.slow)])
def test_real_clips(name, sensor):
    if not (VIDEOS / name).exists():
        pytest.skip(f"needs {name} in ../shared/data/videos")
    from vid2ev.sources import open_source

    source = open_source(VIDEOS / name)
    skips, walks = (Dvs(load_sensor(sensor), source.size, skip=skip) for skip in (True, False))
    for frame, _ in zip(source.frames(), range(40), strict=False):
        ours, theirs = skips.see(frame), walks.see(frame)
        for column in ("t", "x", "y", "p"):
            assert np.array_equal(getattr(ours, column), getattr(theirs, column))
    assert_same_state(skips, walks)


def test_what_is_said_of_another_array_is_not_believed():
    light = np.full(SIZE[::-1], 0.5, np.float32)
    dvs = Dvs(load_sensor("ideal"), SIZE)
    dvs.step(light, 1_000_000)
    brighter = light * 2
    all_still = np.ones(27, np.bool_)
    assert len(dvs.step(brighter, 2_000_000, Still(light.copy(), all_still))) == 4 * light.size
    assert len(dvs.step(light, 3_000_000, Still(brighter, all_still))) == 0  # of this one it is, wrong as it is here


def test_nor_what_is_said_of_a_frame_that_another_has_followed():
    light, all_still = np.full(SIZE[::-1], 0.5, np.float32), np.ones(27, np.bool_)
    source = Dvs(load_sensor("ideal"), SIZE)
    source.steps(np.stack([light, light * 2]), [1_000_000, 2_000_000])
    follow = {
        "a step": lambda dvs: dvs.step(light * 2, 2_000_000),
        "some steps": lambda dvs: dvs.steps(light[None] * 2, [2_000_000]),
        "frames together": lambda dvs: dvs.see_all([Frame(light * 2, t) for t in (1_500_000, 2_000_000)]),
        "a cut": lambda dvs: dvs.restart(light * 2, 2_000_000),
        "a state": lambda dvs: dvs.restore(source.state()),
    }
    for name, another in follow.items():
        dvs = Dvs(load_sensor("ideal"), SIZE)
        dvs.step(light, 1_000_000)
        another(dvs)
        assert len(dvs.step(light, 3_000_000, Still(light, all_still))) == 4 * light.size, name


def test_a_sensor_that_slept_owes_nothing_to_a_state_that_it_takes_up():
    spec = clean(photoreceptor_tau_us=2000, follower_tau_us=500)
    dark = np.random.default_rng(0).uniform(0.1, 1, SIZE[::-1]).astype(np.float32)
    steps = [(dark, 0), (dark * 1.05, 100_000), (dark, 200_000)]
    slept, other = Dvs(spec, SIZE), Dvs(spec, SIZE)
    for light, t_ns in steps:
        slept.step(light, t_ns)
        other.step(light, t_ns)
    saved = other.state()
    for k in range(12):
        slept.step(dark, 300_000 + 50_000 * k)
    assert slept.slept[0] > 0
    slept.restore(saved)
    for k in range(3):
        ours, theirs = (dvs.step(dark, 300_000 + 100_000 * k) for dvs in (slept, other))
        assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.x, theirs.x)
    assert_same_state(slept, other)


def assert_alike(spec: DvsSpec, light: np.ndarray, t_ns: np.ndarray, seed: int = 0) -> None:
    """A sensor that may sleep and one that walks all send the same, and have the same in them at the end."""
    skips, walks = (Dvs(spec, light.shape[:0:-1], seed=seed, skip=skip) for skip in (True, False))
    for frame, t in zip(light, t_ns.tolist(), strict=True):
        ours, theirs = skips.step(frame, t), walks.step(frame, t)
        assert np.array_equal(ours.t, theirs.t) and np.array_equal(ours.p, theirs.p)
    assert skips.slept[0] > 0
    assert_same_state(skips, walks)


@pytest.mark.long
@pytest.mark.parametrize("dt_ns", [100_000, 5_000_000])
def test_a_pixel_by_itself_wakes_for_what_its_shots_leave_to_be_reached(dt_ns):
    """It sleeps between its levels, near one and then near the other: a shot has it go on from where it is, and from
    there the light or the leak may reach a level that they did not before."""
    spec = load_sensor("v2e-noisy", ["leak_rate_hz=3", f"shot_rate_hz={1e7 / dt_ns}"])
    nats = np.repeat(0.18 * np.array([0, 1, -1, 1, -1]), 90)
    light = 0.5 * np.exp(nats).astype(np.float32)[:, None, None]
    for seed in range(20):
        assert_alike(spec, light, dt_ns * np.arange(len(light)), seed)


ALONE = {  # pixels; ms of an interval; how many in each light; a sensor
    "poles that are slower than the leak": (
        (1, 1.0, 60, {"photoreceptor_tau_us": 100, "follower_tau_us": 300_000, "leak_rate_hz": 10})
    ),
    "shots while a pole is under way": (1, 0.1, 60, {"photoreceptor_tau_us": 2000, "shot_rate_hz": 100}),
    "shots and leak": (1, 2.0, 100, {"leak_rate_hz": 10, "shot_rate_hz": 5}),
    "shots and leak of several": (3, 2.0, 100, {"leak_rate_hz": 10, "shot_rate_hz": 5}),
    "shots, and memories that jump later": (
        (1, 0.1, 100, {"refractory": "track", "refractory_us": 900, "leak_rate_hz": 30, "shot_rate_hz": 100})
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("name", ALONE)
def test_pixels_by_themselves_wake_before_a_level_is_reached(name):
    """Light goes as far as it can without an event, up and down, so whatever else moves is soon at a level."""
    pixels, dt_ms, hold, effects = ALONE[name]
    spec = clean(threshold_on=0.2, threshold_off=0.2, shot_light_factor=1.0, **effects)
    ways = np.stack([np.roll(np.tile([0, 0, 1, -1, 0, 0, -1, 1], 8), 3 * k) for k in range(pixels)], 1)
    for seed in range(10):
        far = np.random.default_rng(seed).uniform(0.16, 0.195, ways.shape)
        light = 0.5 * np.exp(np.repeat(ways * far, hold, 0)).astype(np.float32)[:, None]
        assert_alike(spec, light, round(1e6 * dt_ms) * np.arange(len(light)), seed)


def test_an_interval_too_short_for_a_lag_to_move_does_not_end_the_making_up():
    spec = clean(photoreceptor_tau_us=1e6, follower_tau_us=5e5)
    light = np.full((60, *SIZE[::-1]), 0.5, np.float32)
    light[0] = 0.47
    dt_ns = np.where(np.arange(60) % 20 < 10, 10, 50_000_000)
    assert_alike(spec, light, np.cumsum(dt_ns))


def test_of_a_lag_that_a_flash_has_left_below_all_float32_not_the_sign_is_left_either():
    light = np.full((8, *SIZE[::-1]), 0.001, np.float32)
    light[0] = 1000.0
    t_ns = np.cumsum([0, 10_000, 10_000, 20_000_000, *[1_000_000] * 4])
    assert_alike(clean(photoreceptor_tau_us=100.0, follower_tau_us=30.0), light, t_ns)


def test_strips_that_change_now_and_then_are_asked_as_often_as_it_pays():
    """Where frames say nothing, ever more rarely while they change; of those that do every word is heard."""
    light = np.full((18, *SIZE[::-1]), 0.5, np.float32)
    light[1:9] *= np.exp(0.01 * np.arange(1, 9, dtype=np.float32))[:, None, None]
    light[9:] = light[8]
    frames = list(light)
    for told, slept in ((False, 2), (True, 9)):
        dvs = Dvs(load_sensor("ideal"), SIZE)
        dvs.step(frames[0], 0)
        for k in range(1, 18):
            still = Still(frames[k - 1], still_strips(frames[k - 1], frames[k])) if told else None
            dvs.step(frames[k], 1_000_000 * k, still)
        assert dvs.slept[0] == 27 * slept


def test_where_many_shots_are_expected_none_sleeps():
    """Those would stir so many pixels of it that to walk a strip takes less; until intervals are short again."""
    dvs, light = Dvs(SENSORS["v2e-noisy"], SIZE), np.full(SIZE[::-1], 0.5, np.float32)
    t_ns, slept = 0, []
    for dt_ns in [1_000_000] * 20 + [33_000_000] * 5 + [1_000_000] * 20:
        before, t_ns = dvs.slept[0], t_ns + dt_ns
        dvs.step(light, t_ns)
        slept.append(dvs.slept[0] - before)
    assert slept[19] > 20 and slept[20:25] == [0] * 5 and slept[-1] > 20  # (of 27 strips)
