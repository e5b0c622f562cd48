"""Clips of films, and what networks are validated with."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from interp.data.dataset_spec import DatasetSpec, scenes_of
from interp.data.making import made
from interp.data.sensor_ranges import SENSORS
from interp.data.settings import HELD_OUT, TRAINED_ON, ClipSettings
from interp.data.shot import AHEAD, SAME
from interp.data.validation import SEED, held_out, validation_clips
from interp.data.video_shots import VideoShot, check_film
from vid2ev import UsageError, open_source
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.recording.exposures import write_codes

REAL = Path(__file__).parents[3] / "shared" / "data" / "videos" / "nasa_13013.mp4"
SCENE = """
[scene]
duration_s = 0.5
ambient = 0.8
[camera]
size = [64, 48]
[[objects]]
name = "wall"
kind = "plane"
size_m = [2, 2, 0]
texture = "brick"
trajectory = { kind = "fixed", position_m = [0, 0, %g] }
"""
FILMS = {"scenes": 0.0, "photographs": 0.0, "videos": 1.0, "size": (32, 24), "sensors": SENSORS["clean"]}


def film(path: Path, count: int = 40, size: str = "64x48") -> str:
    """A film of an edge that moves, at 50 frames a second."""
    text = f"synthetic:moving-edge,size={size},fps=50,duration_s={(count - 1) / 50},speed=40"
    light = np.stack([frame.light for frame in open_source(text).frames()])
    np.savez(path, frames=np.repeat(light[..., None], 3, axis=3).astype(np.float32), fps=50)
    return str(path)


def test_the_truth_is_what_the_film_shows(tmp_path: Path) -> None:
    name = film(tmp_path / "film.npz")
    frames = np.stack([srgb_codes(frame.light) for frame in open_source(name, colour="rgb").frames()])
    for number in range(4):
        clip = made(ClipSettings(**FILMS, video_files=(name,)), 0, number)
        left, top, width, _ = clip.about["part"]
        assert clip.gap_us == 160_000 and clip.about["gain"] == 1.0
        if width == 32:  # (a part that was not made smaller)
            shown = frames[:, top : top + 24, left : left + 32]
            starts = [k for k in range(len(shown) - 8) if np.abs(shown[k : k + 9].astype(int) - clip.truth).max() <= 1]
            assert starts, "the nine frames stand in the film, one after the other; codes of 10 bits may round by one"


def test_a_film_whose_clock_does_not_begin_at_0_is_drawn_from_all_over(tmp_path: Path) -> None:
    early, late = Path(film(tmp_path / "film.npz")), tmp_path / "late" / "film.npz"
    late.parent.mkdir()
    frames = np.load(early)["frames"]
    np.savez(late, frames=frames, timestamps=(7_000_000 + 20_000 * np.arange(len(frames))))
    for number in range(4):
        one, other = (made(ClipSettings(**FILMS, video_files=(str(path),)), 0, number) for path in (early, late))
        np.testing.assert_array_equal(one.truth, other.truth)
        np.testing.assert_array_equal(one.off_on, other.off_on)


def test_a_film_at_no_constant_rate_has_clips_wherever_one_is_drawn(tmp_path: Path) -> None:
    frames = np.load(film(tmp_path / "film.npz", 120))["frames"]
    times_us = np.cumsum([0, *[4_000] * 100, *[90_000] * 19])
    np.savez(tmp_path / "film.npz", frames=frames, timestamps=times_us)
    settings = ClipSettings(**FILMS, video_files=(str(tmp_path / "film.npz"),))
    starts = [made(settings, 0, number).about["start_s"] for number in range(16)]
    assert max(starts) > 0.4


@pytest.mark.parametrize("multiple", [4, 8, 16, 32])
def test_cameras_see_a_film_in_its_order_from_before_the_gap_on(tmp_path: Path, multiple: int) -> None:
    """A film that grows brighter from frame to frame, of which the first key frame is one."""
    light = 0.02 * np.exp(0.05 * np.arange(60))
    np.savez(tmp_path / "film.npz", frames=np.ones((60, 24, 32, 3), np.float32) * light[:, None, None, None], fps=50)
    settings = ClipSettings(**FILMS, multiples=(multiple,), video_files=(str(tmp_path / "film.npz"),))
    for steps in {multiple, 32}:
        for number in range(4):
            shot = VideoShot(settings, 0, number, SAME, multiple)
            seen = [frame.mean() for frame, _ in shot.pictures(steps, -max(steps // AHEAD, 1), steps)]
            assert np.all(np.diff(seen) > 0)
            assert np.abs(light - seen[max(steps // AHEAD, 1)]).min() < 1e-6


def test_a_slower_film_has_a_shorter_gap(tmp_path: Path) -> None:
    settings = ClipSettings(**FILMS, video_files=(film(tmp_path / "film.npz"),), slowdown=4)
    assert made(settings, 0, 0).gap_us == 40_000


def test_pictures_without_times_are_a_film_of_the_rate_that_is_said(tmp_path: Path) -> None:
    frames = np.load(film(tmp_path / "film.npz"))["frames"]
    (tmp_path / "pictures").mkdir()
    for k, light in enumerate(frames):
        write_codes(tmp_path / "pictures" / f"{k}.png", srgb_codes(light))
    said = FILMS | {"video_files": (str(tmp_path / "pictures"),)}
    with pytest.raises(UsageError, match=r"images without times; give --set clips\.fps=RATE, or put a"):
        made(ClipSettings(**said), 0, 0)
    assert [made(ClipSettings(**said, fps=fps), 0, 0).gap_us for fps in (50, 200)] == [160_000, 40_000]
    timed = made(ClipSettings(**(said | {"video_files": (str(tmp_path / "film.npz"),)}), fps=200), 0, 0)
    assert timed.gap_us == 40_000, "of times of its own it is in place of these"


@pytest.mark.parametrize("source", ["film", "picture", "scene"])
def test_what_is_written_again_is_read_again(tmp_path: Path, source: str) -> None:
    """By one process, under its own name: its clips are those of what is there."""
    files = {"film": tmp_path / "film.npz", "picture": tmp_path / "brick.png", "scene": tmp_path / "mine.toml"}
    said = FILMS | {"videos": 0.0, "video_files": (str(files["film"]),), "textures": (str(files["picture"]),)}
    said |= {"scene_names": (str(files["scene"]),)}
    said |= {"film": {"videos": 1.0}, "picture": {"photographs": 1.0}, "scene": {"scenes": 1.0}}[source]

    def write(path: Path, number: int) -> None:
        np.savez(
            path / "film.npz", frames=np.random.default_rng(0).random((20, 24, 32, 3), np.float32), fps=50 * number
        )
        draw = np.random.default_rng(number)
        write_codes(path / "brick.png", draw.integers(0, 256, (64, 64, 3)).astype(np.uint8))
        (path / "mine.toml").write_text(SCENE % (0.3 * number))

    write(tmp_path, 1)
    first = made(ClipSettings(**said), 0, 0)
    (tmp_path / "other").mkdir()
    for path in (tmp_path, tmp_path / "other"):
        write(path, 2)
    again = made(ClipSettings(**said), 0, 0)
    elsewhere = {
        key: tuple(str(tmp_path / "other" / Path(name).name) for name in said[key])
        for key in ("video_files", "textures", "scene_names")
    }
    other = made(ClipSettings(**said | elsewhere), 0, 0)
    np.testing.assert_array_equal(again.truth, other.truth)
    np.testing.assert_array_equal(again.off_on, other.off_on)
    assert again.gap_us == other.gap_us
    assert (again.truth != first.truth).any() or again.gap_us != first.gap_us


@pytest.mark.parametrize(("light", "seen"), [(np.nan, 0.0), (-np.inf, 0.0), (-1.0, 0.0), (np.inf, 65504.0)])
def test_light_that_is_none_is_to_networks_what_it_is_to_sensors(tmp_path: Path, light: float, seen: float) -> None:
    """In one pixel of a film of linear light; the others stay what they are."""
    frames = np.full((20, 24, 32, 3), 0.4, np.float32)
    frames[:, 5, 6] = light
    np.savez(tmp_path / "film.npz", frames=frames, fps=50)
    clip = made(ClipSettings(**FILMS, light="linear", video_files=(str(tmp_path / "film.npz"),)), 0, 0)
    assert (clip.truth[:, 5, 6] == seen).all() and np.isfinite(clip.truth).all()
    assert (clip.truth[:, :5] == np.float16(0.4)).all()


@pytest.mark.parametrize(("count", "size", "said"), [(11, "64x48", "at least 12"), (40, "24x48", "at least 32x24")])
def test_films_that_are_too_short_or_small_are_refused(tmp_path: Path, count: int, size: str, said: str) -> None:
    settings = ClipSettings(**FILMS, video_files=(film(tmp_path / "film.npz", count, size),))
    with pytest.raises(UsageError, match=said):
        made(settings, 0, 0)


def test_a_film_that_does_not_say_how_long_it_is_is_not_called_short(tmp_path: Path) -> None:
    """As a stream without a container: a data set has no parts of it, either."""
    name = str(tmp_path / "film.h264")
    with av.open(name, "w", format="h264") as container:
        stream = container.add_stream("libx264", rate=50)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for k in range(40):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((48, 64, 3), 5 * k, np.uint8))))
        container.mux(stream.encode())
    said = r"film\.h264 does not say how long it is, and .*; bring it into a container that does"
    with pytest.raises(UsageError, match=said):
        check_film(name, ClipSettings(**FILMS, video_files=(name,)), 8)
    with pytest.raises(UsageError, match=said):
        scenes_of(DatasetSpec(videos=(name,), frames=2))


def test_no_shot_ends_among_the_frames_that_event_cameras_watch_before_a_gap(tmp_path: Path) -> None:
    # (else what a slow pixel still sends of the one before is among the events of a gap that shows nothing of it)
    shots = np.random.default_rng(0).uniform(0, 1, (2, 4, 5, 1)).repeat(6, axis=1).repeat(6, axis=2)
    np.savez(tmp_path / "film.npz", frames=shots[[0] * 20 + [1] * 30].repeat(3, axis=3).astype(np.float32), fps=50)
    settings = ClipSettings(**(FILMS | {"size": (30, 24)}), video_files=(str(tmp_path / "film.npz"),))
    drawn = [VideoShot(settings, 0, number, SAME, 8) for number in range(60)]
    firsts = {round(50e-9 * shot._frames[0].t_ns) for shot in drawn}
    assert {min(firsts), 20} <= firsts and min(firsts) < 9
    assert not [first for first in firsts if first < 20 <= first + 10]


@pytest.mark.skipif(not REAL.exists(), reason="no ../shared/data")
def test_a_real_film_is_cut_where_nothing_is_cut(tmp_path: Path) -> None:
    settings = ClipSettings(**(FILMS | {"size": (96, 96)}), video_files=(str(REAL),))
    clips = [made(settings, 0, number) for number in range(4)]
    assert len({clip.about["start_s"] for clip in clips}) == 4
    for clip in clips:
        assert 319_000 < clip.gap_us < 321_000  # (8 frames at 25 a second)
        np.testing.assert_array_equal(clip.keys, clip.truth[[0, -1]])


def test_validation_sees_what_training_does_not(tmp_path: Path) -> None:
    settings = ClipSettings(size=(32, 24), sensors=SENSORS["clean"], scene_names=("spinning-shapes",))
    assert set(held_out(settings).textures) == set(HELD_OUT) and not set(HELD_OUT) & set(TRAINED_ON)
    name = film(tmp_path / "film.npz")
    clips = validation_clips(settings, 3, [name], each=2)
    assert [clip.about["source"] for clip in clips[3:]] == ["video", "video"]
    assert {clip.about["source"] for clip in clips[:3]} <= {"scene", "photographs"}
    again = validation_clips(settings, 3)
    for one, other in zip(clips, again, strict=False):
        np.testing.assert_array_equal(one.truth, other.truth)
        assert one.about == other.about
    assert SEED != 0
    assert made(settings, 0, 0).about != clips[0].about
