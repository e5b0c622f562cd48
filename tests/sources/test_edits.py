"""Start, stop, slowdown, crop and size of any source."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vid2ev.errors import UsageError
from vid2ev.light.resample import resampled, taps_of
from vid2ev.light.tags import BT709_WEIGHTS
from vid2ev.rig.intrinsics import Intrinsics
from vid2ev.sources import footage, open_source
from vid2ev.sources.framing import Box, crop_box, of_shape, parse_size
from vid2ev.sources.with_depth import WithDepth, parse_depth


def rising(count: int, shape: tuple[int, int] = (32, 48)) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    scene = rng.integers(0, 100, shape)
    return [(scene + 3 * k).astype(np.uint8) for k in range(count)]


def same(part, whole) -> None:
    part, whole = list(part), list(whole)
    assert [frame.t_ns for frame in part] == [frame.t_ns for frame in whole]
    for a, b in zip(part, whole, strict=True):
        np.testing.assert_array_equal(a.light, b.light)


# ---------------------------------------------------------------------------------------------------------- start, stop

FILES = [
    ("a.mp4", "libx264", {"g": "8", "bf": "3"}),
    ("a.mkv", "libx264", {"g": "8", "bf": "2", "x264-params": "open-gop=1"}),
    ("a.mp4", "libx264", {"x264-params": "intra-refresh=1:keyint=10"}),
    ("a.mp4", "libx265", {"x265-params": "keyint=8:open-gop=1:bframes=3:log-level=none"}),
    ("a.mkv", "ffv1", {"g": "5"}),
    ("a.webm", "libvpx-vp9", {"g": "8", "cpu-used": "8"}),
    ("a.avi", "mpeg4", {"g": "6"}),
    ("a.ts", "libx264", {"g": "8", "bf": "2"}),
    ("a.h264", "libx264", {"g": "8"}),
]


@pytest.mark.parametrize(("name", "codec", "options"), FILES)
def test_a_part_is_the_frames_of_the_whole_with_those_times(encode, name: str, codec: str, options) -> None:
    pictures = rising(40, (96, 128))  # (x265 damages memory with pictures much smaller)
    if codec != "ffv1":
        pictures = [frame.reformat(format="yuv420p") for frame in map(as_video_frame, pictures)]
    path = encode(name, pictures, codec=codec, options=options, time_base=Fraction(1, 30))
    whole = list(open_source(path).frames())
    begin_s = whole[0].t_ns / 1e9
    for start, stop in ((None, 0.5), (0.4, None), (0.3001, 0.7), (1.0, 1.0), (0.8, 1.2), (1.3, None), (0, 0.0)):
        since, until = (None if edge is None else begin_s + edge for edge in (start, stop))
        edges = (-1 if since is None else since, 999 if until is None else until)
        low, high = (Fraction(str(edge)) * 10**9 for edge in edges)
        expected = [frame for frame in whole if low <= frame.t_ns <= high]
        part = open_source(path, start=since, stop=until) if expected else None
        if part is None:
            with pytest.raises(UsageError, match="no frame from"):
                open_source(path, start=since, stop=until)
            continue
        same(part.frames(), expected)
        same(part.frames(1), expected[1:])


def as_video_frame(grey: np.ndarray):
    import av

    return av.VideoFrame.from_ndarray(grey, format="gray")


def test_only_what_is_needed_is_decoded(encode, stamps_passing) -> None:
    path = encode("a.mp4", rising(200, (16, 16)), codec="libx264", options={"g": "10", "bf": "0"})
    source = open_source(path, start=5.0, stop=5.2)
    seen = stamps_passing("_decoded")
    assert len(list(source.frames())) == 7
    assert len(seen) <= 10 + 7 + 1


def test_a_key_frame_that_the_decoder_guesses_is_none_to_begin_with(encode, monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of 4:4:4 by x264 of before 2017, where its name at the beginning of the file is not read."""
    path = encode("a.mp4", rising(200, (16, 16)), codec="libx264", options={"g": "10", "bf": "0"})
    whole = [frame for frame in open_source(path).frames() if 5 * 10**9 <= frame.t_ns <= 5.2 * 10**9]
    decoded = footage._decoded

    def guessed(container, stream, planned, remarks):
        for picture in decoded(container, stream, planned, remarks):
            if planned:  # (from the beginning)
                yield picture
            else:
                remarks.append("guessed")
                yield SimpleNamespace(pts=picture.pts, time_base=picture.time_base, key_frame=True, is_corrupt=True)

    source = open_source(path, start=5.0, stop=5.2)
    monkeypatch.setattr(footage, "_decoded", guessed)
    same(source.frames(), whole)
    assert len(whole) == 7 and not source.warnings


