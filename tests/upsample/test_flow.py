"""Flow: exact where nothing moves, much better than cross-fades where something does, harmless where it fails."""

from __future__ import annotations

from itertools import islice, pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage import data

from vid2ev.stream.frames import Frame
from vid2ev.stream.still import strip_count
from vid2ev.upsample import flow, make_upsampler
from vid2ev.upsample.flow import FlowUpsampling, Moving
from vid2ev.upsample.flow import carried as carried_between
from vid2ev.upsample.motion import Motion, MotionEstimator, changing_part, convincing
from vid2ev.upsample.proxies import agreement
from vid2ev.upsample.subframes import instants, steps_for
from vid2ev.upsample.warp import AFTER, BEFORE, carry, moving_of, settle, splat

F = np.float32
INTERVAL_NS = 33_333_333


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    """dB, against the codes of a display (light ** (1 / 2.2))."""
    errors = np.clip(a, 0, 1) ** (1 / 2.2) - np.clip(b, 0, 1) ** (1 / 2.2)
    return float(-10 * np.log10(np.mean(np.square(errors)) + 1e-12))


def pan(
    photograph: np.ndarray, shifts: list[tuple[float, float]], size: tuple[int, int] = (160, 120)
) -> list[np.ndarray]:
    """Light that a camera sees of a photograph from these places [px]; each pixel averages 4 x 4 of its points."""
    light = (photograph.astype(F) / 255) ** F(2.2)
    width, height = size
    views = []
    for x, y in shifts:
        place = np.array([[1, 0, 4 * (20 + x)], [0, 1, 4 * (20 + y)]], F)
        fine = cv2.warpAffine(light, place, (4 * width, 4 * height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        views.append(cv2.resize(fine, size, interpolation=cv2.INTER_AREA))
    return views


def enlarged(photograph: np.ndarray) -> np.ndarray:
    return cv2.resize(photograph, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)


def between(a: np.ndarray, b: np.ndarray, subframes: int | str = 2, **options) -> list[np.ndarray]:
    made = make_upsampler("flow", subframes, **options).between(Frame(a, 0), Frame(b, INTERVAL_NS))
    return [frame.light for frame in made][:-1]


@pytest.mark.parametrize("photograph", ["gravel", "camera", "grass"])
@pytest.mark.parametrize(("step", "better_db"), [((0.4, 0.3), 0.5), ((1.5, 0.0), 10), ((3.0, -2.5), 10)])
def test_a_panned_photograph_is_rebuilt(photograph: str, step: tuple[float, float], better_db: float) -> None:
    """The frame in the middle is dropped and rebuilt, so many dB better than by a cross-fade, at the border half."""
    before, truth, after = pan(
        enlarged(getattr(data, photograph)()), [(k * step[0], k * step[1]) for k in range(3)], (200, 150)
    )
    (made,) = between(before, after)
    assert psnr(made, truth) > psnr((before + after) / 2, truth) + better_db
    rim = np.ones(made.shape, bool)
    rim[8:-8, 8:-8] = False
    assert psnr(made[rim], truth[rim]) > psnr(((before + after) / 2)[rim], truth[rim]) + better_db / 2


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_a_photograph_before_a_wall_covers_and_uncovers_it(share: float) -> None:
    """Parallax: what only one frame sees is taken from that one, without a double."""
    wall, thing = enlarged(data.gravel()), enlarged(data.camera())

    def scene(t: float) -> np.ndarray:
        picture = pan(wall, [(2 * t, 0)])[0]
        front = pan(thing, [(60 + 12 * t, 40)])[0]
        left = 50 - 12 * t  # the card moves with what is printed on it
        columns = np.arange(picture.shape[1])
        cover = (np.clip(columns - left + 0.5, 0, 1) * np.clip(left + 50 - columns + 0.5, 0, 1)).astype(F)
        cover = np.outer((np.abs(np.arange(120) - 60) < 35).astype(F), cover)
        return picture + cover * (front - picture)

    before, truth, after = scene(0), scene(share), scene(1)
    made = between(before, after, 4)[round(4 * share) - 1]
    fade = before + F(share) * (after - before)
    assert psnr(made, truth) > psnr(fade, truth) + 6
    swept = np.zeros(made.shape, bool)
    swept[25:95, 38:52] = swept[25:95, 86:102] = True  # what the card's edges pass over
    assert psnr(made[swept], truth[swept]) > psnr(fade[swept], truth[swept]) + 4


def test_the_ends_are_approached_evenly() -> None:
    """No jump between a frame of the source and the one made next to it."""
    before, after = pan(enlarged(data.gravel()), [(0, 0), (6, 0)])
    made = [before, *between(before, after, 24), after]
    changes = [np.sqrt(np.mean(np.square(b - a))) for a, b in pairwise(made)]
    assert max(changes) < 1.6 * float(np.median(changes))


@given(st.integers(0, 2**32 - 1), st.integers(24, 50), st.integers(24, 50))
@settings(max_examples=20)
def test_where_nothing_moves_nothing_changes(seed: int, height: int, width: int) -> None:
    light = np.random.default_rng(seed).uniform(0, 4, (height, width)).astype(F)
    for made in between(light, light.copy(), 3):
        np.testing.assert_array_equal(made, light)
    assert between(light, light.copy(), "auto") == []


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_no_light_is_invented(seed: int) -> None:
    """Every frame in between stays within the range of its two frames: no ringing, nothing negative."""
    rng = np.random.default_rng(seed)
    before = (rng.uniform(0, 1, (40, 56)) > 0.7).astype(F) * 3
    after = np.roll(before, rng.integers(-3, 4, 2), (0, 1))
    for made in between(before, after, 5):
        assert made.min() >= 0 and made.max() <= 3


@pytest.mark.parametrize("shape", [(1, 1), (1, 400), (7, 9), (23, 90), (24, 24), (25, 47)])
def test_any_size(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    before, after = rng.uniform(0, 1, (2, *shape)).astype(F)
    for made in between(before, after, 4):
        assert made.shape == shape and np.isfinite(made).all()
    if min(shape) < 24:  # too small to see motion: a cross-fade
        np.testing.assert_allclose(between(before, after)[0], (before + after) / 2, atol=1e-6)


@pytest.mark.parametrize("bad", [(np.nan, np.inf), (3e38, 3e38)])  # (finite; its hundredths are not)
def test_a_bad_pixel_spoils_no_other(bad: tuple[float, float]) -> None:
    before, after = pan(enlarged(data.gravel()), [(0, 0), (3, 0)])
    whole = between(before, after)[0]
    before, after = before.copy(), after.copy()
    before[60, 80], after[20, 30] = bad
    spoiled = between(before, after)[0]
    assert np.isfinite(spoiled).all()
    far = np.ones(whole.shape, bool)
    far[40:80, 60:100] = far[0:40, 10:50] = False
    assert psnr(spoiled[far], whole[far]) > 45


@pytest.mark.parametrize(
    ("step", "interval_ns"), [(1.0, INTERVAL_NS), (4.0, INTERVAL_NS), (8.0, INTERVAL_NS), (4.0, 4_000_000)]
)
def test_auto_follows_the_motion(step: float, interval_ns: int) -> None:
    before, after = pan(enlarged(data.gravel()), [(0, 0), (step, 0)])
    made = list(make_upsampler("flow").between(Frame(before, 0), Frame(after, interval_ns)))
    assert steps_for(0.9 * step, interval_ns * 1e-9) <= len(made) <= steps_for(1.15 * step, interval_ns * 1e-9)


def test_auto_takes_no_steps_for_what_a_sensor_does_not_see() -> None:
    before, after = pan(enlarged(data.gravel()), [(0, 0), (4, 0)])
    faint = [F(0.5) + F(0.01) * light for light in (before, after)]
    assert between(*faint, "auto") == []
    assert len(between(*faint, "auto", threshold=0.002)) > 3


def test_the_most_steps_are_kept_to_and_counted() -> None:
    before, after = pan(enlarged(data.gravel()), [(0, 0), (8, 0)])
    upsampler = make_upsampler("flow", max_subframes=5)
    interval = upsampler.between(Frame(before, 0), Frame(after, INTERVAL_NS))
    assert len(list(interval)) == 5 and interval.limited
    assert not upsampler.between(Frame(before, 0), Frame(before, INTERVAL_NS)).limited
    ends = Frame(before, 0), Frame(after, INTERVAL_NS)
    asked = len(list(FlowUpsampling("auto", 1000).between(*ends)))
    assert [FlowUpsampling("auto", asked - k).between(*ends).limited for k in (0, 1)] == [False, True]
    assert not FlowUpsampling(3, 2).between(*ends).limited  # (which is what was asked for)


def test_what_a_thing_has_just_passed_is_not_said_to_be_still() -> None:
    """A block falls through rows, each a strip, that are as before once it is gone."""
    before, after = np.full((2, 64, 256), 0.2, F)
    before[10:14, 100:120] = after[50:54, 100:120] = 1
    flow, back = np.zeros((2, 32, 128, 2), F)
    flow[5:7, 50:60, 1], back[25:27, 50:60, 1] = 20, -20
    motion = Motion(flow, back, F(0.01) + abs(flow[..., 1] / 20), F(0.01) + abs(back[..., 1] / 20), 40.0, 1.0)
    last, lit = before, np.zeros(64, bool)
    for frame in carried_between(Frame(before, 0), Frame(after, 10**6), motion, instants(0, 10**6, 10)):
        same = (frame.light == last).all(axis=1)
        assert not np.any(frame.still.strips & ~same)
        assert frame.still.strips.any()
        last, lit = frame.light, lit | (frame.light > 0.5).any(axis=1)
    assert np.count_nonzero(lit) > 30


def test_threads_of_opencv_change_nothing() -> None:
    before, after = pan(enlarged(data.camera()), [(0, 0), (5, 2)], (320, 240))
    threads = cv2.getNumThreads()
    try:
        made = []
        for count in (1, 2, 4):
            cv2.setNumThreads(count)
            made.append(between(before, after, 3))
    finally:
        cv2.setNumThreads(threads)
    np.testing.assert_array_equal(made[0], made[1])
    np.testing.assert_array_equal(made[0], made[2])


# ------------------------------------------------------------------------------------------------------- the kernels


def carried(
    before: np.ndarray, after: np.ndarray, velocity: tuple[float, float], time: float, weight: float
) -> np.ndarray:
    motion = np.empty((3, *before.shape), F)
    motion[0], motion[1], motion[2] = velocity[0], velocity[1], weight
    out = np.empty(before.shape, F)
    before, after = (cv2.copyMakeBorder(x, BEFORE, AFTER, BEFORE, AFTER, cv2.BORDER_REPLICATE) for x in (before, after))
    carry(before, after, motion, 0, 0, F(time), out, np.empty(strip_count(*out.shape[::-1]), np.bool_))
    return out


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 1), st.sampled_from([0.0, 0.3, 1.0]))
@settings(max_examples=50)
def test_a_moving_ramp_is_exact_at_any_fraction_of_a_pixel(
    across: float, down: float, time: float, weight: float
) -> None:
    rows, columns = np.indices((20, 24), np.float64)

    def ramp(t: float) -> np.ndarray:
        x, y = columns - t * across, rows - t * down
        return (2 + 0.05 * x + 0.03 * y).astype(F)

    made = carried(ramp(0), ramp(1), (across, down), time, weight)
    np.testing.assert_allclose(made[5:-5, 5:-5], ramp(time)[5:-5, 5:-5], atol=2e-6)


def test_a_parabola_is_exact_too() -> None:
    columns = np.arange(30.0)

    def curve(t: float) -> np.ndarray:
        return np.tile((0.001 * (columns + 3 - t * 1.7) ** 2).astype(F), (8, 1))

    for time in (0.2, 0.5, 0.9):
        made = carried(curve(0), curve(1), (1.7, 0), time, 0.5)
        np.testing.assert_allclose(made[:, 5:-5], curve(time)[:, 5:-5], atol=1e-6)


def test_wild_motion_stays_inside() -> None:
    picture = np.random.default_rng(0).uniform(1, 2, (6, 7)).astype(F)
    for velocity in ((1e30, -1e30), (np.nan, np.inf), (-np.inf, np.nan)):
        made = carried(picture, picture, velocity, 0.5, 0.5)
        assert made.min() >= 1 and made.max() <= 2


@given(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(0.05, 0.95))
@settings(max_examples=30)
def test_even_motion_is_thrown_to_even_motion(across: float, down: float, time: float) -> None:
    flow = np.empty((12, 14, 2), F)
    flow[..., 0], flow[..., 1] = across, down
    sure = agreement(flow, -flow)
    inside = np.pad(np.ones((6, 8), bool), 3)
    np.testing.assert_allclose(sure[inside], 1, atol=1e-6)
    field, motion = np.zeros((14, 16, 4), F), np.empty((3, 12, 14), F)
    splat(moving_of(flow, sure, F(1e-3), 2, field), F(time), F(1), F(1 - time), 2, field)
    splat(moving_of(-flow, sure, F(1e-3), 3, field), F(1 - time), F(-1), F(time), 3, field)
    settle(field, F(time), F(0.05), motion)
    np.testing.assert_allclose(motion[0][inside], across, atol=1e-4)
    np.testing.assert_allclose(motion[1][inside], down, atol=1e-4)


def test_flows_that_contradict_each_other_are_unsure() -> None:
    flow = np.full((10, 10, 2), 2, F)
    assert agreement(flow, flow).max() < 0.01
    sure = agreement(flow, -flow)
    assert sure[:8, :8].min() > 0.99 and sure[8:].max() == 0 and sure[:, 8:].max() == 0  # (leads outside)


@pytest.mark.parametrize("there", [(0.0, 0.0), (1.5, -0.5)])
@pytest.mark.parametrize("back", [(0.0, 0.0), (-1.5, 0.5), (0.8, 0.0), (0.0, -3.0)])
def test_flows_agree_by_how_far_one_leads_back(there: tuple[float, float], back: tuple[float, float]) -> None:
    """exp(-|there + back|^2 / (0.01 (|there|^2 + |back|^2) + 0.5)), also where nothing moves one way."""
    missed = (there[0] + back[0]) ** 2 + (there[1] + back[1]) ** 2
    allowed = 0.01 * (there[0] ** 2 + there[1] ** 2 + back[0] ** 2 + back[1] ** 2) + 0.5
    sure = agreement(*(np.full((9, 9, 2), flow, F) for flow in (there, back)))
    np.testing.assert_allclose(sure[1:7, :7], np.exp(-missed / allowed), rtol=1e-5)


@pytest.mark.parametrize("shape", [(64, 96), (25, 47), (31, 75), (75, 31)])
def test_motion_goes_as_far_in_the_frame_as_on_its_grid(shape: tuple[int, int]) -> None:
    rows, columns = shape[0] // 2, shape[1] // 2
    flow, sure = np.full((rows, columns, 2), (1.0, -0.5), F), np.ones((rows, columns), F)
    x, y, _ = Moving(Motion(flow, -flow, sure, sure, 2.0, 1.0), shape).at(F(0.5))
    np.testing.assert_allclose(x[6:-6, 6:-6], shape[1] / columns, rtol=1e-4)
    np.testing.assert_allclose(y[6:-6, 6:-6], -0.5 * shape[0] / rows, rtol=1e-4)


@pytest.mark.parametrize("time", [0.25, 0.5, 0.75])
def test_what_grows_is_seen_by_both_frames_though_its_pixels_are_thrown_apart(time: float) -> None:
    """Nearer by a factor of 1.6 everywhere: pixels of the frame before become fewer, those of the one after more."""
    place = np.stack(np.meshgrid(np.arange(60) - 29.5, np.arange(40) - 19.5), axis=-1).astype(F)
    sure = np.ones((40, 60), F)
    moving = Moving(Motion(F(0.6) * place, F(-0.6 / 1.6) * place, sure, sure, 40.0, 1.0), (80, 120))
    share = moving.at(F(time))[2][30 - moving.top : 50 - moving.top, 50 - moving.left : 70 - moving.left]
    np.testing.assert_allclose(share, 1 - time, atol=0.04)


@pytest.mark.parametrize("time", [0.25, 0.5, 0.75])
def test_where_both_frames_see_a_thing_the_nearer_one_counts_more(time: float) -> None:
    """The velocities of both are thrown to where the thing is at the time."""
    flow, back = np.zeros((2, 40, 60, 2), F)
    flow[5:13, 20:40, 1], back[25:33, 20:40, 1] = 20, -20
    sure, other = (F(0.01) + abs(each[..., 1] / 20) for each in (flow, back))
    moving = Moving(Motion(flow, back, sure, other, 40.0, 1.0), (80, 120))
    _, y, share = moving.at(F(time))
    middle = round(2 * (9 + 20 * time)) - moving.top
    seen = slice(middle - 2, middle + 2), slice(50 - moving.left, 70 - moving.left)
    np.testing.assert_allclose(share[seen], 1 - time, atol=0.02)
    np.testing.assert_allclose(y[seen], 40, rtol=0.02)


@pytest.mark.parametrize("odd", [0, 1])
def test_outside_the_part_that_moves_light_is_as_if_the_motion_of_all_were_thrown(odd: int, monkeypatch) -> None:
    """Up to rounding; a wide frame of which a little moves, at its border too."""
    card = pan(enlarged(data.camera()), [(0, 0)])[0][20:50, 30:70]
    wall = pan(enlarged(data.gravel()), [(0, 0)], (240 + odd, 160))[0]
    before, after = np.stack([wall, wall])
    before[4:34, 2:42], after[8:38, 6:46] = card, card
    motion = MotionEstimator().between(before, after)
    moving = Moving(motion, before.shape)
    assert moving.height < 100 and (moving.width < 100) != odd
    times = instants(0, 10**6, 5)
    frames = Frame(before, 0), Frame(after, 10**6)
    part = list(carried_between(*frames, motion, times))
    monkeypatch.setattr(flow, "REACH", 1000)
    for one, other in zip(part, carried_between(*frames, motion, times), strict=True):
        np.testing.assert_allclose(one.light, other.light, rtol=3e-7)
        np.testing.assert_array_equal(one.still.strips, other.still.strips)


@given(st.integers(0, 2**32 - 1), st.integers(12, 90), st.integers(12, 90))
@settings(max_examples=50)
def test_no_flow_convinces_outside_the_part_that_changes(seed: int, height: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = rng.integers(0, 256, (2, height, width), np.uint8)
    still = np.ones((height, width), bool)
    still[rng.integers(height) :, rng.integers(width) :] = False
    end[still] = start[still]
    flow = rng.normal(0, 5, (height, width, 2)).astype(F)
    part = changing_part(cv2.absdiff(start, end), 1.0)
    kept = convincing(flow, start, end, 1.0) != 0
    if part is not None:
        kept[part] = False
    assert not kept.any()


@given(st.integers(1, 2000), st.integers(1, 2000), st.integers(0, 1999), st.integers(0, 1999))
@settings(max_examples=50)
def test_the_part_that_changes_is_matched_from_as_far_as_the_whole(rows: int, columns: int, y: int, x: int) -> None:
    """DIS halves pictures while the longer side has some four patches, and the shorter has one."""

    def halvings(height: int, width: int) -> int:
        longest, shortest = max(height, width), min(height, width)
        return max(0, min(int(np.log2(longest / 32) + 0.5), int(np.log2(max(1, shortest // 8)))))

    difference = np.zeros((rows, columns), np.uint8)
    assert changing_part(difference, 1.0) is None
    difference[y % rows, x % columns] = 255
    part = difference[changing_part(difference, 1.0)]
    assert part.max() == 255 and halvings(*part.shape) >= halvings(rows, columns)


def test_motion_that_is_hardly_seen_asks_for_no_steps() -> None:
    """Of a picture whose lower half has little contrast, and moves far, what moves a little above counts."""
    near, far = (enlarged(photograph) for photograph in (data.gravel(), data.grass()))
    frames = []
    for k in range(2):
        above, below = pan(near, [(k, 0)])[0], pan(far, [(6 * k, 0)])[0]
        frames.append(np.where(np.arange(120)[:, None] < 60, above, F(0.5) * np.exp(F(0.15) * (below - below.mean()))))
    assert 0.5 < MotionEstimator(threshold=0.15).between(*frames).shift_px < 2
    assert MotionEstimator(threshold=0.01).between(*frames).shift_px > 4


# ------------------------------------------------------------------------------------------------------- real clips


@pytest.mark.parametrize(("name", "start", "better_db"), [
    ("gopro_karma.mp4", 0, 5.0),
    ("sam2_02_cups.mp4", 60, 3.5),
    ("sam2_05_default_juggle.mp4", 20, 1.5),
    ("intel_car-detection.mp4", 100, 2.0),
])  # fmt: skip
def test_dropped_frames_of_real_clips_are_rebuilt(name: str, start: int, better_db: float) -> None:
    """Every other frame is dropped and rebuilt; on average so many dB better than a cross-fade."""
    from vid2ev.sources import open_source

    path = Path(__file__).parents[2] / ".." / "shared" / "data" / "videos" / name
    if not path.exists():
        pytest.skip("the real clips are not here (../shared/data/videos)")
    frames = [frame.light for frame in islice(open_source(path).frames(start), 13)]
    gains = []
    for before, truth, after in zip(frames[:-2:2], frames[1:-1:2], frames[2::2], strict=True):
        gains.append(psnr(between(before, after)[0], truth) - psnr((before + after) / 2, truth))
    assert float(np.mean(gains)) > better_db


def test_it_is_what_the_factory_makes() -> None:
    assert isinstance(make_upsampler("flow"), FlowUpsampling)
