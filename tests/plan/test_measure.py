"""Scenes are measured right: the play counts the events of a sensor, extremes are those of all pixels."""

from __future__ import annotations

import dataclasses
import re
import tracemalloc
from typing import Any

import numpy as np
import pytest
from against.clips import clean

from vid2ev import load_sensor
from vid2ev.bounds.scene import DISTANCE_TAU_S, OF_BARE, QUARTER_EDGES, SPREAD, Scene
from vid2ev.errors import UsageError
from vid2ev.physics.omission import crossings
from vid2ev.plan.measure import Measure
from vid2ev.stream import Events, Frame
from vid2ev.stream.still import Still, strip_count
from vid2ev.upsample.stillness import still_strips

from .clips import clip, sent
from .measured import scene_of

SIZE = (50, 45)  # more than one tile, the last one not full


def walk(seed: int, frames: int = 40, step: float = 0.2) -> list[Frame]:
    """Light that wanders: another path in every pixel."""
    draws = np.random.default_rng(seed)
    level = np.cumsum(draws.normal(0, step, (frames, SIZE[1], SIZE[0])), axis=0) - 1
    gaps = draws.integers(1, 9, frames).cumsum() * 1_000_000
    return [Frame(np.exp(light).astype(np.float32), int(t)) for t, light in zip(gaps, level, strict=True)]


@pytest.mark.parametrize("threshold", [0.07, 0.4])
def test_the_play_counts_the_events(threshold: float) -> None:
    """Over a random start the mean number of events is travel / threshold, exactly; a standard error is 1/2 a pixel."""
    spec = clean(filter="after", random_phase=True, threshold_on=threshold, threshold_off=threshold)
    frames = walk(1)
    scene = scene_of(spec, SIZE, frames)
    spread = 5 * 0.5 * np.sqrt(scene.pixels * len(frames))
    assert abs(len(sent(spec, SIZE, frames)) - scene.events) < spread
    assert scene.events > 10 * spread


def test_extremes_and_times_are_those_of_all_pixels() -> None:
    spec, frames = clean(filter="after"), walk(2)
    scene = scene_of(spec, SIZE, frames)
    light = np.stack([frame.light for frame in frames]).reshape(len(frames), -1).astype(np.float64)
    t_s = np.array([frame.t_ns for frame in frames]) * 1e-9
    steepest = np.abs(np.diff(np.log(light + 1e-3), axis=0) / np.diff(t_s)[:, None]).max(axis=0)
    for tile in range(2):
        part = slice(2048 * tile, 2048 * (tile + 1))
        assert scene.light_min[tile] == light[:, part].min() and scene.light_max[tile] == light[:, part].max()
        assert scene.slope_max[tile] == pytest.approx(steepest[part].max(), rel=1e-4)
    assert scene.seconds == pytest.approx(t_s[-1] - t_s[0]) and scene.frames == len(frames)
    assert scene.shortest_s == pytest.approx(np.diff(t_s).min()) and np.diff(t_s)[-1] > 1.5 * scene.shortest_s
    assert scene.longest_interval_s == pytest.approx(np.diff(t_s).max())
    assert scene.pushed_s.sum() <= scene.seconds * scene.pixels


def test_before_the_log_slopes_are_bounds() -> None:
    """Straight light is steepest, as a share of itself, where it is darkest."""
    frames = walk(3)
    before, after = (scene_of(clean(filter=way), SIZE, frames) for way in ("before", "after"))
    assert (before.slope_max >= after.slope_max * (1 - 1e-5)).all()
    assert before.events == pytest.approx(after.events)


@pytest.mark.parametrize("way", ["before", "after"])
def test_travel_is_spread_over_slopes_lights_and_pixels_and_none_is_lost(way: str) -> None:
    spec = clean(filter=way, photoreceptor_tau_us=300, follower_tau_us=100)
    scene = scene_of(spec, SIZE, walk(4))
    for spread in (scene.by_slope[0], scene.by_light[0], scene.by_pixel[1]):
        assert spread.sum() == pytest.approx(scene.travel.sum(), rel=1e-4)
    numbers = scene.by_pixel[0]
    assert (np.diff(numbers) > 0).all() and numbers[-1] == int(scene.busiest / scene.threshold)
    assert 0 < scene.by_turns[0].sum() < scene.travel.sum()  # (what counts of it)
    seen = np.flatnonzero(scene.by_light[0])
    assert QUARTER_EDGES[seen[0] + 1] >= scene.light_min.min() and QUARTER_EDGES[seen[-1]] <= scene.light_max.max()
    steep = np.flatnonzero(scene.by_slope[0])
    assert QUARTER_EDGES[steep[-1]] <= scene.slope_max.max()