def test_parts_tile_the_whole(encode) -> None:
    path = encode("a.mkv", rising(30))
    whole = [frame.t_ns for frame in open_source(path).frames()]
    edge = whole[11] / 1e9
    first, second = (open_source(path, **part) for part in ({"stop": edge}, {"start": edge}))
    times = [frame.t_ns for frame in first.frames()], [frame.t_ns for frame in second.frames()]
    assert times[0] + times[1][1:] == whole and times[0][-1] == times[1][0]


@pytest.mark.parametrize("kind", ["folder", "npy", "npz", "synthetic"])
def test_parts_of_other_sources(tmp_path: Path, kind: str) -> None:
    import cv2

    stack = np.random.default_rng(0).uniform(0, 1, (10, 4, 6)).astype(np.float32)
    path: Path | str = tmp_path / f"a.{kind}"
    if kind == "folder":
        path = tmp_path
        for k, picture in enumerate(stack):
            cv2.imwrite(str(tmp_path / f"{k}.tif"), picture)
    elif kind == "npy":
        np.save(path, stack)
    elif kind == "npz":
        np.savez(path, frames=stack)
    else:
        path = "synthetic:sine,size=6x4,duration_s=0.9"
    whole = list(open_source(path, fps=10).frames())
    part = open_source(path, fps=10, start=0.25, stop=0.7)
    same(part.frames(), whole[3:8])
    for start in (2, 4, 5):
        same(part.frames(start), whole[3 + start : 8])
    assert part.duration_expected_s == pytest.approx(0.4)
    assert part.rewindable and part.describe()["edits"] == {"start_s": 0.25, "stop_s": 0.7}


def test_expectations_follow_the_part(encode) -> None:
    path = encode("a.mp4", rising(60), codec="libx264", time_base=Fraction(1, 30))
    whole = open_source(path)
    assert whole.frames_expected == 60 and whole.duration_expected_s == pytest.approx(2.0)
    part = open_source(path, start=0.5, stop=1.0, slowdown=4)
    assert part.duration_expected_s == pytest.approx(0.125)
    assert abs(part.frames_expected - len(list(part.frames()))) <= 1
    json.dumps(part.describe())


def test_a_part_has_no_more_frames_than_the_whole(encode) -> None:
    path = encode("a.mp4", rising(20), codec="libx264", time_base=Fraction(1, 30))
    for options in ({"stop": 99}, {"start": 0, "stop": 99}, {"start": 0}):
        part = open_source(path, **options)
        assert part.frames_expected == len(list(part.frames())) == 20


@pytest.mark.parametrize(("options", "said"), [
    ({"start": 9}, "no frame from 9 s to its end; it goes from 0 s to"),
    ({"stop": -1}, "no frame from its beginning to -1 s"),
    ({"start": 0.001, "stop": 0.002}, "no frame from 0.001 s to 0.002 s"),
    ({"start": 1, "stop": 0.5}, "stop 0.5 s: before start 1 s"),
    ({"start": float("nan")}, "start nan"),
    ({"stop": 1e30}, "stop 1e"),
    ({"slowdown": 0}, "slowdown 0"),
    ({"slowdown": -2}, "slowdown -2"),
    ({"slowdown": float("inf")}, "slowdown inf"),
    ({"crop": "10"}, "crop '10'"),
    ({"crop": "0x5"}, "crop '0x5'"),
    ({"crop": "10x10+40+0"}, "has 48x32"),
    ({"crop": "49x2"}, "has 48x32"),
    ({"crop": "4x4+-1+0"}, "crop '4x4"),
    ({"crop": (4, 4)}, "crop '(4, 4)'"),
    ({"crop": 4}, "crop '4'"),
    ({"size": "0"}, "size '0'"),
    ({"size": "axb"}, "size 'axb'"),
    ({"size": "99999x10"}, "expected 1 to"),
    ({"motion": "pan"}, "is for a photograph"),
])  # fmt: skip
def test_what_cannot_be_is_refused_before_anything_is_done(encode, options, said: str) -> None:
    path = encode("a.mkv", rising(5))
    with pytest.raises(UsageError) as refused:
        open_source(path, **options)
    assert said in str(refused.value)


