"""`convert`: the same recipe makes the same bytes, the files agree with each other, and a failure leaves nothing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import h5py
import hdf5plugin  # noqa: F401  (registers the filters)
import numpy as np
import pytest

from vid2ev import DataError, Events, UsageError, convert, events_of, load_sensor, open_source, read_events
from vid2ev.formats import open_events
from vid2ev.making.conversion import Paused, job_of
from vid2ev.rig.camera import Camera, Rig
from vid2ev.seen import instants
from vid2ev.seen.instants import AHEAD_PX, LEAST_AHEAD, MOST_AHEAD, Instant, frames_ahead
from vid2ev.seen.recipe import Recipe
from vid2ev.stream.ahead import ahead
from vid2ev.tracks.outputs import Outputs

CLIP = "synthetic:moving-edge,size=64x48,fps=100,duration_s=0.3"
NOISY = ["shot_rate_hz=20", "leak_rate_hz=1", "hot_probability=0.01", "hot_rate_hz=200"]
OPTIONS: dict[str, Any] = {"overrides": NOISY, "upsample": "linear", "subframes": 3, "seed": 5, "labels": True}
VIDEOS = Path(__file__).parents[1] / ".." / "shared" / "data" / "videos"


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("convert") / "reference"
    convert(CLIP, directory, threads=1, **OPTIONS)
    return directory


def manifest_of(directory: Path) -> dict[str, Any]:
    return json.loads((directory / "manifest.json").read_text())


@pytest.mark.parametrize(
    "changed",
    [{"threads": 2}, {"threads": 5}, {"piece": 1}, {"piece": 1 << 21}, {"preview": False}, {"report": lambda *_: None}],
    ids=["two threads", "five threads", "smallest pieces", "small pieces", "no preview", "reported"],
)
def test_what_does_not_count_changes_no_bit(reference: Path, tmp_path: Path, changed: dict[str, Any]) -> None:
    convert(CLIP, tmp_path / "out", **({"threads": 1} | OPTIONS | changed))
    assert (tmp_path / "out" / "events.h5").read_bytes() == (reference / "events.h5").read_bytes()
    one, other = manifest_of(reference), manifest_of(tmp_path / "out")
    for manifest in (one, other):
        del manifest["run"], manifest["outputs"]
    assert one == other
    if changed.get("preview", True) and "piece" not in changed:
        assert (tmp_path / "out" / "preview.mp4").read_bytes() == (reference / "preview.mp4").read_bytes()
    assert (tmp_path / "out" / "preview.mp4").exists() == changed.get("preview", True)


@pytest.mark.parametrize("upsample", ["none", "linear", "flow"])
def test_frames_may_be_days_apart(tmp_path: Path, upsample: str) -> None:
    """A time lapse: what a sensor cannot take at a time it is given in parts."""
    texture = np.random.default_rng(0).uniform(0.2, 1, (12, 16)).astype(np.float32)
    np.save(tmp_path / "lapse.npy", np.stack([texture, texture, 0.7 * texture, 1.4 * texture]))
    np.save(tmp_path / "lapse_timestamps.npy", np.array([0.0, 0.04, 86400.0, 86400.04]))
    sensor = ["random_phase=true", "mismatch=0", "crossing_noise=0"]
    made = convert(tmp_path / "lapse.npy", tmp_path / "out", "ideal", sensor, upsample=upsample)
    assert made["duration_us"] == 86_400_040_000 and made["counts"]["frames"] == 4
    assert made["counts"]["on"] > 3 * 12 * 16 and made["counts"]["off"] > 12 * 16
    assert made["counts"]["subframes"] >= 4


def test_films_of_odd_sides_say_which_they_have(tmp_path: Path) -> None:
    clip = "synthetic:moving-edge,size=31x24,duration_s=0.1"
    options: dict[str, Any] = {"frame_camera": True, "upsample": "none"}
    convert(clip, tmp_path / "out", frames="mp4", **options)
    for camera in ("dvs", "cis"):
        assert open_source(tmp_path / "out" / camera / "frames.mp4").size == (32, 24)
        [said] = manifest_of(tmp_path / "out" / camera)["warnings"]
        assert said == "frames.mp4 has 32x24 pixels: films have even sides, so the last column of 31x24 is there twice"
    convert(clip, tmp_path / "none", pictures="png", **options)
    assert not any(manifest_of(tmp_path / "none" / camera)["warnings"] for camera in ("dvs", "cis"))


@pytest.mark.parametrize("fps", [3e6, 1e7, 1e9])
def test_frames_may_be_less_than_a_microsecond_apart(tmp_path: Path, fps: float) -> None:
    np.save(tmp_path / "fast.npy", np.random.default_rng(0).uniform(0.2, 1, (5, 12, 16)).astype(np.float32))
    made = convert(tmp_path / "fast.npy", tmp_path / "out", "ideal", fps=fps, upsample="none")
    assert made["counts"]["frames"] == 5 and made["counts"]["on"] > 0


def test_what_is_counted_goes_on_where_a_conversion_was_paused(tmp_path: Path) -> None:
    """Frames, sub-frames and intervals that asked for more of them, and what the sensor has counted."""
    texture = cv2.GaussianBlur(np.random.default_rng(0).uniform(0, 1, (48, 100)).astype(np.float32), (0, 0), 2)
    np.save(tmp_path / "pan.npy", np.stack([texture[:, 3 * k : 3 * k + 64] for k in range(10)]))
    clip, options = tmp_path / "pan.npy", {"fps": 30, "max_subframes": 2, "piece": 1}
    whole = convert(clip, tmp_path / "whole", **options)
    assert whole["counts"]["limited_intervals"] == whole["counts"]["subframes"] == 9
    assert "9 of 9 intervals asked for more sub-frames than --max-subframes allows" in whole["warnings"]
    asked = iter([False, False, False, True])
    with pytest.raises(Paused):
        convert(clip, tmp_path / "paused", pause=lambda: next(asked), **options)
    paused = convert(clip, tmp_path / "paused", resume=True, **options)
    assert paused["counts"] == whole["counts"] and paused["warnings"] == whole["warnings"]


@pytest.mark.parametrize(
    "changed",
    [{"seed": 6}, {"subframes": 2}, {"upsample": "none", "subframes": "auto"}, {"overrides": NOISY[1:]}],
    ids=str,
)
def test_what_counts_makes_other_events(reference: Path, tmp_path: Path, changed: dict[str, Any]) -> None:
    convert(CLIP, tmp_path / "out", **(OPTIONS | changed))
    assert (tmp_path / "out" / "events.h5").read_bytes() != (reference / "events.h5").read_bytes()


STACK: dict[str, Any] = {"video": "stack.npy", "transfer": "srgb", "fps": 30}
BESIDE = Rig(cameras=(Camera(name="dvs", kind="dvs", translation_mm=(50.0, 0.0, 0.0)),))
OTHER: dict[str, tuple[dict[str, Any], Any]] = {  # of each option what goes with it, and another value
    "video": ({}, "other.npy"), "transfer": ({}, "linear"), "fps": ({}, 31), "slowdown": ({}, 2.0),
    "start": ({}, 0.02), "stop": ({}, 0.05), "crop": ({}, "16x12+1+2"), "size": ({}, "16x12"),
    "motion": ({"video": "photo.png", "fps": None, "size": "8x6", "motion": "pan"}, "saccade"),
    "sensor": ({}, "ideal"), "overrides": ({}, ["threshold_on=0.2"]), "cis": ({"frame_camera": True}, "phone"),
    "frame_camera": ({}, True), "rig": ({"depth": "plane:2", "rig": BESIDE}, BESIDE.with_frames()),
    "depth": ({"depth": "plane:2", "rig": BESIDE}, "plane:3"), "bayer": ({}, "RGGB"),
    "truth": ({}, "poses"), "truth_rate_hz": ({"truth": "poses"}, 20.0),
    "upsample": ({}, "linear"), "subframes": ({}, 2), "max_subframes": ({}, 8), "cuts": ({}, "keep"),
    "seed": ({}, 5), "labels": ({}, True),
    "formats": ({}, "npz"), "preview": ({}, False), "frames": ({}, "npz"),
    "frames_by": ({"frames": "npz"}, "count:50"), "frames_as": ({"frames": "npz"}, "frame:2"),
    "probe": ({}, ["1,2"]), "noise_maps": ({}, True), "pictures": ({"frame_camera": True}, "png"),
}  # fmt: skip


def test_of_every_option_another_is_tried() -> None:
    assert {*OTHER} == {"video", "sensor", "overrides", *Recipe.options(), *Outputs.options()}


@pytest.mark.parametrize("name", OTHER)
def test_with_another_value_of_any_option_it_is_another_recording(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its manifest, which `resume` goes by: what stands not in it would go on with other options."""
    monkeypatch.chdir(tmp_path)
    codes = np.random.default_rng(0).integers(0, 255, (4, 24, 32), dtype=np.uint8)
    np.save("stack.npy", codes)
    np.save("other.npy", codes[:, ::-1])
    cv2.imwrite("photo.png", codes[0])

    def job(options: dict[str, Any]) -> dict[str, Any]:
        outputs = Outputs.of(**Outputs.taken_from(options))
        return job_of(Recipe.of(**options), outputs, None, {})

    beside, value = OTHER[name]
    assert job(STACK | beside) == job(STACK | beside) != job(STACK | beside | {name: value})