def test_smoothed_slopes_are_those_of_the_low_pass() -> None:
    """A ramp of the log from rest: after one time constant, 1 - 1/e of the ramp's slope is reached."""
    frames = [Frame(np.full(SIZE[::-1], np.exp(20e-9 * t), np.float32), t) for t in range(0, 40_000_000, 1_000_000)]
    spec = clean(filter="after", photoreceptor_tau_us=10_000, dark_level=1e-12, threshold_on=0.01, threshold_off=0.01)
    travel = scene_of(spec, SIZE, frames).by_slope[0]
    slow = travel[QUARTER_EDGES[1:] <= 20 * (1 - np.exp(-1))].sum() / travel.sum()
    assert 0.15 < slow < 0.26 and QUARTER_EDGES[np.flatnonzero(travel)[-1]] <= 20


@pytest.mark.parametrize("dark", [0.0, 0.003, 0.1])
@pytest.mark.parametrize("falls", [False, True])
def test_no_more_travel_is_steep_than_is_said(dark: float, falls: bool) -> None:
    """Light that goes between dark and bright at once: behind the pole it is steepest soon after it has begun, or as it
    ends; and it is not said to be much steeper than it is."""
    tau_s, gap_s, floor = 3e-4, 1 / 30, 1e-3
    lights = [1.0, dark] if falls else [dark, 1.0]
    frames = [Frame(np.full(SIZE[::-1], light, np.float32), k * 33_333_333) for k, light in enumerate(lights[:1] * 2)]
    frames.append(Frame(np.full(SIZE[::-1], lights[1], np.float32), 2 * 33_333_333))
    spec = clean(filter="before", photoreceptor_tau_us=1e6 * tau_s, dark_level=floor)
    travel = scene_of(spec, SIZE, frames).by_slope[0]
    t = np.concatenate([[0.0], np.geomspace(1e-7, gap_s, 400_001)])
    rate = (lights[1] - lights[0]) / gap_s
    signal = np.log(lights[0] + rate * (t + tau_s * np.expm1(-t / tau_s)) + floor)
    gone = np.abs(np.diff(signal))
    slopes = gone / np.diff(t)
    for quarter in range(40, len(QUARTER_EDGES) - 1):
        steep = travel[quarter:].sum() / travel.sum()
        assert gone[slopes >= QUARTER_EDGES[quarter]].sum() / gone.sum() <= steep + 0.03, QUARTER_EDGES[quarter]
        assert gone[slopes >= QUARTER_EDGES[quarter] / 1.5].sum() / gone.sum() >= steep - 0.03, QUARTER_EDGES[quarter]


def test_dense_events_are_counted() -> None:
    """On a ramp events are a gap g apart, and D of them by itself is n / 2 coth(g / (2 tau))."""
    frames = [
        Frame(np.full(SIZE[::-1], np.exp(30e-9 * t - 8), np.float32), t) for t in range(0, 400_000_000, 1_000_000)
    ]
    plain = clean(filter="after", dark_level=1e-12, threshold_on=0.02, threshold_off=0.02)
    blind = {"refractory": "track", "refractory_us": 500.0}
    for more, gap_s in (({}, 0.02 / 30), (blind, 0.02 / 30 + 5e-4)):
        bunched = scene_of(plain.model_copy(update=more), SIZE, frames).bunched
        assert bunched == pytest.approx(1 / np.tanh(gap_s / 2e-3), rel=0.005), more  # (the first have none before)


def near_each_other(events: Events, tau_us: float = 1000.0) -> float:
    """The sum over all pairs of a pixel of exp(-|t - t'| / tau), for each event."""
    pixels = events.y.astype(np.int64) * SIZE[0] + events.x
    order = np.lexsort((events.t, pixels))
    total = trace = 0.0
    last, at = -1, 0
    for t, pixel in zip(events.t[order].tolist(), pixels[order].tolist(), strict=True):
        trace = trace * np.exp((at - t) / tau_us) if pixel == last else 0.0
        total += 1.0 + 2.0 * trace
        trace, last, at = trace + 1.0, pixel, t
    return total / len(events)