# ---------------------------------------------------------------------------------------------------------- slowdown


@given(st.fractions(Fraction(1, 100), 100, max_denominator=1000))
@settings(max_examples=20)
def test_times_are_divided_exactly(slowdown: Fraction) -> None:
    clip = "synthetic:sine,size=1x1,fps=240,duration_s=0.2"
    whole, slowed = open_source(clip), open_source(clip, slowdown=slowdown)
    for before, after in zip(whole.frames(), slowed.frames(), strict=True):
        assert abs(after.t_ns - Fraction(before.t_ns) / slowdown) <= Fraction(1, 2)
    assert slowed.duration_expected_s == pytest.approx(0.2 / slowdown)


def test_240_fps_shown_at_30_become_240_again(encode) -> None:
    path = encode("a.mp4", rising(50), codec="libx264", time_base=Fraction(1, 30))
    for k, frame in enumerate(open_source(path, slowdown=8).frames()):
        assert abs(frame.t_ns - Fraction(k, 240) * 10**9) <= 1
    part = open_source(path, slowdown=8, start=1)  # (start is on the source's own clock)
    assert next(part.frames()).t_ns == 125_000_000


def test_frames_that_come_to_lie_on_each_other_are_refused(tmp_path: Path) -> None:
    from vid2ev.errors import DataError

    np.save(tmp_path / "a.npy", np.zeros((3, 2, 2), np.float32))
    with pytest.raises(DataError, match="one nanosecond"):
        list(open_source(tmp_path / "a.npy", fps=1e9, slowdown=1000).frames())
    np.save(tmp_path / "a_timestamps.npy", 1.7e9 + np.arange(3))  # (seconds since 1970)
    with pytest.raises(DataError, match=r"slowdown 0\.25: a frame at 1\.7e\+09 s .* use more"):
        list(open_source(tmp_path / "a.npy", slowdown=0.25).frames())


# ---------------------------------------------------------------------------------------------------------- crop, size


def array(tmp_path: Path, picture: np.ndarray) -> Path:
    np.save(tmp_path / "a.npy", picture[None])
    return tmp_path / "a.npy"


def framed(tmp_path: Path, picture: np.ndarray, **options) -> np.ndarray:
    source = open_source(array(tmp_path, picture), fps=1, **options)
    (frame,) = source.frames()
    assert frame.light.shape[:2] == source.size[::-1] and frame.light.flags.c_contiguous
    assert frame.light.dtype == np.float32 and source.describe()["size"] == list(source.size)
    return frame.light


def test_a_crop_is_that_part(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).uniform(0, 9, (20, 30)).astype(np.float32)
    np.testing.assert_array_equal(framed(tmp_path, picture, crop="8x5+3+4"), picture[4:9, 3:11])
    np.testing.assert_array_equal(framed(tmp_path, picture, crop="10x10"), picture[5:15, 10:20])
    np.testing.assert_array_equal(framed(tmp_path, picture, crop="30x20+0+0"), picture)
    np.testing.assert_allclose(framed(tmp_path, picture, crop="8x4+2+2", size="4"), means(picture[2:6, 2:10], 2), 1e-6)