@pytest.mark.parametrize(("name", "meant"), [("framesout", "frames"), ("subframe", "subframes"), ("previw", "preview")])
def test_an_option_that_is_misspelt_is_named_before_anything_is_opened(tmp_path: Path, name: str, meant: str) -> None:
    with pytest.raises(UsageError, match=rf"option '{name}' \(did you mean {meant}\?\): expected one of "):
        convert("there is no such video", tmp_path / "out", **{name: 1})
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    "asked",
    [
        {"bayer": ""}, {"bayer": 3}, {"bayer": False}, {"labels": "no"}, {"labels": None}, {"cis": ""}, {"crop": ""},
        {"subframes": 1.5}, {"subframes": "x"}, {"subframes": True}, {"max_subframes": 2.5}, {"max_subframes": "9"},
        {"probe": [(1.5, 2)]}, {"probe": [(1, 2, 3)]}, {"threads": 0}, {"threads": 1.5}, {"piece": 0}, {"piece": 1e9},
        {"tolerance": np.nan},
    ],
    ids=str,
)  # fmt: skip
def test_values_that_cannot_be_meant_are_refused_before_the_first_frame(
    tmp_path: Path, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vid2ev.sources.synthetic.SyntheticClip.frames", None)
    (name,) = asked
    with pytest.raises(UsageError, match=rf"^({name} |Sensor '' is not a preset)"):
        convert(CLIP, tmp_path / "out", **asked)
    assert not any(tmp_path.iterdir())


def test_an_option_of_outputs_is_none_of_events(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="option 'preview': expected one of bayer, "):
        next(events_of(CLIP, preview=False))


def test_events_of_gives_what_convert_writes(reference: Path) -> None:
    options = OPTIONS | {"threads": 2}
    one = Events.concatenate(events_of(CLIP, **options))
    other = Events.concatenate(read_events(reference))
    assert len(one) > 1000
    for name in ("t", "x", "y", "p", "label"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_specification_serves_as_a_sensor(reference: Path, tmp_path: Path) -> None:
    options = OPTIONS | {"overrides": (), "sensor": load_sensor("paper", NOISY)}
    convert(CLIP, tmp_path / "out", **options)
    assert (tmp_path / "out" / "events.h5").read_bytes() == (reference / "events.h5").read_bytes()
    with pytest.raises(UsageError, match="preset or file"):
        convert(CLIP, tmp_path / "other", **(options | {"overrides": NOISY}))


def test_the_manifest_says_what_is_in_the_files(reference: Path) -> None:
    manifest = manifest_of(reference)
    events = Events.concatenate(read_events(reference))
    counts = manifest["counts"]
    assert counts["events"] == len(events) == counts["on"] + counts["off"]
    assert counts["on"] == int(events.p.sum())
    assert (counts["frames"], counts["subframes"]) == (31, 60)
    assert (manifest["start_us"], manifest["duration_us"]) == (0, 300_000)
    assert manifest["sensor"]["size"] == [64, 48] and manifest["seed"] == 5
    assert load_sensor("paper", NOISY).model_dump(mode="json") == manifest["sensor"]["parameters"]
    assert manifest["sensor"]["effects"] == load_sensor("paper", NOISY).effects()
    assert {"vid2ev", "python", "numpy", "numba", "av"} <= set(manifest["versions"])
    assert manifest["run"]["seconds"] > 0 and manifest["run"]["threads"] == 1
    with h5py.File(reference / "events.h5") as file:
        assert (file.attrs["width"], file.attrs["height"]) == (64, 48)
        assert len(file["ms_to_idx"]) == 302
        np.testing.assert_array_equal(file["ms_to_idx"], np.searchsorted(events.t, np.arange(302) * 1000))
    with av.open(str(reference / "preview.mp4")) as film:
        assert sum(1 for _ in film.decode(video=0)) == 10


def test_a_recording_counts_from_its_first_frame(tmp_path: Path) -> None:
    light = np.repeat(np.geomspace(0.1, 0.8, 12, dtype=np.float32), 16).reshape(12, 4, 4)
    np.save(tmp_path / "late.npy", light)
    start_us = 3 * 3600 * 10**6 + 7
    np.save(tmp_path / "late_timestamps.npy", (start_us + 10_000 * np.arange(12)) * 1000)
    manifest = convert(tmp_path / "late.npy", tmp_path / "out", "ideal", upsample="none")
    assert (manifest["start_us"], manifest["duration_us"]) == (start_us, 110_000)
    with h5py.File(tmp_path / "out" / "events.h5") as file:
        assert file["t_offset"][()] == start_us and file["events/t"].dtype == "u4"
        assert file["events/t"][0] > 0 and file["events/t"][-1] <= 110_000
    (events,) = read_events(tmp_path / "out")
    assert start_us < events.t[0] and events.t[-1] <= start_us + 110_000


@pytest.mark.parametrize("fps", [1000, 30])
def test_before_time_0_cameras_that_send_nothing_have_the_length_of_the_light(tmp_path: Path, fps: int) -> None:
    """An event camera in the dark, and a frame camera for less light than it takes an exposure; then it sends some."""
    rig = tmp_path / "rig.toml"
    cameras = (f'[[camera]]\nname = "{kind}"\nkind = "{kind}"\nclock_offset_us = -5000000\n' for kind in ("dvs", "cis"))
    rig.write_text("".join(cameras))
    clip = f"synthetic:black,size=16x12,fps={fps},duration_s={3 / fps}"
    manifest = convert(clip, tmp_path / "out", "ideal", rig=rig, cis="ideal", upsample="none", threads=1)
    for result in manifest["results"].values():
        assert (result["start_us"], result["duration_us"]) == (-5_000_000, 3_000_000 // fps)


def test_files_of_events_have_the_frames_of_the_recording_and_no_others(tmp_path: Path) -> None:
    """The source goes on where a recording is ended by hand, and begins before one with a warm-up."""
    options = {"formats": "aedat4", "preview": False, "upsample": "none", "threads": 1}
    convert(CLIP, tmp_path / "out", since_ns=50_000_000, report=lambda _, done: done.frames == 4, **options)
    times_us = [picture.t_us for picture in open_events(tmp_path / "out").frames()]
    assert times_us == [50_000, 60_000, 70_000, 80_000]


def test_truth_has_no_files_of_instants_that_a_recording_never_came_back_to(tmp_path: Path) -> None:
    """It is broken off after a checkpoint, taken up from there, and ended by hand before it is as far again."""
    options = {"depth": "plane:2", "truth": "depth,mask", "preview": False, "upsample": "none", "threads": 1}

    def breaks_off(_: object, done: Any) -> None:
        if done.frames == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convert(CLIP, tmp_path / "out", report=breaks_off, piece=10 << 18, **options)
    convert(CLIP, tmp_path / "out", resume=True, report=lambda _, done: done.frames == 13, **options)
    truth = tmp_path / "out" / "truth"
    count = len((truth / "timestamps.txt").read_text().splitlines())
    for kind in ("depth", "mask"):
        numbers = sorted(int(path.stem) for path in (truth / kind).iterdir())
        assert numbers == list(range(count)) and count > 0


def test_event_frames_later_than_the_last_frame_are_kept(tmp_path: Path) -> None:
    clip, overrides = CLIP.replace("64x48", "96x8"), ["frame_rate_hz=6"]  # 167 and 333 ms; light ends at 300
    manifest = convert(clip, tmp_path / "out", "ideal", overrides, upsample="none")
    events = Events.concatenate(read_events(tmp_path / "out"))
    assert set(events.t) == {0, 166_667, 333_333} and len(events) == manifest["counts"]["events"]
    assert manifest["duration_us"] == 333_333
    convert(clip, tmp_path / "pieces", "ideal", overrides, upsample="none", piece=1)
    assert (tmp_path / "out" / "events.h5").read_bytes() == (tmp_path / "pieces" / "events.h5").read_bytes()


@pytest.mark.parametrize("labels", [False, True])
def test_one_frame_makes_a_recording_without_events(tmp_path: Path, labels: bool) -> None:
    np.save(tmp_path / "still.npy", np.full((1, 3, 5), 0.5, np.float32))
    manifest = convert(tmp_path / "still.npy", tmp_path / "out", fps=30, labels=labels)
    assert manifest["counts"]["events"] == 0 and manifest["duration_us"] == 0
    assert any("one frame" in warning for warning in manifest["warnings"])
    assert len(Events.concatenate(read_events(tmp_path / "out"))) == 0
    with h5py.File(tmp_path / "out" / "events.h5") as file:
        assert file["ms_to_idx"][:].tolist() == [0, 0] and ("label" in file["events"]) == labels


def test_that_one_frame_has_no_events_is_not_said_of_a_frame_camera(tmp_path: Path) -> None:
    np.save(tmp_path / "still.npy", np.full((1, 3, 5), 0.5, np.float32))
    convert(tmp_path / "still.npy", tmp_path / "out", "ideal", fps=30, cis="ideal", pictures="png")
    assert [len(manifest_of(tmp_path / "out" / camera)["warnings"]) for camera in ("dvs", "cis")] == [1, 0]


def test_the_manifest_says_what_is_left_of_a_mismatch_that_is_clipped(tmp_path: Path) -> None:
    np.save(tmp_path / "still.npy", np.full((1, 3, 5), 0.5, np.float32))
    manifest = convert(tmp_path / "still.npy", tmp_path / "out", "paper", ["mismatch=0.15"], fps=30)
    assert any("mismatch = 0.15 nat" in text and "0.101 nat (ON)" in text for text in manifest["warnings"])


def test_a_random_seed_is_drawn_and_kept(tmp_path: Path) -> None:
    one = convert(CLIP, tmp_path / "one", seed=None, upsample="none")
    other = convert(CLIP, tmp_path / "other", seed=None, upsample="none")
    assert one["seed"] != other["seed"]
    again = convert(CLIP, tmp_path / "again", seed=one["seed"], upsample="none")
    assert (tmp_path / "again" / "events.h5").read_bytes() == (tmp_path / "one" / "events.h5").read_bytes()
    assert convert(CLIP, tmp_path / "one", seed=None, upsample="none", resume=True) == one
    assert {key: again[key] for key in again if key != "run"} == {key: one[key] for key in one if key != "run"}


def test_a_source_that_fails_half_way_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    of_recipe = instants._instants

    def failing(*asked: Any) -> Iterator[Instant]:
        for k, item in enumerate(of_recipe(*asked)):
            if k == 8:
                raise DataError("picture 8 is broken; mend it")
            yield item

    monkeypatch.setattr(instants, "_instants", failing)
    with pytest.raises(DataError, match="picture 8"):
        convert(CLIP, tmp_path / "out", upsample="none")
    assert list(tmp_path.iterdir()) == []


def test_items_made_ahead_come_in_order_and_errors_in_their_place() -> None:
    closed = []

    def counting() -> Iterator[int]:
        try:
            yield from range(10)
            raise ZeroDivisionError
        finally:
            closed.append(True)

    got = []
    with pytest.raises(ZeroDivisionError):
        for item in ahead(counting(), 3):
            got.append(item)
    assert got == list(range(10)) and closed == [True]
    early = ahead(counting(), 3)
    assert next(early) == 0
    early.close()
    assert closed == [True, True]


def test_real_video_makes_the_same_bytes_in_pieces(tmp_path: Path) -> None:
    video = VIDEOS / "intel_asl_again.mkv"
    if not video.exists():
        pytest.skip("../shared/data is not here")
    manifest = convert(video, tmp_path / "one", upsample="none", threads=1)
    convert(video, tmp_path / "other", upsample="none", threads=2, piece=1 << 22)
    assert (tmp_path / "one" / "events.h5").read_bytes() == (tmp_path / "other" / "events.h5").read_bytes()
    assert manifest["counts"]["events"] > 100_000
    films = []
    for directory in ("one", "other"):
        with av.open(str(tmp_path / directory / "preview.mp4")) as film:
            films.append([packet.pts for packet in film.demux(video=0)])
    assert films[0] == films[1]


@pytest.mark.parametrize("size", [(1, 1), (346, 260), (1280, 720), (3840, 2160), (8192, 8192)])
def test_frames_made_in_advance_are_a_few_and_bounded_in_size(size: tuple[int, int]) -> None:
    depth, pixels = frames_ahead(size), size[0] * size[1]
    assert LEAST_AHEAD <= depth <= MOST_AHEAD and (depth == LEAST_AHEAD or depth * pixels <= AHEAD_PX)