@pytest.mark.parametrize("way", ["before", "after"])
@pytest.mark.parametrize("step", [0.05, 0.5])
def test_events_are_as_near_each_other_as_those_of_a_sensor(way: str, step: float) -> None:
    """Up and down, where several come in an interval and where few do."""
    spec = clean(filter=way, random_phase=True, threshold_on=0.1, threshold_off=0.1)
    frames = [Frame(frame.light, frame.t_ns // 8) for frame in walk(3, 60, step)]
    found = near_each_other(sent(spec, SIZE, frames))
    assert scene_of(spec, SIZE, frames).bunched == pytest.approx(found, rel=0.02) and found > 1.4


def test_all_events_of_a_frame_are_at_its_end() -> None:
    spec = clean(random_phase=True, threshold_on=0.1, threshold_off=0.1, timing="frame")
    frames = walk(3, 60, 0.3)
    found = near_each_other(sent(spec, SIZE, frames))
    assert scene_of(spec, SIZE, frames).bunched == pytest.approx(found, rel=0.02) and found > 3


@pytest.mark.parametrize("more", [{}, {"bandwidth": "light"}, {"follower_tau_us": 100.0}, {"filter": "after"}])
def test_what_is_sent_at_least_is_that_of_the_signal_behind_the_poles(more: dict[str, Any]) -> None:
    """Of poles that are much slower than the frames come it is not much less, either."""
    spec = clean(random_phase=True, threshold_on=0.05, threshold_off=0.05, photoreceptor_tau_us=20_000, **more)
    frames = walk(4, 100)
    found, most = crossings(scene_of(spec, SIZE, frames)), scene_of(spec, SIZE, frames).events
    assert 0.5 * len(sent(spec, SIZE, frames)) < found < len(sent(spec, SIZE, frames)) < 0.5 * most


@pytest.mark.parametrize("way", ["before", "after"])
@pytest.mark.parametrize("tau_us", [1e8, 1e9, 1e12])
def test_of_poles_much_slower_than_the_clip_hardly_anything_is_sent_at_least(way: str, tau_us: float) -> None:
    """However fast light changes: what rounding leaves of steep slopes is no signal."""
    spec = clean(filter=way, random_phase=True, photoreceptor_tau_us=tau_us)
    texture = np.exp(np.random.default_rng(0).normal(-1.5, 1, SIZE[::-1])).astype(np.float32)
    frames = [Frame(np.roll(texture, k, 1), k * 1_000_000) for k in range(100)]
    assert crossings(scene_of(spec, SIZE, frames)) < 1e-4 * scene_of(spec, SIZE, frames).events


def test_times_are_those_since_a_shot_began() -> None:
    """Light rises in two intervals of a shot, and the one after a cut; the ends of shots are turns, too."""
    levels = [0.0, 0.0, 1.0, 1.0, 0.0, 2.0]
    frames = [
        Frame(np.full(SIZE[::-1], np.exp(y), np.float32), k * 10_000_000, cut=k == 4) for k, y in enumerate(levels)
    ]
    seen = scene_of(clean(filter="after"), SIZE, frames)
    assert seen.longest_s == pytest.approx(0.03)
    assert seen.travelled_when_s == pytest.approx((1 * 0.02 + 2 * 0.01) / 3, rel=0.15)
    assert seen.pushed_when_s == pytest.approx((0.02 + 0.01) / 2, rel=0.15)  # (a shot begins in the midst of levels)
    assert seen.turned_when_s == pytest.approx((0.03 + 0.01) / 2, rel=1e-6)


@pytest.mark.parametrize("mismatch", [0.0, 0.02])
def test_sums_over_a_zigzag_are_those_of_the_theory(mismatch: float) -> None:
    """Up and down five times, behind no poles: a leg pushes but for a threshold, its end is a turn, bends are 30 nat/s
    at the beginning and 60 at each turn, and what follows counts by all turns, and all bends, before it."""
    legs, way, slope, theta = 5, 0.6, 30.0, 0.1
    nats = np.interp(np.arange(20 * legs + 1), 20 * np.arange(legs + 1), way * (np.arange(legs + 1) % 2))
    frames = [Frame(np.full(SIZE[::-1], np.exp(y), np.float32), 1_000_000 * k) for k, y in enumerate(nats)]
    jumps = {"refractory": "track", "refractory_us": 0.1}
    spec = clean(filter="after", dark_level=1e-12, threshold_on=theta, threshold_off=theta, mismatch=mismatch, **jumps)
    seen = scene_of(spec, SIZE, frames)
    pixels, k = seen.pixels * theta, np.arange(legs)
    weight = seen.turns.sum() / (seen.pixels * legs)  # (theta / a pixel's own, which is more than 1 on average)
    assert weight == pytest.approx(1 + (mismatch / theta) ** 2, rel=0.01)
    travel = np.where(k > 0, way - theta / weight, way) * weight
    assert seen.travel.sum() / seen.pixels == pytest.approx(travel.sum(), rel=2e-3)
    assert seen.pushed_s.sum() / seen.pixels == pytest.approx(travel.sum() / slope, rel=2e-3)
    bends = np.where(k > 0, 2 * slope, slope)
    assert seen.bend.sum() / seen.pixels == pytest.approx(weight * bends.sum(), rel=1e-3)
    assert seen.bend_at_turns.sum() / seen.pixels == pytest.approx(weight * bends[1:].sum(), rel=1e-3)
    if mismatch:
        return
    lost = seen.by_turns[0].sum() / seen.pixels / travel.sum()
    assert lost == pytest.approx(1 - np.exp(-theta / slope / (2 * DISTANCE_TAU_S)), rel=0.01)
    stirs = np.cumsum(bends * slope / theta) * 1e-6  # [nat/ms^2]
    strays = np.sqrt(np.cumsum(bends**2 * slope / theta) * 1e-9)  # [nat/ms^1.5]
    for name, wanted in {
        "by_turns": lost * travel @ k,
        "by_bends": lost * travel @ (2 * slope * k),
        "by_stirs": travel / slope @ stirs,
        "by_strays": travel / slope @ strays,
        "by_stirs_at_turns": theta * stirs[1:].sum(),
        "by_strays_at_turns": theta * strays[1:].sum(),
        "by_stirs_before": lost * travel @ np.append(0, np.cumsum(stirs[1:])),
        "by_strays_before": lost * travel @ np.append(0, np.cumsum(strays[1:])),
    }.items():
        assert getattr(seen, name)[1].sum() / seen.pixels == pytest.approx(wanted, rel=2e-3), name
    assert seen.by_stirs_at_turns[0].sum() == pytest.approx(pixels * (legs - 1), rel=1e-4)
    assert not seen.off_peaks.any() and not seen.by_felt.any() and not seen.by_felt_at_turns.any()


def test_nothing_is_carried_across_a_cut() -> None:
    spec, frames = clean(), walk(5, 4)
    dark = Frame(np.full(SIZE[::-1], 1e-6, np.float32), frames[-1].t_ns + 1_000_000, cut=True)
    cut, plain = scene_of(spec, SIZE, [*frames, dark]), scene_of(spec, SIZE, frames)
    assert cut.events == plain.events and cut.seconds == plain.seconds
    assert cut.light_min.min() == np.float32(1e-6)


def test_a_still_scene_is_still() -> None:
    frames = [Frame(np.full(SIZE[::-1], 0.3, np.float32), k * 1_000_000) for k in range(5)]
    scene = scene_of(clean(), SIZE, frames)
    assert scene.still and scene.slope_max.max() == 0 and scene.describe()["still_tiles"] == 2


def fields(scene: Scene) -> dict[str, np.ndarray]:
    return {each.name: np.asarray(getattr(scene, each.name)) for each in dataclasses.fields(scene)}


MORE: list[dict[str, Any]] = [
    {},
    {"refractory": "track", "refractory_us": 2000.0},
    {"shading": (-0.3, -0.5), "dark_level": 0.1},
    {"bandwidth": "light"},
    {"refractory": "track", "refractory_us": 2000.0, "shading": (-0.3, -0.5), "dark_level": 0.1, "bandwidth": "light"},
]


@pytest.mark.parametrize("more", MORE)
@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(threads: int, more: dict[str, Any]) -> None:
    size, spec = (160, 90), clean(photoreceptor_tau_us=3000, follower_tau_us=1000, **more)
    draws = np.random.default_rng(7)
    lights = np.exp(np.cumsum(draws.normal(0, 0.2, (20, *size[::-1])), axis=0)).astype(np.float32)
    lights[5:9, :40] = lights[5, :40]
    frames = [Frame(light, k * 1_000_000, cut=k == 12) for k, light in enumerate(lights)]
    one, several = (Measure(spec, size, many) for many in (1, threads))
    for frame in frames:
        one.see(frame)
        several.see(frame)
    for name, value in fields(one.scene()).items():
        assert value.tobytes() == fields(several.scene())[name].tobytes(), name


@pytest.mark.parametrize("more", MORE)
@pytest.mark.parametrize("way", ["before", "after"])
def test_what_is_left_alone_while_it_is_still_is_measured_like_what_is_not(way: str, more: dict[str, Any]) -> None:
    """Beside a pixel that flickers, too little to be pushed, no strip is left alone."""
    spec = clean(filter=way, photoreceptor_tau_us=9000, follower_tau_us=100, **more)
    frames = walk(6)
    still = [
        dataclasses.replace(frame, light=frames[10].light if 10 <= k < 17 else frame.light)
        for k, frame in enumerate(frames)
    ]
    both = []
    for flicker in (1.0, 0.9999):
        lights = [frame.light.copy() for frame in still]
        for k, light in enumerate(lights):
            light.reshape(-1)[::200] = 0.5 * flicker ** (k % 2)
        both.append(scene_of(spec, SIZE, [Frame(light, f.t_ns) for light, f in zip(lights, still, strict=True)]))
    left, walked = map(fields, both)
    assert left["turns"].tobytes() == walked["turns"].tobytes() and left["turns"].sum() > 0
    for name in ("travel", "pushed_s", "bend", "bend_at_turns", "travel_at_least", "by_pixel", "slope_max"):
        assert left[name] == pytest.approx(walked[name], rel=2e-6), name
    for name in SPREAD:  # (what is beside an edge of two quarters may fall to either)
        assert left[name][1].sum() == pytest.approx(walked[name][1].sum(), rel=1e-5), name
    for name in OF_BARE:
        assert left[name] == pytest.approx(walked[name], rel=1e-5), name


@pytest.mark.parametrize("more", MORE)
def test_what_is_said_to_be_still_is_measured_to_the_same_bits(more: dict[str, Any]) -> None:
    spec = clean(photoreceptor_tau_us=9000, follower_tau_us=100, **more)
    lights = [frame.light for frame in walk(6)]
    for k in (*range(10, 17), 22, 23):
        lights[k] = lights[k].copy()
        lights[k][: SIZE[1] // 2] = lights[k - 1][: SIZE[1] // 2]
    looked, told, lied = (Measure(spec, SIZE) for _ in range(3))
    for k, light in enumerate(lights):
        frame = Frame(light, 1_000_000 * k)
        before = lights[max(k - 1, 0)]
        looked.see(frame)
        told.see(dataclasses.replace(frame, still=Still(before, still_strips(before, light))))
        lied.see(dataclasses.replace(frame, still=Still(before.copy(), np.ones(strip_count(*SIZE), np.bool_))))
    for name, value in fields(looked.scene()).items():
        assert value.tobytes() == fields(told.scene())[name].tobytes(), name
        assert value.tobytes() == fields(lied.scene())[name].tobytes(), f"{name}: that was said of another frame"


def test_what_is_said_to_be_still_is_not_looked_at() -> None:
    measure = Measure(clean(), SIZE)
    lights = [np.full(SIZE[::-1], light, np.float32) for light in (0.1, 0.9)]
    measure.see(Frame(lights[0], 0))
    measure.see(Frame(lights[1], 1_000_000, still=Still(lights[0], np.ones(strip_count(*SIZE), np.bool_))))
    assert measure.scene().still


def test_wrong_frames_are_refused() -> None:
    measure = Measure(clean(), SIZE)
    measure.see(Frame(np.ones(SIZE[::-1], np.float32), 5))
    with pytest.raises(UsageError, match="expected a later one"):
        measure.see(Frame(np.ones(SIZE[::-1], np.float32), 5))
    with pytest.raises(UsageError, match="shape"):
        measure.see(Frame(np.ones(SIZE, np.float32), 6))


def test_light_that_is_no_light_leaves_the_scene_finite() -> None:
    light = np.full((3, *SIZE[::-1]), 0.5, np.float32)
    light[1, 0, :4] = np.nan, np.inf, -1, 1e38
    scene = scene_of(clean(), SIZE, [Frame(frame, k * 1_000_000) for k, frame in enumerate(light)])
    assert np.isfinite(scene.travel).all() and np.isfinite(scene.slope_max).all() and np.isfinite(scene.bend).all()


@pytest.mark.parametrize("more", MORE)
@pytest.mark.parametrize("curve", ["offset", "toe"])
def test_no_number_of_any_light_is_negative_or_none(curve: str, more: dict[str, Any]) -> None:
    draws = np.random.default_rng(8)
    for _ in range(25):
        lights = 10.0 ** draws.uniform(-9, 4, (6, 8, 8))
        lights[draws.random(lights.shape) < 0.1] = draws.choice([0.0, np.nan, -1.0, 1e4])
        t_ns = np.cumsum(draws.integers(10_000, int(10 ** draws.uniform(4.1, 10)), 6))
        taus = {f"{pole}_tau_us": draws.choice([1e-3, 1.0, 300.0, 1e6]) for pole in ("photoreceptor", "follower")}
        spec = clean(log_curve=curve, **taus, **{"dark_level": 10 ** draws.uniform(-6, 0)} | more)
        frames = [Frame(light.astype(np.float32), int(t)) for light, t in zip(lights, t_ns, strict=True)]
        for name, value in fields(scene_of(spec, (8, 8), frames)).items():
            assert np.isfinite(value).all() and (value >= 0).all(), name


@pytest.mark.long
def test_memories_that_jump_have_the_fewer_events() -> None:
    """Travel is the threshold times the events of a pixel that is blind in between, too."""
    frames = [Frame(np.full(SIZE[::-1], np.exp(30e-9 * t), np.float32), t) for t in range(0, 400_000_000, 1_000_000)]
    blind = {"refractory": "track", "refractory_us": 5000.0}
    spec = clean(filter="after", random_phase=True, dark_level=1e-12, threshold_on=0.2, threshold_off=0.2, **blind)
    seen, plain = scene_of(spec, SIZE, frames), scene_of(spec.model_copy(update={"refractory_us": 0.0}), SIZE, frames)
    assert len(sent(spec, SIZE, frames)) == pytest.approx(seen.events, rel=0.02)
    assert seen.events == pytest.approx(plain.events * 0.2 / (0.2 + 0.005 * 30), rel=0.01)
    assert not plain.by_stirs.any() and not plain.by_strays_at_turns.any()


def test_light_without_the_shading_is_measured_beside_that_with_it() -> None:
    """Its travel is that of a sensor without shading, and from the same start; far above the dark they are the same."""
    frames = walk(6)
    dark, bright = clean(filter="after", dark_level=0.1), clean(filter="after", dark_level=1e-6)
    shaded = {"shading": (-0.3, -0.5)}
    for spec in (dark, bright):
        seen = scene_of(spec.model_copy(update=shaded), SIZE, frames)
        assert seen.bare_travel == pytest.approx(scene_of(spec, SIZE, frames).travel, rel=1e-4)
    near = scene_of(bright.model_copy(update=shaded), SIZE, frames)
    far = scene_of(dark.model_copy(update=shaded), SIZE, frames)
    assert far.bare_frozen.sum() > 0.05 * far.travel.sum() and far.bare_travel.sum() > 1.02 * far.travel.sum()
    assert near.bare_frozen.sum() < 1e-3 * near.travel.sum()
    assert not scene_of(dark, SIZE, frames).bare_travel.any()


def test_a_clip_with_subframes_has_the_events_of_its_sensor() -> None:
    size, frames = clip("edge")
    spec = clean(filter="after", random_phase=True)
    assert len(sent(spec, size, frames)) == pytest.approx(scene_of(spec, size, frames).events, rel=0.01)


def test_memory_is_what_is_said() -> None:
    said = re.search(r"Memory is (\d+) bytes.*shading (\d+) more.*signal (\d+)", Measure.__doc__ or "", re.DOTALL)
    assert said is not None
    plain, shaded, jumping = map(int, said.groups())
    size = 1280, 720

    def bytes_a_pixel(*changes: str) -> float:
        spec = load_sensor("paper", changes)
        tracemalloc.start()
        measure = Measure(spec, size)
        taken, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return taken / (measure.size[0] * measure.size[1])

    bare = bytes_a_pixel()
    assert bare == pytest.approx(plain, abs=1)  # (a thread's scratch is half a byte)
    assert bytes_a_pixel("shading=[-0.3]") - bare == pytest.approx(shaded, abs=1)
    assert bytes_a_pixel("refractory=track") - bare == pytest.approx(jumping, abs=1)


def test_how_many_events_pixels_have_takes_no_memory_for_each() -> None:
    """Light of six decades that flickers, in thresholds of a millionth: 300 million events of each pixel."""
    measure = Measure(clean(threshold_on=1e-6, threshold_off=1e-6), (4, 3))
    for k in range(41):
        measure.see(Frame(np.full((3, 4), 1e3 if k % 2 else 0.0, np.float32), k * 1_000_000))
    tracemalloc.start()
    scene = measure.scene()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1_000_000 and scene.most_events > 3e8