def means(picture: np.ndarray, factor: int) -> np.ndarray:
    height, width = picture.shape
    blocks = picture.reshape(height // factor, factor, width // factor, factor)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def test_a_smaller_size_is_a_mean_of_light(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).uniform(0, 50, (24, 36)).astype(np.float32)
    for size, factor in (("12", 3), ("18x12", 2), ("9x6", 4)):
        np.testing.assert_allclose(framed(tmp_path, picture, size=size), means(picture, factor), rtol=1e-6)


def test_opencv_agrees_on_areas_that_are_no_whole_pixels(tmp_path: Path) -> None:
    import cv2

    picture = np.random.default_rng(0).uniform(0, 5, (96, 133)).astype(np.float32)
    for size in ("100x60!", "133x95!", "17x5!"):
        width, height = map(int, size[:-1].split("x"))
        expected = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
        np.testing.assert_allclose(framed(tmp_path, picture, size=size), expected, rtol=2e-5)


def test_the_shape_is_kept_unless_told_otherwise(tmp_path: Path) -> None:
    picture = np.zeros((40, 80), np.float32)
    picture[:, 20:60] = 1  # the middle square
    np.testing.assert_allclose(framed(tmp_path, picture, size="10x10"), 1, rtol=1e-6)
    stretched = framed(tmp_path, picture, size="10x10!")
    np.testing.assert_allclose(stretched[:, [0, 1, 8, 9]], 0)
    np.testing.assert_allclose(stretched[:, 3:7], 1, rtol=1e-6)
    assert open_source(array(tmp_path, picture), fps=1, size="20").size == (20, 10)


def test_same_size_is_the_same_picture(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).uniform(0, 9, (21, 31)).astype(np.float32)
    np.testing.assert_array_equal(framed(tmp_path, picture, size="31x21"), picture)
    np.testing.assert_array_equal(framed(tmp_path, picture, size="20x21"), picture[:, 5:25])  # no half pixels


sides = st.integers(1, 40)


@given(sides, sides, sides, sides, st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_light_is_made_or_lost(width: int, height: int, new_width: int, new_height: int, seed: int) -> None:
    """Flat stays flat, nothing goes beyond the darkest and brightest pixel, and a mean of means is the mean."""
    picture = np.random.default_rng(seed).exponential(1, (height, width)).astype(np.float32)
    taps = (taps_of(n, Fraction(0), Fraction(n), m) for n, m in ((height, new_height), (width, new_width)))
    rows, columns = taps
    made = resampled(picture, rows, columns)
    assert made.min() >= picture.min() * (1 - 1e-6) and made.max() <= picture.max() * (1 + 1e-6)
    np.testing.assert_allclose(resampled(np.full_like(picture, 7), rows, columns), 7, rtol=1e-6)
    if new_width <= width and new_height <= height:
        assert made.mean(dtype=np.float64) == pytest.approx(picture.mean(dtype=np.float64), rel=1e-5)


def test_enlarging_is_a_straight_line_and_makes_no_ringing(tmp_path: Path) -> None:
    ramp = np.tile(np.arange(16, dtype=np.float32), (4, 1))
    wide = framed(tmp_path, ramp, size="64x4!")
    np.testing.assert_allclose(wide[0, 2:-2], np.clip((np.arange(64) + 0.5) / 4 - 0.5, 0, 15)[2:-2], atol=1e-5)
    spike = np.zeros((9, 9), np.float32)
    spike[4, 4] = 1000
    assert framed(tmp_path, spike, size="100").min() == 0


def test_the_dark_stays_dark_beside_nan(tmp_path: Path) -> None:
    picture = np.ones((8, 8), np.float32)
    picture[0, 0] = np.nan
    made = framed(tmp_path, picture, size="4")
    assert np.isnan(made[0, 0]) and np.isfinite(made).sum() == 15


def test_colour_is_framed_like_luminance(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).uniform(0, 3, (20, 30, 3)).astype(np.float32)
    for options in ({"crop": "9x8+1+2"}, {"size": "7x9"}, {"crop": "10x10", "size": "25"}):
        grey = framed(tmp_path, picture, **options)
        colour = framed(tmp_path, picture, colour="rgb", **options)
        np.testing.assert_allclose(colour @ np.array(BT709_WEIGHTS, np.float32), grey, rtol=1e-5)


class NumberedDepth:
    """Every pixel of every frame at a depth of its own [m]."""

    count = None

    def at(self, index: int, light: np.ndarray) -> np.ndarray:
        return 1 + 1000 * np.float32(index) + np.arange(light.size, dtype=np.float32).reshape(light.shape)


def test_depth_is_that_at_the_centres_of_pixels(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.random.default_rng(0).uniform(0, 3, (3, 20, 30)).astype(np.float32))
    picture = np.arange(20 * 30).reshape(20, 30)
    for options, seen in (
        ({"crop": "12x9+4+5", "size": "4x3"}, picture[5:14, 4:16][1::3, 1::3]),
        ({"crop": "8x7+1+2"}, picture[2:9, 1:9]),
        ({"crop": "30x20"}, picture),
    ):
        source = open_source(
            tmp_path / "a.npy", fps=1, seen_through=lambda whole, _: WithDepth(whole, NumberedDepth(), "a"), **options
        )
        for index, frame in enumerate(source.frames(1), 1):
            np.testing.assert_array_equal(frame.depth, 1 + 1000 * index + seen)


class SlantedDepth:
    """A slanted plane, before which the left part of a wall is twice as near."""

    count = None

    def at(self, index: int, light: np.ndarray) -> np.ndarray:
        y, x = np.indices(light.shape) + 0.5
        return np.where(x < 12, 0.5, 1 / (0.8 - 0.01 * x + 0.005 * y)).astype(np.float32)


@pytest.mark.parametrize("size", ["15x10", "12x8", "90x60", "31x17!", "7x19!"])
def test_depth_of_another_size_is_that_of_its_surfaces(tmp_path: Path, size: str) -> None:
    """A plane's is exact at the centres, also of pixels between those there were; none is a mean of near and far."""
    np.save(tmp_path / "a.npy", np.ones((2, 20, 30), np.float32))
    source = open_source(
        tmp_path / "a.npy", fps=1, seen_through=lambda whole, _: WithDepth(whole, SlantedDepth(), "a"), size=size
    )
    width, height = source.size
    depth = next(iter(source.frames(1))).depth
    x, y = (np.arange(width) + 0.5) * 30 / width, ((np.arange(height) + 0.5) * 20 / height)[:, None]
    inside = ((x > 0.5) & (x < 29.5) & (abs(x - 12) >= 0.5)) & ((y > 0.5) & (y < 19.5))
    plane = np.where(x < 12, 0.5, 1 / (0.8 - 0.01 * x + 0.005 * y))
    np.testing.assert_allclose(depth[inside], plane[inside], rtol=1e-6)
    assert ((depth == 0.5) | (depth > 1)).all()


@pytest.mark.parametrize("maps", [1, 4, 6])
def test_maps_of_depth_that_no_frame_had_are_told(tmp_path: Path, maps: int) -> None:
    np.save(tmp_path / "a.npy", np.ones((4, 3, 5), np.float32))
    np.save(tmp_path / "depth.npy", np.ones((maps, 3, 5), np.float32))
    name = str(tmp_path / "depth.npy")
    depth = parse_depth(name, Intrinsics.of_field((5, 3), 60))
    source = open_source(tmp_path / "a.npy", fps=1, seen_through=lambda whole, _: WithDepth(whole, depth, name))
    assert len(list(islice(source.frames(), 2))) == 2 and not source.warnings
    assert len(list(source.frames(1))) == 3
    assert source.warnings == [f"{name}: 6 depth maps, of which only the first 4 had a frame; are they of other times"
                               " than the frames?"] * (maps == 6)  # fmt: skip


@pytest.mark.parametrize("kind", ["images", "array", "video"])
@pytest.mark.parametrize("options", [{}, {"start": 1.0}, {"start": 1.0, "stop": 2.5}], ids=str)
def test_a_picture_that_is_dropped_for_its_time_takes_its_depth_with_it(
    tmp_path: Path, encode, kind: str, options: dict[str, float]
) -> None:
    pictures = [np.full((16, 16), 40 * k + 20, np.uint8) for k in range(5)]
    times = [0, 1, 1, 2, 3]
    if kind == "video":
        path = encode("a.mkv", pictures, stamps=times, time_base=Fraction(1))
    elif kind == "array":
        path = tmp_path / "a.npy"
        np.save(path, np.stack(pictures) / np.float32(255))
        np.save(tmp_path / "a_timestamps.npy", np.array(times, float))
    else:
        path = tmp_path / "a"
        path.mkdir()
        for k, picture in enumerate(pictures):
            cv2.imwrite(str(path / f"{k}.png"), picture)
        (path / "timestamps.txt").write_text("# s\n" + "".join(f"{t}\n" for t in times))
    source = open_source(path, seen_through=lambda whole, _: WithDepth(whole, AskedDepth(), "a"), **options)
    kept = [k for k in (0, 1, 3, 4) if options.get("start", 0) <= times[k] <= options.get("stop", 9)]
    for first in range(len(kept)):
        assert [float(frame.depth[0, 0]) - 1 for frame in source.frames(first)] == kept[first:]


class AskedDepth:
    """Maps of the frames 2 to 5 of a video, which remember for which of them they were asked."""

    plane_m, count = None, None

    def __init__(self) -> None:
        self.asked: list[int] = []

    def at(self, index: int, light: np.ndarray) -> np.ndarray:
        self.asked.append(index)
        return np.full(light.shape, 1.0 + index, np.float32)


@pytest.mark.parametrize("first", [0, 1])
def test_a_part_asks_for_the_depth_of_its_own_frames_alone(tmp_path: Path, first: int) -> None:
    """Others may have none, and of a model each costs time."""
    np.save(tmp_path / "a.npy", np.ones((9, 3, 5), np.float32))
    depth = AskedDepth()
    part = open_source(
        tmp_path / "a.npy", fps=1, start=2, stop=5, seen_through=lambda whole, _: WithDepth(whole, depth, "a")
    )
    depth.asked.clear()
    seen = list(part.frames(first))
    assert depth.asked == list(range(2 + first, 6))
    assert [float(frame.depth[0, 0]) for frame in seen] == [3.0 + first + k for k in range(4 - first)]
    assert [frame.t_ns for frame in seen] == [(2 + first + k) * 10**9 for k in range(4 - first)]


def test_a_size_may_be_two_numbers(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).uniform(0, 3, (20, 30)).astype(np.float32)
    np.testing.assert_array_equal(framed(tmp_path, picture, size=(7, 9)), framed(tmp_path, picture, size="7x9"))
    for wrong, said in (((7, -9), "7x-9"), ((0, 9), "0x9"), ((7, 9, 3), "7x9x3"), ((7.5, 9), "7.5x9"), ((), "")):
        with pytest.raises(UsageError, match=f"size '{said}"):
            framed(tmp_path, picture, size=wrong)


def test_boxes() -> None:
    assert crop_box("4x6", (10, 10)) == (3, 2, 4, 6)
    assert of_shape(crop_box("100x50+10+20", (200, 100)), (1, 1)) == (35, 20, 50, 50)


def test_everything_at_once(shared_videos: Path) -> None:
    path = shared_videos / "sam2_02_cups.mp4"
    options = dict(start=2.0, stop=2.5, slowdown=4, crop="960x720", size="346x260")
    source = open_source(path, **options)
    frames = list(source.frames())
    plain = list(open_source(path, start=2.0, stop=2.5).frames())
    assert source.size == (346, 260) and len(frames) == len(plain) == 15
    assert abs(frames[0].t_ns - plain[0].t_ns / 4) <= 1
    assert frames[0].light.mean() == pytest.approx(plain[0].light[:, 160:1120].mean(), rel=5e-3)
    assert set(source.describe()["edits"]) == {"start_s", "stop_s", "slowdown", "part", "resized"}


def test_parts_of_a_clip_with_another_rate(encode) -> None:
    """With --fps the clock counts frames, so that all of them before the part have to be seen."""
    path = encode("a.mp4", rising(40), codec="libx264", options={"g": "8"})
    whole = list(open_source(path, fps=100).frames())
    same(open_source(path, fps=100, start=0.155, stop=0.2).frames(), whole[16:21])


@pytest.mark.parametrize("name", ["gopro_karma.mp4", "intel_asl_again.mkv", "nasa_13013.mp4"])
def test_parts_of_real_clips(shared_videos: Path, name: str) -> None:
    whole = list(open_source(shared_videos / name, size="40", stop=2.2).frames())
    since = whole[38].t_ns + 1
    part = list(open_source(shared_videos / name, size="40", start=Fraction(since, 10**9), stop=2.2).frames())
    same(part, whole[39:])


def test_the_largest_part_of_a_shape_is_in_the_middle_along_both_sides() -> None:
    box = Box(*map(Fraction, (3, 5, 100, 100)))
    assert of_shape(box, (2, 1)) == Box(*map(Fraction, (3, 30, 100, 50)))
    assert of_shape(box, (1, 2)) == Box(*map(Fraction, (28, 5, 50, 100)))


def test_a_height_that_is_not_said_is_the_nearest() -> None:
    assert parse_size("346", (1920, 1080)) == parse_size(346, (1920, 1080)) == (346, 195, False)  # 194.6
