"""A photograph in motion: the right place at the right time, light neither made nor lost, no border seen."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from vid2ev.errors import DataError, UsageError
from vid2ev.light.spline import _turned, seen, spline_taps
from vid2ev.sources import open_source
from vid2ev.sources.motion import Pan, Saccade, parse_motion
from vid2ev.sources.photograph import BORDER_PX, Photograph

TEXTURE = np.random.default_rng(0).uniform(0, 1, (120, 160)).astype(np.float32)


def photograph(folder: Path, light: np.ndarray = TEXTURE) -> Path:
    cv2.imwrite(str(folder / "photo.tif"), light if light.ndim == 2 else light[..., ::-1])
    return folder / "photo.tif"


def blob(x: float, y: float, shape: tuple[int, int] = (120, 160), sigma: float = 4.0) -> np.ndarray:
    """A spot of light centred at (x, y) [px from the upper left corner]."""
    rows, columns = np.indices(shape) + 0.5
    return np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * sigma**2)).astype(np.float32)


def centroid(light: np.ndarray) -> tuple[float, float]:
    rows, columns = np.indices(light.shape) + 0.5
    total = light.sum(dtype=np.float64)
    return float((columns * light).sum() / total), float((rows * light).sum() / total)


# ---------------------------------------------------------------------------------------------------------- the kernel


@given(st.integers(1, 60), st.floats(-20, 60), st.floats(0.05, 6), st.integers(1, 40))
@settings(max_examples=60)
def test_the_weights_are_those_of_the_cubic_b_spline(length: int, begin: float, step: float, outputs: int) -> None:
    first, count, weights = spline_taps(length, begin, step, outputs)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    assert weights.min() >= 0 and first.min() >= 0 and np.all(first + count <= length)
    assert all(np.all(row[n:] == 0) for row, n in zip(weights, count, strict=True))
    element = BSpline.basis_element([-2, -1, 0, 1, 2], extrapolate=False)
    for i in range(0, outputs, 7):
        place, width = begin + (i + 0.5) * step, max(step, 1)
        low, high = math.floor(place - 2 * width) - 1, math.ceil(place + 2 * width) + 1
        expected = np.zeros(length)
        for k in range(low, high + 1):
            value = float(np.nan_to_num(element((k + 0.5 - place) / width)))
            expected[min(max(k, 0), length - 1)] += value
        got = np.zeros(length)
        got[first[i] : first[i] + count[i]] = weights[i, : count[i]]
        np.testing.assert_allclose(got, expected / expected.sum(), atol=1e-6)


def test_a_straight_camera_and_a_turned_one_see_the_same() -> None:
    planes = np.stack([TEXTURE, TEXTURE[::-1], TEXTURE * 3], axis=-1)
    for scale in (0.4, 1.0, 2.5):
        straight = seen(planes, (31, 22), (70.3, 55.8), 0, scale)
        out = np.empty_like(straight)
        _turned(planes, 70.3, 55.8, 1 / scale, 0.0, 1 / scale, out)
        np.testing.assert_allclose(out, straight, atol=2e-6)
        np.testing.assert_allclose(seen(planes[..., 0], (31, 22), (70.3, 55.8), 0, scale), straight[..., 0], atol=1e-6)


def test_a_quarter_turn_is_a_quarter_turn() -> None:
    square = TEXTURE[:80, :80].copy()
    straight = seen(square, (40, 40), (40, 40), 0, 1.0)
    turned = seen(square, (40, 40), (40, 40), 90, 1.0)  # the camera turns clockwise, the picture the other way
    np.testing.assert_allclose(turned, np.rot90(straight, 1), atol=1e-5)


def test_contrast_hardly_beats_with_the_place_between_pixels() -> None:
    """A grating of 4 px: its amplitude, wherever it falls; straight lines between pixels would change it by 29 %."""
    grating = np.tile(np.sin(2 * np.pi * np.arange(200) / 4).astype(np.float32) + 1, (8, 1))
    swings = []
    for shift in np.linspace(0, 1, 9):
        row = seen(grating, (120, 4), (100 + shift, 4), 0, 1.0)[2]
        swings.append(2 * abs(np.mean((row - 1) * np.exp(-2j * np.pi * np.arange(120) / 4))))
    assert max(swings) / min(swings) < 1.03


def test_what_shrinks_does_not_alias() -> None:
    fine = np.tile(np.sin(2 * np.pi * 0.3 * np.arange(400)).astype(np.float32) + 1, (400, 1))
    small = seen(fine, (80, 80), (200, 200), 0, 0.2)  # 0.3 cycles per px become 1.5: nothing of it may stay
    assert np.abs(small - 1)[:, 3:-3].max() < 0.01
    np.testing.assert_allclose(seen(np.full((50, 50), 3, np.float32), (30, 30), (25, 25), 33, 0.7), 3, rtol=1e-6)


# ---------------------------------------------------------------------------------------------------------- the paths


def test_a_pan_is_as_fast_and_goes_where_it_says(tmp_path: Path) -> None:
    path = photograph(tmp_path, blob(90.0, 70.0))
    source = open_source(path, motion="pan:speed=40,angle=30,duration_s=0.5,scale=1")
    frames = list(source.frames())
    places = np.array([centroid(frame.light) for frame in frames])
    times = np.array([frame.t_ns for frame in frames]) / 1e9
    velocity = np.polyfit(times, places, 1)[0]  # of the spot: the camera goes right and down, the spot left and up
    np.testing.assert_allclose(
        velocity, [-40 * math.cos(math.radians(30)), -40 * math.sin(math.radians(30))], rtol=2e-3
    )
    middle = [np.interp(0.25, times, column) for column in places.T]
    np.testing.assert_allclose(middle - np.array(source.size) / 2, (90 - 80, 70 - 60), atol=0.1)


def test_times_are_exact_and_steps_are_half_a_pixel(tmp_path: Path) -> None:
    source = open_source(photograph(tmp_path), motion="pan:speed=100,duration_s=0.4")
    fps = Fraction(source.describe()["fps"])
    assert 200 <= fps <= 205
    times = [frame.t_ns for frame in source.frames()]
    assert (
        times == [(2 * k * 10**9 + fps) // (2 * fps) for k in range(len(times))]
        and len(times) == source.frames_expected
    )
    assert source.duration_expected_s == pytest.approx(times[-1] / 1e9)
    given = open_source(photograph(tmp_path), motion="pan:speed=100,duration_s=0.4", fps=50)
    assert [frame.t_ns for frame in given.frames()][:2] == [0, 20_000_000] and "2 px" in given.warnings[0]


def test_a_saccade_visits_its_corners_in_the_time_eyes_take() -> None:
    saccade = Saccade(px_per_degree=10)
    for t_s, corner in ((0.0, (-5, 5)), (0.0999, (0, -5)), (0.1999, (5, 5)), (0.3, (-5, 5))):
        pose = saccade.at(np.array([t_s]))
        np.testing.assert_allclose((pose.x[0], pose.y[0]), corner, atol=1e-9)
    t_s = np.linspace(0, 0.1, 100_001)
    x, y, _, _ = saccade.at(t_s)
    speed = np.hypot(np.diff(x), np.diff(y)) / np.diff(t_s)
    degrees = math.hypot(0.5, 1.0)
    assert (speed > 1e-6).sum() * 1e-6 == pytest.approx(0.021 + 0.0022 * degrees, abs=5e-5)
    assert speed.max() == pytest.approx(1.875 * degrees * 10 / (0.021 + 0.0022 * degrees), rel=1e-4)  # 15/8 of the mean


@pytest.mark.parametrize("degrees", [0.5, 4.0, -4.0])
def test_a_larger_saccade_takes_longer_as_that_of_an_eye_does(degrees: float) -> None:
    saccade, t_s = Saccade(degrees=degrees, px_per_degree=10, duration_s=0.6), np.linspace(0, 0.2, 100_001)
    x, y, _, _ = saccade.at(t_s)
    moving = np.hypot(np.diff(x), np.diff(y)) > 1e-12
    assert moving.sum() * 2e-6 == pytest.approx(0.021 + 0.0022 * abs(degrees) * math.hypot(0.5, 1.0), abs=2e-4)


def test_saccades_in_less_time_than_eyes_take_still_end_at_their_corners() -> None:
    saccade = Saccade(degrees=1, px_per_degree=10, duration_s=0.03)
    for t_s, corner in ((0.00999999, (0, -5)), (0.01999999, (5, 5)), (0.03, (-5, 5))):
        pose = saccade.at(np.array([t_s]))
        np.testing.assert_allclose((pose.x[0], pose.y[0]), corner, atol=1e-9)


@pytest.mark.parametrize("motion", ["pan:speed=60", "saccade", "zoom:factor=3", "zoom:factor=0.5", "turn.csv"])
@pytest.mark.parametrize("size", [None, "40x30", "64", "300x40"])
def test_no_border_is_seen_and_no_more_is_lost_than_must(tmp_path: Path, motion: str, size: str | None) -> None:
    path = photograph(tmp_path)
    (tmp_path / "turn.csv").write_text("t,x,y,angle,zoom\n0,-10,0,0,1\n0.3,10,5,40,1.2\n1,0,0,-20,0.9\n")
    motion = str(tmp_path / motion) if motion.endswith(".csv") else motion
    source = Photograph(path, motion, size=size)
    least_x = least_y = math.inf
    for t_s in source._motion.begin_s + np.linspace(0, source._motion.duration_s, 201):
        pose = [float(value[0]) for value in source._motion.at(np.array([t_s]))]
        x, y, angle, zoom = pose
        for sign_x in (-1, 1):
            for sign_y in (-1, 1):
                right, down = sign_x * source.size[0] / 2 / zoom, sign_y * source.size[1] / 2 / zoom
                turn = math.radians(angle)
                place_x = 80 + (x + right * math.cos(turn) - down * math.sin(turn)) / source._scale
                place_y = 60 + (y + right * math.sin(turn) + down * math.cos(turn)) / source._scale
                least_x, least_y = min(least_x, place_x, 160 - place_x), min(least_y, place_y, 120 - place_y)
    assert min(least_x, least_y) >= -1e-6
    assert min(least_x, least_y) <= (BORDER_PX + 2) / source._scale
    if size is None:
        assert source.size[0] / source.size[1] == pytest.approx(160 / 120, rel=0.1)


def test_nothing_moves_more_than_half_a_pixel(tmp_path: Path) -> None:
    light = sum(blob(x, y, sigma=3) for x, y in ((30, 30), (130, 30), (30, 90), (130, 90)))
    source = open_source(photograph(tmp_path, light), motion="zoom:factor=1.5,duration_s=0.2")
    width, height = source.size
    places = [centroid(frame.light[: height // 2, : width // 2]) for frame in source.frames()]
    steps = np.hypot(*np.diff(np.array(places), axis=0).T)
    assert 0.05 < steps.max() <= 0.5


def test_zoom_is_even_in_its_logarithm(tmp_path: Path) -> None:
    light = blob(100.0, 60.0, sigma=2) + blob(60.0, 60.0, sigma=2)
    source = open_source(photograph(tmp_path, light), motion="zoom:factor=2,scale=1", size="60x40", fps=8)
    distances = []
    for frame in source.frames():
        left, right = frame.light[:, :30], frame.light[:, 30:]
        distances.append(centroid(right)[0] + 30 - centroid(left)[0])
    whole = [d for d in distances if d < 50]
    np.testing.assert_allclose(np.diff(np.log(whole)), math.log(2) / 8, atol=2e-3)


def test_a_path_goes_through_its_rows(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    for header in ("t,x,y\n", "", "# by hand\n"):
        file.write_text(header + "2.5,0,0\n2.6,8,-4\n2.8,8,10\n")
        source = open_source(photograph(tmp_path, blob(80.0, 60.0)), motion=str(file), fps=10, size="60x50")
        frames = list(source.frames())
        assert [frame.t_ns for frame in frames] == [2_500_000_000, 2_600_000_000, 2_700_000_000, 2_800_000_000]
        for frame, place in zip(frames, ((0, 0), (8, -4), (8, 3), (8, 10)), strict=True):
            np.testing.assert_allclose(np.array(centroid(frame.light)) - (30, 25), np.negative(place), atol=0.4)


def test_columns_without_names_are_angle_and_zoom(tmp_path: Path) -> None:
    rows = "0,1,2,30,1.5\n1,3,4,-20,0.5\n"
    poses = []
    for header in ("t,x,y,angle,zoom\n", ""):
        (tmp_path / "path.csv").write_text(header + rows)
        poses.append(parse_motion(str(tmp_path / "path.csv")).at(np.array([0.0, 1.0])))
    assert [column.tolist() for column in poses[0]] == [[1, 3], [2, 4], [30, -20], [1.5, 0.5]]
    assert [column.tolist() for column in poses[1]] == [column.tolist() for column in poses[0]]


def test_a_large_photograph_made_smaller_in_advance_shows_the_same(tmp_path: Path, monkeypatch) -> None:
    from vid2ev.sources import photograph as module

    rng = np.random.default_rng(0)
    large = cv2.GaussianBlur(rng.uniform(0, 1, (603, 805)).astype(np.float32), (0, 0), 6)
    path = photograph(tmp_path, large)
    quick = list(open_source(path, motion="pan:speed=30,angle=20", size="60x40", fps=4).frames())
    monkeypatch.setattr(module, "FINENESS", 1e9)
    slow = list(open_source(path, motion="pan:speed=30,angle=20", size="60x40", fps=4).frames())
    for a, b in zip(quick, slow, strict=True):
        np.testing.assert_allclose(a.light, b.light, atol=0.02 * np.ptp(b.light))


@pytest.mark.parametrize(("odd", "meant"), [(np.inf, 65504), (-np.inf, 0), (np.nan, 0)], ids=str)
@pytest.mark.parametrize("motion", ["pan:speed=50", "zoom", "turn.csv", "pan:scale=0.2,speed=10"])
def test_light_that_is_not_finite_is_all_of_it_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, odd: float, meant: float, motion: str
) -> None:
    """As half floats have it of the sun: the pixels around are what they are beside the brightest that there is."""
    monkeypatch.chdir(tmp_path)
    Path("turn.csv").write_text("t,x,y,angle,zoom\n0,-10,0,10,1\n0.3,10,5,40,1\n")
    seen_of = []
    for value in (odd, meant):
        light = TEXTURE.copy()
        light[60, 80] = value
        seen_of.append(
            [frame.light for frame in open_source(photograph(tmp_path, light), motion=motion, fps=4).frames()]
        )
    assert np.isfinite(seen_of[0]).all() and np.array_equal(*seen_of)


def test_parts_of_a_motion(tmp_path: Path) -> None:
    path = photograph(tmp_path)
    whole = list(open_source(path, motion="saccade", fps=100).frames())
    part = open_source(path, motion="saccade", fps=100, start=0.095, stop=0.155, slowdown=2)
    for a, b in zip(part.frames(), whole[10:16], strict=True):
        assert a.t_ns == b.t_ns / 2 and np.array_equal(a.light, b.light)
    assert len(list(part.frames(4))) == 2


def test_crop_size_and_colour(tmp_path: Path) -> None:
    colour = np.random.default_rng(0).uniform(0, 2, (60, 80, 3)).astype(np.float32)
    colour[:, :40] = (1.0, 0.5, 0.25)
    path = photograph(tmp_path, colour)
    source = open_source(path, motion="pan:speed=10", crop="40x60+0+0", size="20x20", colour="rgb", fps=5)
    for frame in source.frames():
        assert frame.light.shape == (20, 20, 3)
        np.testing.assert_allclose(frame.light, np.broadcast_to((1.0, 0.5, 0.25), (20, 20, 3)), rtol=1e-5)
    about = json.loads(json.dumps(source.describe()))
    assert (
        about["kind"] == "photograph"
        and about["motion"] == "pan"
        and about["speed"] == 10
        and about["size"] == [20, 20]
    )


def test_a_small_photograph_enlarged_is_remarked_on(tmp_path: Path) -> None:
    source = open_source(photograph(tmp_path), motion="pan:speed=100", size="320x240")
    assert "enlarged" in source.warnings[0]
    assert open_source(photograph(tmp_path), motion="pan:speed=10", size="80x60").warnings == []


@pytest.mark.parametrize(("motion", "said"), [
    ("spin", "expected pan, saccade, zoom or a file"),
    ("pan:sped=3", "parameter 'sped' is not one of duration_s, scale, speed, angle"),
    ("pan:speed=fast", "speed='fast', expected a number"),
    ("pan:speed=nan", "speed='nan', expected a number"),
    ("pan:duration_s=0", "a duration_s above 0"),
    ("zoom:factor=0", "factor 0.0"),
    ("pan:speed=1e10,duration_s=1e-9", "too much for any rate of frames"),
    ("pan:speed=5000", "leaves the photograph"),
    ("pan:speed=170,scale=1", "leaves the photograph"),
    ("nowhere.csv", "no such file"),
])  # fmt: skip
def test_motions_that_cannot_be(tmp_path: Path, motion: str, said: str) -> None:
    with pytest.raises(UsageError) as refused:
        open_source(photograph(tmp_path), motion=motion)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(("size", "said"), [("100x90", "at least"), ("40x30!", "not stretched")])
def test_sizes_that_cannot_be(tmp_path: Path, size: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        open_source(photograph(tmp_path), motion="pan:speed=100,scale=1", size=size)


@pytest.mark.parametrize("text", [
    "", "0,1,2\n", "0,1,2\n0,3,4\n", "0,1\n1,2\n", "0,0,0\n1,soon,0\n", "0,0,0\n1,nan,0\n", "0,0,0,0,1\n1,0,0,0,0\n",
    "1e12,0,0\n1000000000001,5,0\n", "0,0,0\n1e300,5,0\n", "t,x,z\n0,0,0\n1,1,1\n",
    "0,0,0\n1,1\n", "0,0,0,0,1,5\n1,0,0,0,1,5\n",
])  # fmt: skip
def test_bad_paths_are_refused_by_name(tmp_path: Path, text: str) -> None:
    (tmp_path / "path.csv").write_text(text)
    with pytest.raises(DataError, match=r"path\.csv"):
        open_source(photograph(tmp_path), motion=str(tmp_path / "path.csv"))


def test_saccades_to_the_other_side_take_as_long() -> None:
    t_s = np.linspace(0, 0.3, 301)
    there, back = (Saccade(degrees=degrees, px_per_degree=1).at(t_s) for degrees in (20, -20))
    np.testing.assert_allclose(np.column_stack(back[:2]), -np.column_stack(there[:2]), atol=1e-9)


def test_motions_are_parsed() -> None:
    assert parse_motion("pan") == Pan() and parse_motion("pan:speed=3,angle=-90") == Pan(speed=3, angle=-90)
