"""What is scored, and what is not: recordings with the quirks of the releases, films, and pictures of others."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from footage_made import STEP_US, pictures, write_film, write_hsergb, write_predictions

import vid2ev
from interp.data.dataset import write_dataset
from interp.data.dataset_spec import DatasetSpec
from interp.data.layouts import open_sequence, sequences_in
from interp.data.layouts.ergb import LAYOUTS
from interp.data.layouts.own import Own
from interp.evaluate.films import Film
from interp.evaluate.pairing import paired
from interp.evaluate.predictions import predictions_in
from interp.evaluate.protocol import Protocol
from interp.evaluate.rebuilders import methods_of
from interp.evaluate.recordings import Recording
from interp.evaluate.remarks import left_out, notes
from interp.evaluate.run import evaluate
from interp.evaluate.sets import footage_of
from interp.evaluate.simulated import Simulated
from interp.representation.dead_time import DeadTime
from interp.representation.event_counts import count_events
from vid2ev import DataError, Events, UsageError, convert, events_of, open_source
from vid2ev.light.eight_bits import srgb_codes
from vid2ev.recording.exposures import write_codes
from vid2ev.recording.manifest import read_manifest
from vid2ev.rig.camera import Camera, Rig
from vid2ev.scenes.source import SceneSource
from vid2ev.sources import Source


def test_groups_of_a_recording_are_its_frames_and_events(tmp_path: Path) -> None:
    frames = pictures(10)
    write_hsergb(tmp_path / "seq", frames)
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq")
    groups = list(recording.groups())
    assert [(group.number, group.first, group.gap_us) for group in groups] == [(0, 0, 4 * STEP_US), (1, 4, 4 * STEP_US)]
    np.testing.assert_array_equal(groups[1].keys, frames[[4, 8]])
    np.testing.assert_array_equal(groups[1].truth, frames[5:8])
    assert int(groups[1].events.off_on.sum()) == 4 * 50 and groups[1].events.steps == 32
    assert not (groups[1].events.contrast == 0.15).all()  # nobody knows it: it is fitted
    about = recording.about()
    assert about["groups"] == 2 and about["not_scored"] == {}
    assert about["remarks"] == ["not rebuilt: 1 frame after the last complete group of 4"]


def test_what_cannot_be_scored_is_named_and_counted(tmp_path: Path) -> None:
    times = [STEP_US * (k + 1) for k in range(25)]
    times[5] = times[4]
    write_hsergb(tmp_path / "data" / "seq", pictures(25), times, last_events=6)
    (tmp_path / "data" / "torn" / "images").mkdir(parents=True)
    (tmp_path / "data" / "torn" / "events").mkdir()
    picture = sorted((tmp_path / "data" / "seq" / "images_corrected").glob("*.png"))[10]
    picture.write_bytes(b"torn")
    found = evaluate([str(tmp_path / "data")], tmp_path / "report", baselines=["linear"], protocol=Protocol(3, 3))
    about = found.summary["sequences"]["seq"]
    reasons = {
        "times of the frames do not increase": 1, "the events end before the last frame": 2,
        f"{picture} is no picture that can be read; leave it out with its time": 1,
    }  # fmt: skip
    assert about["not_scored"] == reasons and about["groups"] == 2
    assert {row.group for row in found.rows} == {0, 3}
    assert "no timestamp.txt" in found.summary["unusable"][str(tmp_path / "data" / "torn")]


def test_sequences_without_a_rate_and_pictures_of_another_size_do_not_end_the_rest(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "data" / "seq", pictures(5))
    write_hsergb(tmp_path / "data" / "one", pictures(1))
    write_hsergb(tmp_path / "data" / "still", pictures(5), [STEP_US] * 5)
    write_hsergb(tmp_path / "data" / "two", pictures(9))
    picture = tmp_path / "data" / "two" / "images_corrected" / "000006.png"
    write_codes(picture, pictures(1)[0, :12, :16])
    found = evaluate([str(tmp_path / "data")], tmp_path / "report", baselines=["linear"], protocol=Protocol(3, 3))
    of = found.summary["sequences"]
    assert {name: about["groups"] for name, about in of.items()} == {"one": 0, "seq": 1, "still": 0, "two": 1}
    assert of["still"]["not_scored"] == {"times of the frames do not increase": 1}
    assert left_out(found.summary)["gaps: times of the frames do not increase, in still"] == 1
    assert "not scored: 1 gap: times of the frames do not increase, in still" in notes(found.summary)
    assert [(*of["two"]["not_scored"],)[0].split(";")[0]] == [
        f"{picture}: 16x12 pixels, expected 40x24 as the first picture has"
    ]
    assert "a single frame" in of["one"]["remarks"][-1]
    assert (of["one"]["rate_hz"], of["still"]["rate_hz"], of["seq"]["rate_hz"]) == (0.0, 0.0, 250.0)


def test_a_limit_says_what_it_leaves_out(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "seq", pictures(17))
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq", limit=1)
    assert [group.number for group in recording.groups()] == [0]
    assert recording.about()["not_scored"] == {"beyond the limit of 1": 3}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of vid2ev whose frames have an exposure."""
    folder = tmp_path_factory.mktemp("own")
    frames = [frame.light for frame in open_source("synthetic:moving-edge,size=32x24,fps=30,duration_s=1.2").frames()]
    np.savez(folder / "film.npz", frames=np.stack(frames).astype(np.float32), fps=30)
    spec = DatasetSpec(videos=(str(folder / "film.npz"),), slowdown=4, frames=3, count=1, preset="paper")
    write_dataset(folder / "set", spec)
    return next(path for path in (folder / "set").iterdir() if path.is_dir())


def test_key_frames_of_an_own_recording_are_those_of_its_frame_camera(own: Path) -> None:
    recording, sequence = Recording(open_sequence(own), Protocol(31, 31), "own"), Own(own)
    groups = list(recording.groups())
    begin = sequence.key_frames[0]
    assert begin > 0 and [group.first for group in groups] == [begin, begin + 32]
    np.testing.assert_array_equal(groups[0].keys[0], sequence.key(begin))
    np.testing.assert_array_equal(groups[0].truth[0], sequence.frame(begin + 1))
    assert groups[0].cameras.disparity_px == groups[0].cameras.offset_us == 0
    assert groups[0].cameras.exposure_us == pytest.approx(4e6 / 960, abs=2)
    assert groups[0].events.contrast.flatten().tolist() == pytest.approx(sequence.contrast)
    assert f"not rebuilt: {begin} frame{'s' * (begin > 1)} before the first key frame" in recording.about()["remarks"]


@pytest.mark.parametrize("damage", ["cut short", "missing"])
def test_an_own_recording_whose_events_are_torn_is_named_before_any_are_asked_for(
    own: Path, tmp_path: Path, damage: str
) -> None:
    for name in ("torn", "whole"):
        shutil.copytree(own, tmp_path / name)
    file = tmp_path / "torn" / "dvs" / "events.h5"
    if damage == "missing":
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    found, unusable = sequences_in(tmp_path)
    assert [folder.name for folder in found] == ["whole"]
    assert (
        list(unusable) == [str(tmp_path / "torn")]
        and str(tmp_path / "torn" / "dvs") in unusable[str(tmp_path / "torn")]
    )


@pytest.mark.parametrize("line_us", [0.0, 20.0])
def test_where_cameras_stand_and_how_late_their_clocks_are_is_known(tmp_path: Path, line_us: float) -> None:
    """And for how long a row is exposed, however much later the last one opens than the first."""
    write_film(tmp_path / "film.npz", pictures(14))
    shutter = {"frame_rate_hz": 250.0, "exposure_us": 400.0, "line_us": line_us}
    here = Camera(name="cis", kind="cis", sensor="paper", set=shutter)
    there = Camera(name="dvs", kind="dvs", translation_mm=(12.0, 5.0, 0.0), clock_offset_us=500)
    rig = Rig(cameras=(there, here))
    convert(tmp_path / "film.npz", tmp_path / "own", rig=rig, depth="plane:2", pictures="png", preview=False)
    focal_px = read_manifest(tmp_path / "own")["rig"]["cameras"][1]["intrinsics"]["focal_px"][0]
    for group in Recording(open_sequence(tmp_path / "own"), Protocol(3, 3), "own").groups():
        assert group.cameras == (400.0, pytest.approx(focal_px * 0.013 / 2), 500.0)


def test_a_lens_without_a_size_is_one_sentence(tmp_path: Path) -> None:
    write_film(tmp_path / "film.npz", pictures(12))
    here = Camera(name="cis", kind="cis", sensor="paper", set={"frame_rate_hz": 250.0, "exposure_us": 400.0})
    rig = Rig(cameras=(Camera(name="dvs", kind="dvs"), here))
    convert(tmp_path / "film.npz", tmp_path / "own", rig=rig, pictures="png", preview=False)
    said = read_manifest(tmp_path / "own")
    said["rig"]["cameras"][1]["intrinsics"]["size"][0] = 0
    (tmp_path / "own" / "manifest.json").write_text(json.dumps(said))
    with pytest.raises(DataError, match="does not say what it should"):
        open_sequence(tmp_path / "own")


@pytest.mark.parametrize("blur", [True, False])
def test_key_frames_of_an_instant_were_not_exposed(tmp_path: Path, blur: bool) -> None:
    write_film(tmp_path / "film.npz", pictures(12))
    shutter = {"frame_rate_hz": 250.0, "exposure_us": 400.0, "blur": blur}
    cameras = Camera(name="dvs", kind="dvs"), Camera(name="cis", kind="cis", sensor="paper", set=shutter)
    convert(tmp_path / "film.npz", tmp_path / "own", rig=Rig(cameras=cameras), pictures="png", preview=False)
    own = open_sequence(tmp_path / "own")
    assert isinstance(own, Own) and own.exposure_us(0) == (400 if blur else 0)


@pytest.mark.parametrize("late_us", [0, 400_000])
def test_disparity_in_a_scene_is_that_of_its_depth(tmp_path: Path, late_us: int) -> None:
    """When the frames were taken, whatever the clock of the cameras says."""
    camera = Camera(name="dvs", kind="dvs", translation_mm=(15.0, 0.0, 0.0), clock_offset_us=late_us)
    shutter = {"frame_rate_hz": 200.0, "exposure_us": 0.0}
    still = Camera(name="cis", kind="cis", sensor="paper", set=shutter, clock_offset_us=late_us)
    scene = "scene:close-object,size=32x24"
    convert(scene, tmp_path / "own", rig=Rig(cameras=(camera, still)), stop=0.03, pictures="png", preview=False)
    source = open_source(scene)
    assert isinstance(source, SceneSource)
    (group,) = Recording(open_sequence(tmp_path / "own"), Protocol(3, 3), "own", limit=1).groups()
    depth_m = source.world.render(500 * int((group.times_us[[0, -1]] - late_us).sum())).depth
    expected_px = float((source.world.intrinsics.focal_px[0] * 0.015 / depth_m).mean())
    assert expected_px > 0.1 and group.cameras.disparity_px == pytest.approx(expected_px, rel=0.1)


def test_key_frames_of_the_truth_have_its_exposure(own: Path) -> None:
    """Of every 32nd frame the camera's own, of the rest the instants of the truth."""
    groups = list(Recording(open_sequence(own), Protocol(7, 7), "own").groups())
    exposed = [group.cameras.exposure_us for group in groups[:4]]
    assert exposed == pytest.approx([4e6 / 960 / 2, 0, 0, 4e6 / 960 / 2], abs=2)


def test_other_key_frames_than_the_frame_camera_has_are_named(own: Path) -> None:
    remarks = Recording(open_sequence(own), Protocol(15, 15), "own").about()["remarks"]
    assert any("2 of 8 key frames" not in each and "--skip 31 takes its own" in each for each in remarks)


def test_a_film_is_seen_by_the_event_camera_of_convert(tmp_path: Path) -> None:
    frames = pictures(10)
    write_film(tmp_path / "film.npz", frames)
    simulated = Simulated.of("clean", ["threshold_on=0.2"])
    film = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", simulated)
    groups = list(film.groups())
    events = Events.concatenate(list(events_of(tmp_path / "film.npz", simulated.spec)))
    assert len(events) > 100 and len(groups) == 2
    for group in groups:
        start_us, stop_us = int(group.times_us[0]), int(group.times_us[-1])
        counts = count_events(events, film.size, start_us, stop_us, 32, dead_time=DeadTime(100.0, "quantised"))
        np.testing.assert_array_equal(group.events.off_on, counts.off_on)
        assert group.events.contrast.flatten().tolist() == pytest.approx([0.15, 0.2])
    codes = [each.shape for each in groups[1].truth]
    assert codes == [frames[0].shape] * 3
    assert film.about()["remarks"] == ["not rebuilt: 1 frame after the last complete group of 4"]


@pytest.mark.parametrize("first", ["cis", "dvs"])
def test_a_scene_is_seen_from_where_its_frames_are_whatever_rig_it_comes_with(tmp_path: Path, first: str) -> None:
    predefined = Path(vid2ev.__file__).parent / "scenes" / "predefined" / "close-object.toml"
    text, named = predefined.read_text(), 'rig = "rigs/close-object.toml"'
    assert named in text
    away = f'[[camera]]\nname = "{first}"\nkind = "{first}"\nsize = [20, 10]\ntranslation_mm = [300, 0, 0]\n'
    (tmp_path / "rig.toml").write_text(away)
    (tmp_path / "with.toml").write_text(text.replace(named, 'rig = "rig.toml"'))
    (tmp_path / "without.toml").write_text(text.replace(named, ""))
    simulated = Simulated.of("clean", size="32x24", stop=0.03)
    films = (Film(f"scene:{tmp_path / name}.toml", Protocol(3, 3), name, simulated, 1) for name in ("with", "without"))
    (seen,), (expected,) = (list(film.groups()) for film in films)
    assert expected.events.off_on.sum() > 20
    np.testing.assert_array_equal(seen.events.off_on, expected.events.off_on)


def test_a_scene_that_was_edited_is_another(tmp_path: Path) -> None:
    predefined = Path(vid2ev.__file__).parent / "scenes" / "predefined" / "spinning-shapes.toml"
    text, place = predefined.read_text(), "[-1.1, -0.75, 2.0]"
    assert place in text
    (tmp_path / "mine.toml").write_text(text)
    known = []
    for seed in (0, 0, 1):
        scene, simulated = f"scene:{tmp_path / 'mine.toml'},seed={seed}", Simulated.of("clean", size="32x24")
        known.append(Film(scene, Protocol(3, 3), "mine", simulated, 1).identity["sha256"])
    (tmp_path / "mine.toml").write_text(text.replace(place, "[-1.1, -0.75, 2.1]"))
    scene = f"scene:{tmp_path / 'mine.toml'},seed=0"
    known.append(Film(scene, Protocol(3, 3), "mine", Simulated.of("clean", size="32x24"), 1).identity["sha256"])
    assert known[0] == known[1] and len(set(known)) == 3


@pytest.mark.parametrize("prefix", ["", "scene:"])
def test_a_scene_with_another_photograph_of_the_same_name_is_another(tmp_path: Path, prefix: str) -> None:
    predefined = Path(vid2ev.__file__).parent / "scenes" / "predefined" / "low-light.toml"
    assert 'texture = "gravel"' in predefined.read_text()
    scene = tmp_path / "mine.toml"
    scene.write_text(predefined.read_text().replace('texture = "gravel"', 'texture = "mine.png"'))
    known = []
    for seed in (0, 0, 1):
        write_codes(tmp_path / "mine.png", pictures(1, seed)[0])
        os.utime(tmp_path / "mine.png", (0, 0))
        film = Film(f"{prefix}{scene}", Protocol(3, 3), "mine", Simulated.of("clean", size="32x24"), 1)
        known.append(film.identity)
    assert known[0] == known[1] != known[2]


def test_a_film_whose_times_lie_beside_it_is_another_with_others(tmp_path: Path) -> None:
    np.save(tmp_path / "stack.npy", pictures(5))
    known = []
    for rate in (240, 240, 100):
        np.save(tmp_path / "stack_timestamps.npy", np.arange(5) / rate)
        film = Film(str(tmp_path / "stack.npy"), Protocol(3, 3), "stack", Simulated.of("clean", transfer="srgb"))
        known.append(film.identity)
    assert known[0] == known[1] != known[2]


def test_films_are_gone_through_a_group_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_film(tmp_path / "film.npz", pictures(40))
    film = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", Simulated.of("clean"))
    read: list[int] = []
    seen = Simulated.seen

    def counted(*asked: Any) -> Any:
        for each in seen(*asked):
            read.append(1)
            yield each

    monkeypatch.setattr(Simulated, "seen", counted)
    groups = film.groups()
    for number in range(3):
        next(groups)
        assert len(read) == 4 * (number + 1) + 1
    groups.close()


def test_slow_films_and_cuts_are_named(tmp_path: Path) -> None:
    draw = np.random.default_rng(0)
    one, other = (
        np.kron(draw.integers(0, 256, (8, 12, 3)), np.ones((8, 8, 1), int)).astype(np.uint8) for _ in range(2)
    )
    write_film(tmp_path / "film.npz", np.stack([one] * 6 + [other] * 7), fps=30)
    film = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", Simulated.of("clean"))
    assert [group.number for group in film.groups()] == [0, 2]
    about = film.about()
    assert about["not_scored"] == {"a cut between the key frames": 1}
    assert "30 frames a second" in about["remarks"][0] and "--slowdown" in about["remarks"][0]
    fast = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", Simulated.of("clean", slowdown=8))
    assert len(list(fast.groups())) == 2
    assert fast.about()["rate_hz"] == pytest.approx(240) and fast.about()["remarks"] == []


def test_rates_that_are_fractions_are_said_as_such() -> None:
    simulated = Simulated.of("clean", fps=Fraction(240000, 1001))
    assert json.loads(json.dumps(simulated.describe()))["fps"] == "240000/1001"


def test_a_scene_is_rendered_denser_than_its_truth() -> None:
    film = Film("scene:flicker,size=32x24,scene.duration_s=0.05", Protocol(3, 3), "scene", Simulated.of("clean"), 1)
    (group,) = film.groups()
    assert np.diff(group.times_us).tolist() == pytest.approx([1e6 / 240] * 4, abs=1.1)
    assert film.about()["rate_hz"] == pytest.approx(240, rel=0.1)


@pytest.mark.parametrize("with_keys", [True, False])
def test_predictions_are_paired_by_position(tmp_path: Path, with_keys: bool) -> None:
    truth = pictures(13)
    write_hsergb(tmp_path / "seq", truth)
    kept = [k for k in range(13) if with_keys or k % 4]
    for method in ("GT", "ours", "theirs"):
        write_predictions(tmp_path / "results" / "seq" / method, truth[kept])
    found = predictions_in(tmp_path / "results")
    assert [each.name for each in found] == ["ours", "theirs"]
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq")
    for group in recording.groups():
        np.testing.assert_array_equal(np.stack(found[0].begin(recording).frames(group)), group.truth)


@pytest.mark.parametrize(("first", "rebuilt"), [(0, False), (1, True), (0, True)])
def test_predictions_of_a_film_are_paired_by_the_frames_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: int, rebuilt: bool
) -> None:
    """Whatever its header says, and however far it was gone through before."""
    truth = pictures(14)
    write_film(tmp_path / "film.npz", truth)
    opened = Simulated.opened

    def estimated(self: Simulated, video: str) -> Source:
        source = opened(self, video)
        source.frames_expected = 16  # type: ignore[misc]
        return source

    monkeypatch.setattr(Simulated, "opened", estimated)
    kept = [k for k in range(13) if k % 4] if rebuilt else range(14)
    folder = tmp_path / "results" / "film"
    folder.mkdir(parents=True)
    for number, k in enumerate(kept, first):
        write_codes(folder / f"{number:03d}.png", srgb_codes(truth[k] / 255))
    film = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", Simulated.of("clean"), limit=2)
    (ours,) = predictions_in(tmp_path / "results")
    for _ in range(2):
        running, groups = ours.begin(film), 0
        for group in film.groups():
            np.testing.assert_array_equal(np.stack(running.frames(group)), group.truth)
            groups += 1
        assert groups == 2 and not running.unfit


@pytest.mark.parametrize(("limit", "said"), [(2, True), (3, False), (4, False)])
def test_a_film_is_said_to_be_limited_where_it_has_more(tmp_path: Path, limit: int, said: bool) -> None:
    write_film(tmp_path / "film.npz", pictures(13))
    film = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", Simulated.of("clean"), limit)
    assert len(list(film.groups())) == min(limit, 3)
    assert any("limited" in each for each in film.about()["remarks"]) == said


def test_what_a_method_remembers_is_of_the_shot_that_it_is_asked_about(tmp_path: Path) -> None:
    draw = np.random.default_rng(0)
    one, other = (np.kron(draw.integers(0, 256, (8, 12, 3)), np.ones((8, 8, 1), int)) for _ in range(2))
    shots = [np.stack([np.roll(each, k, 1) for k in range(9)]).astype(np.uint8) for each in (one, other)]
    write_film(tmp_path / "film.npz", np.concatenate(shots))
    film = Film(str(tmp_path / "film.npz"), Protocol(3, 3), "film", Simulated.of("clean"))
    (method,) = methods_of([], ["firenet-paper"], Protocol(3, 3))
    groups = list(film.groups())
    assert [group.number for group in groups] == [0, 1, 3]
    running, alone, remembering = (method.begin(film) for _ in range(3))
    made = [running.frames(group) for group in groups]
    np.testing.assert_array_equal(made[2], alone.frames(groups[2]))
    remembering.frames(groups[0])
    assert not np.array_equal(made[2], remembering.frames(replace(groups[2], number=1)))


def test_videos_in_a_folder_of_recordings_are_named(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "data" / "seq", pictures(9))
    write_film(tmp_path / "data" / "film.npz", pictures(9))
    found = footage_of([str(tmp_path / "data")], Protocol(), Simulated.of("clean"))
    assert [each.name for each in found.footage] == ["seq"]
    assert found.unusable == {
        str(tmp_path / "data" / "film.npz"): "no recording, in a folder of such; give it by itself"
    }
    with pytest.raises(DataError, match=r": seq: 9 frames, expected 10 .* --skip; .*film\.npz: no recording, in a "):
        evaluate([tmp_path / "data"], tmp_path / "report", protocol=Protocol(8, 8))
    shutil.rmtree(tmp_path / "data" / "seq" / LAYOUTS["hsergb"].events)
    with pytest.raises(DataError, match=r"can be scored: .*seq: no folder events_\w+; .*film\.npz: no recording, in"):
        footage_of([str(tmp_path / "data")], Protocol(), Simulated.of("clean"))


def test_what_is_not_there_and_events_alone_are_refused_as_such(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no such file or folder; give a recording of vid2ev, HS-ERGB or "):
        footage_of([str(tmp_path / "none")], Protocol(), Simulated.of("clean"))
    np.savez(tmp_path / "a.npz", t=[1, 2], x=[1, 2], y=[3, 4], p=[0, 1])
    with pytest.raises(UsageError, match=r"a\.npz is an event file \(npz\), and what is scored are frames; "):
        footage_of([str(tmp_path / "a.npz")], Protocol(), Simulated.of("clean"))


def test_predictions_of_16_bits_are_brought_to_the_nearest_of_8(tmp_path: Path) -> None:
    truth = pictures(13)
    write_hsergb(tmp_path / "seq", truth)
    draw = np.random.default_rng(0)
    deep = truth.astype(np.int64) * 257 + draw.integers(-128, 129, truth.shape)
    write_predictions(tmp_path / "results" / "seq", np.clip(deep, 0, 65535).astype(np.uint16))
    (ours,) = predictions_in(tmp_path / "results")
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq")
    for group in recording.groups():
        np.testing.assert_array_equal(np.stack(ours.begin(recording).frames(group)), group.truth)


def test_truth_of_16_bits_is_read_as_predictions_are(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "seq", pictures(5))
    draw = np.random.default_rng(0)
    deep = draw.integers(0, 65536, (5, 24, 40, 3)).astype(np.uint16)
    for k, frame in enumerate(deep):
        write_codes(tmp_path / "seq" / "images_corrected" / f"{k:06d}.png", frame)
    shutil.copytree(tmp_path / "seq" / "images_corrected", tmp_path / "results" / "seq")
    (ours,) = predictions_in(tmp_path / "results")
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq")
    (group,) = recording.groups()
    np.testing.assert_array_equal(group.truth, np.rint(deep[1:4] / 257))
    np.testing.assert_array_equal(np.stack(ours.begin(recording).frames(group)), group.truth)


def test_hidden_files_and_folders_are_no_predictions(tmp_path: Path) -> None:
    # (macOS puts them beside those that it writes to disks of others)
    truth = pictures(13)
    write_hsergb(tmp_path / "seq", truth)
    write_predictions(tmp_path / "results" / "seq" / "ours", truth)
    (tmp_path / "results" / "seq" / "ours" / "._frame0.png").write_bytes(b"\0\5\x16\7")
    write_predictions(tmp_path / "results" / "seq" / ".thumbnails", truth[:1])
    (ours,) = predictions_in(tmp_path / "results")
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq")
    for group in recording.groups():
        np.testing.assert_array_equal(np.stack(ours.begin(recording).frames(group)), group.truth)


@pytest.mark.parametrize("lost", [(5,), (2, 3), (0, 4, 8, 12), (1, 6, 11), (3, 4, 5, 6)])
def test_numbered_predictions_of_which_some_are_missing_are_of_the_frames_of_their_numbers(
    tmp_path: Path, lost: tuple[int, ...]
) -> None:
    truth = pictures(13)
    write_hsergb(tmp_path / "seq", truth)
    write_predictions(tmp_path / "theirs" / "seq", truth)
    for k in lost:
        (tmp_path / "theirs" / "seq" / f"frame{k}.png").unlink()
    (theirs,) = predictions_in(tmp_path / "theirs")
    recording = Recording(open_sequence(tmp_path / "seq"), Protocol(3, 3), "seq")
    running = theirs.begin(recording)
    for group in recording.groups():
        for place, true, made in zip(group.positions, group.truth, running.frames(group), strict=True):
            if group.first + place in lost:
                assert made is None
            else:
                np.testing.assert_array_equal(made, true)


@pytest.mark.parametrize("numbers", [range(1, 4), range(2, 4), range(5, 8), [3]])
def test_predictions_of_the_first_gaps_alone_are_known_by_their_numbers(numbers: Iterable[int]) -> None:
    files = {k: Path(f"{k:06d}.png") for k in numbers}
    assert paired([*files.values()], 213, Protocol(3, 3)).files == files


def test_predictions_are_of_the_frames_that_are_rebuilt_wherever_the_first_key_frame_is() -> None:
    files = [Path(f"{k}.png") for k in range(14)]
    for begin, frames in ((0, 17), (1, 18), (3, 25)):
        rebuilt = [begin + gap + place for gap in (0, 8) for place in range(1, 8)]
        assert paired(files, frames, Protocol(), begin).files == dict(zip(rebuilt, files, strict=True))


@pytest.mark.parametrize("names", [["a", "b", "c"], ["1", "2", "3", "4"], ["7a7", "8b7", "9c7"]])
def test_predictions_of_which_nobody_can_tell_what_they_are_of_are_refused(names: list[str]) -> None:
    with pytest.raises(DataError, match=r"\d pictures for 13 frames, of which 9 are rebuilt; expected as many as"):
        paired([Path(f"{name}.png") for name in names], 13, Protocol(3, 3))


SKIPPED = [k for k in range(16) if k % 8]
FINER = [k for k in range(32) if k % 16]
HALVES = [k // 2 if k % 2 == 0 else None for k in FINER]


@pytest.mark.parametrize(
    ("insert", "limit", "numbers", "frames"),
    [
        (3, None, range(6), [2, 4, 6, 10, 12, 14]),
        (3, None, range(1, 7), [2, 4, 6, 10, 12, 14]),
        (3, None, [1, 2, 3, 5, 6, 7], [2, 4, 6, 10, 12, 14]),
        (3, None, [2, 4, 6, 10, 12, 14], [2, 4, 6, 10, 12, 14]),
        (3, 1, range(3), [2, 4, 6]),
        (3, 1, range(6), [2, 4, 6, 10, 12, 14]),
        (3, None, range(14), SKIPPED),
        (15, None, range(30), HALVES),
        (15, None, FINER, HALVES),
        (15, None, range(33), [k // 2 if k % 2 == 0 else None for k in range(33)]),
        (15, None, range(14), SKIPPED),
        (5, None, range(10), [None, None, 4, None, None, None, None, 12, None, None]),
        (7, 1, range(7), range(1, 8)),
        (7, 1, range(1, 8), range(1, 8)),
        (7, 1, range(9, 16), range(9, 16)),
        (7, 1, range(14), SKIPPED),
        (7, 1, range(9), range(9)),
        (7, None, range(17), range(17)),
        (7, None, range(18), range(18)),
        (3, None, range(19), range(19)),
        (15, 1, range(19), range(19)),
        (7, None, range(25), range(25)),
    ],
)
def test_predictions_are_as_many_as_are_rebuilt_of_the_gaps_asked_for(
    insert: int, limit: int | None, numbers: Iterable[int], frames: Iterable[int | None]
) -> None:
    files = [Path(f"{k:06d}.png") for k in numbers]
    expected = {frame: path for frame, path in zip(frames, files, strict=True) if frame is not None}
    assert paired(files, 19, Protocol(7, insert), limit=limit).files == expected


@pytest.mark.parametrize(
    ("insert", "limit", "numbers", "rebuilt"),
    [
        (7, None, range(7), 14),  # the first 7 frames, or those of the first gap
        (3, None, range(9), 6),  # the first 9 frames, or those made and the key frames around
        (3, 1, range(5), 3),
        (3, None, range(1, 4), 6),
        (15, None, range(10), 30),
        (15, None, range(20, 40), 30),
        (7, None, range(21), 14),
        (7, None, range(10_000, 10_240, 40), 14),
    ],
)
def test_predictions_that_may_be_of_frames_or_a_count_of_their_own_are_refused(
    insert: int, limit: int | None, numbers: Iterable[int], rebuilt: int
) -> None:
    files = [Path(f"{k:06d}.png") for k in numbers]
    with pytest.raises(DataError, match=rf"{len(files)} pictures for 19 frames, of which {rebuilt} are rebuilt"):
        paired(files, 19, Protocol(7, insert), limit=limit)


OWN = [range(1, 18), range(40, 57), [*range(6), *range(7, 18)], range(0, 51, 3)]


@pytest.mark.parametrize("own", OWN)
def test_predictions_that_are_called_as_the_pictures_of_their_sequence_are_of_these(own: Iterable[int]) -> None:
    numbers, scored = [*own], [k for k in range(17) if k % 4]
    files = {k: Path(f"{numbers[k]:06d}.png") for k in scored}
    assert paired([*files.values()], 17, Protocol(3, 3), own=numbers).files == files
    counted = {k: Path(f"{k:06d}.png") for k in scored}  # (as frames are counted, whatever their pictures are called)
    assert paired([*counted.values()], 17, Protocol(3, 3), own=numbers).files == counted
    everything = {k: Path(f"{number:06d}.png") for k, number in enumerate(numbers)}
    assert paired([*everything.values()], 17, Protocol(3, 3), own=numbers).files == everything


@pytest.mark.parametrize("own", OWN)
def test_of_predictions_of_which_some_are_missing_it_is_said_whose_numbers_they_have(own: Iterable[int]) -> None:
    numbers, scored, draw = [*own], [k for k in range(17) if k % 4], np.random.default_rng(0)
    for _ in range(50):
        some = sorted(draw.choice(scored, draw.integers(1, 12), replace=False).tolist())
        files = {k: Path(f"{numbers[k]:06d}.png") for k in some}
        try:
            found = paired([*files.values()], 17, Protocol(3, 3), own=numbers)
        except DataError:
            continue
        assert found.files == files or found.remark


@pytest.mark.parametrize(("skip", "gaps", "rest"), [(1, 5, 0), (1, 6, 1), (3, 4, 0), (7, 2, 2), (7, 5, 0), (4, 3, 3)])
def test_predictions_that_are_numbered_from_1_are_of_no_other_frames(skip: int, gaps: int, rest: int) -> None:
    """As FFmpeg numbers the pictures that it takes out of a film: those rebuilt are called as it calls their truth."""
    frames, protocol, draw = gaps * (skip + 1) + 1 + rest, Protocol(skip, skip), np.random.default_rng(0)
    scored = [k for k in range(gaps * (skip + 1)) if k % (skip + 1)]
    files = {k: Path(f"{k + 1:06d}.png") for k in scored}
    for own in ((), range(frames), range(1, frames + 1)):
        assert paired([*files.values()], frames, protocol, own=own).files == files
        for lost in draw.choice(scored, 4, replace=False).tolist():
            some = {k: path for k, path in files.items() if k != lost}
            found = paired([*some.values()], frames, protocol, own=own)
            assert found.files == some or found.remark
    for limit in range(1, gaps):
        few = {k: path for k, path in files.items() if k < limit * (skip + 1)}
        if limit == 1:  # (without a gap in their numbers)
            with pytest.raises(DataError, match=f"{skip} pictures? for {frames} frames"):
                paired([*few.values()], frames, protocol, limit=limit)
        else:
            assert paired([*few.values()], frames, protocol, limit=limit).files == few


def test_predictions_of_folders_that_are_numbered_otherwise_are_compared_with_what_they_are_called_as(
    tmp_path: Path,
) -> None:
    truth = pictures(14)
    write_hsergb(tmp_path / "data" / "seq", truth)
    (tmp_path / "data" / "seq" / "images_corrected" / "000006.png").unlink()
    write_predictions(tmp_path / "frames", truth)  # frame0.png ...
    (tmp_path / "frames" / "frame0.png").rename(tmp_path / "frames" / "frame14.png")
    for name, called in (("seq", [1, 2, 3, 5, 7, 8, 10, 11, 12]), ("frames", [2, 3, 4, 6, 7, 8, 10, 11, 12])):
        (tmp_path / "theirs" / name).mkdir(parents=True)
        for k in called:
            write_codes(tmp_path / "theirs" / name / f"{k:03d}.png", truth[k])
    options: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"], "protocol": Protocol(3, 3)}
    options["simulated"] = Simulated.of("clean", fps=250)
    found = evaluate([str(tmp_path / "data"), str(tmp_path / "frames")], tmp_path / "report", **options)
    assert found.summary["methods"]["theirs"]["perfect"] == len(found.rows) == 18
    said = "theirs: 9 pictures, taken for the frames whose own pictures have the same numbers, "
    assert {f"seq: {said}1 to 12", f"frames: {said}2 to 12"} <= {*notes(found.summary)}


def test_where_pictures_were_paired_by_less_than_their_number_it_is_said(tmp_path: Path) -> None:
    truth = pictures(9)
    write_hsergb(tmp_path / "seq", truth)
    write_predictions(tmp_path / "theirs" / "seq", truth[1:4])
    options: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"], "protocol": Protocol(3, 3)}
    found = evaluate([str(tmp_path / "seq")], tmp_path / "report", limit=1, **options)
    assert found.summary["methods"]["theirs"]["perfect"] == 3
    assert "seq: theirs: 3 pictures, taken for those rebuilt in the first gap" in notes(found.summary)
    again = evaluate([str(tmp_path / "seq")], tmp_path / "report", limit=1, resume=True, **options)
    assert again.summary == found.summary


def test_what_cannot_be_scored_is_said(tmp_path: Path) -> None:
    """Frames that are dropped for their times, and footage that is too short."""
    write_film(tmp_path / "film.npz", pictures(4))
    with pytest.raises(DataError, match=r"film: 4 frames, expected 9 or more; give a smaller --skip"):
        evaluate([str(tmp_path / "film.npz")], tmp_path / "report", baselines=("linear",))
    write_film(tmp_path / "two.npz", pictures(2))
    with pytest.raises(DataError, match=r"two: 2 frames, expected 9 or more; give more of it"):
        evaluate([str(tmp_path / "two.npz")], tmp_path / "report", baselines=("linear",))
    folder = tmp_path / "frames"
    write_predictions(folder, pictures(4))
    (folder / "timestamps.txt").write_text("# us\n0\n8000\n4000\n12000\n")
    found = evaluate([str(folder)], tmp_path / "other", baselines=("linear",), protocol=Protocol(1, 1))
    (known,) = found.summary["sequences"].values()
    assert any("dropped 1 of 4 frames" in remark for remark in known["remarks"])


def test_what_fails_before_anything_is_scored_leaves_nothing(tmp_path: Path) -> None:
    write_film(tmp_path / "film.npz", pictures(4))
    (tmp_path / "mine").mkdir()
    for report in (tmp_path / "report", tmp_path / "mine"):
        with pytest.raises(DataError, match="give a smaller --skip"):
            evaluate([str(tmp_path / "film.npz")], report, baselines=("linear",))
        assert report.exists() == (report.name == "mine") and not [*report.glob("*")]
        evaluate([str(tmp_path / "film.npz")], report, baselines=("linear",), protocol=Protocol(1, 1))
        with pytest.raises(UsageError, match="holds an evaluation"):
            evaluate([str(tmp_path / "film.npz")], report, baselines=("linear",))
        assert (report / "rows.csv").exists() and (report / "job.json").exists()


def test_predictions_that_are_missing_or_cannot_be_used_are_named_and_counted(tmp_path: Path) -> None:
    truth = pictures(13)
    for name in ("a", "b"):
        write_hsergb(tmp_path / "data" / name, truth)
    write_predictions(tmp_path / "theirs" / "a", truth[:7])
    options: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"], "protocol": Protocol(3, 3)}
    found = evaluate([str(tmp_path / "data")], tmp_path / "report", **options)
    assert {name: of["missing"]["theirs"] for name, of in found.summary["sequences"].items()} == {"a": 4, "b": 0}
    assert len(found.rows) == 5
    nowhere = f"not scored: 9 frames of theirs: no folder {tmp_path / 'theirs' / 'b'} ("
    assert any(each.startswith(nowhere) for each in notes(found.summary))
    for name in ("a", "b"):
        write_predictions(tmp_path / "odd" / name, truth)
    for k in (2, 3):
        write_codes(tmp_path / "odd" / "a" / f"frame{k}.png", truth[k, :12])
    (tmp_path / "odd" / "a" / "frame5.png").write_bytes(b"torn")
    (tmp_path / "odd" / "b" / "readme.png").write_bytes(b"")  # (so that nobody can tell which frame each is of)
    options["predictions"] = [tmp_path / "odd"]
    found = evaluate([str(tmp_path / "data")], tmp_path / "other", **options)
    of = found.summary["sequences"]
    assert of["a"]["unfit"]["odd"] == {
        "40x12 pixels, expected a picture of 40x24": ["frame2.png", "frame3.png"],
        "no picture, expected a picture of 40x24": ["frame5.png"],
    }
    assert [len(which) for which in of["b"]["unfit"]["odd"].values()] == [9]
    assert of["a"]["missing"] == of["b"]["missing"] == {"odd": 0} and len(found.rows) == 9 - 3
    said = left_out(found.summary)
    assert said["frames of odd: 40x12 pixels, expected a picture of 40x24 (frame2.png, frame3.png), in a"] == 2
    assert sum(said.values()) == 3 + 9
    assert "frame5.png" in (tmp_path / "other" / "report.md").read_text()
    write_predictions(tmp_path / "wrong" / "a", truth[:, :12])
    options["predictions"] = [tmp_path / "wrong"]
    with pytest.raises(DataError, match=r"no frame could be scored: a: 9 frames of wrong: 40x12 pixels"):
        evaluate([str(tmp_path / "data")], tmp_path / "third", **options)
    with pytest.raises(UsageError, match="no predictions in it"):
        predictions_in(tmp_path / "data" / "a" / "events_aligned")


@pytest.mark.parametrize("folder", ["my seq (1)", "my-seq-1"])
def test_predictions_are_found_by_what_sequences_are_called_on_disk(tmp_path: Path, folder: str) -> None:
    write_hsergb(tmp_path / "my seq (1)", pictures(5))
    write_predictions(tmp_path / "theirs" / folder, pictures(5))
    options: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"], "protocol": Protocol(3, 3)}
    found = evaluate([str(tmp_path / "my seq (1)")], tmp_path / "report", **options)
    assert found.summary["methods"]["theirs"]["perfect"] == 3 and not found.summary["unusable"]
    assert "theirs: 3 frames without an error, or hardly any, taken as 100 dB each" in notes(found.summary)


def test_predictions_are_found_below_their_data_set(tmp_path: Path) -> None:
    truths = {name: pictures(5, seed) for seed, name in enumerate(("close", "far"))}
    for name, truth in truths.items():
        write_hsergb(tmp_path / name / "x", truth)
        write_predictions(tmp_path / "theirs" / name / "x" / "ours", truth)
    options: dict[str, Any] = {"baselines": (), "predictions": [tmp_path / "theirs"], "protocol": Protocol(3, 3)}
    for below in ("", "x"):  # (the sets, and the sequences themselves)
        asked = [str(tmp_path / name / below) for name in truths]
        found = evaluate(asked, tmp_path / f"report{below}", **options)
        assert list(found.summary["methods"]) == ["ours"] and found.summary["methods"]["ours"]["perfect"] == 6
        assert not found.summary["unusable"]


def test_folders_of_predictions_that_fit_no_sequence_and_pictures_that_are_no_png_are_named(tmp_path: Path) -> None:
    write_hsergb(tmp_path / "my seq", pictures(5))
    write_predictions(tmp_path / "theirs" / "other", pictures(5))
    (tmp_path / "theirs" / "notes").mkdir()
    options: dict[str, Any] = {"baselines": ("linear",), "predictions": [tmp_path / "theirs"]}
    options["protocol"] = Protocol(3, 3)
    found = evaluate([str(tmp_path / "my seq")], tmp_path / "report", **options)
    where = tmp_path / "theirs"
    said = notes(found.summary)
    assert f"{where}: not used: folders of no sequence that is scored: other" in said
    assert any(f"3 frames of theirs: no folder {where / 'my seq'} or {where / 'my-seq'} (" in each for each in said)
    write_predictions(where / "my seq" / "ours", pictures(5))
    (where / "my seq" / "ours" / "frame9.jpg").write_bytes(b"")
    (where / "my seq" / "soft").mkdir()
    (where / "my seq" / "soft" / "0.jpg").write_bytes(b"")
    found = evaluate([str(tmp_path / "my seq")], tmp_path / "other", **options)
    assert any("pictures that are no PNG: 2 in my seq/ours, my seq/soft (frame9.jpg, 0.jpg); save" in each
               for each in notes(found.summary))  # fmt: skip
    shutil.rmtree(where / "other")
    shutil.rmtree(where / "my seq" / "ours")
    with pytest.raises(UsageError, match=r"no predictions in it; .*; pictures that are no PNG: 1 in my seq/soft"):
        evaluate([str(tmp_path / "my seq")], tmp_path / "third", **options)


def test_data_sets_of_all_kinds_have_names_that_differ(tmp_path: Path) -> None:
    for name in ("close/x", "far/x"):
        write_hsergb(tmp_path / name, pictures(9))
    write_film(tmp_path / "x.npz", pictures(9))
    asked = [str(tmp_path / name) for name in ("close", "far", "x.npz")]
    found = footage_of(asked, Protocol(), Simulated.of("clean"))
    assert [each.name for each in found.footage] == ["x", "x_2", "x_3"]
    alike = footage_of([str(tmp_path / name) for name in ("close/x", "far/x")], Protocol(), Simulated.of("clean"))
    assert alike.sets == {"close-x": ["x"], "far-x": ["x_2"]}
    assert found.sets == {"close": ["x"], "far": ["x_2"], "x.npz": ["x_3"]}
    write_film(tmp_path / "films" / "b.npz", pictures(9))
    write_film(tmp_path / "films" / "a.npz", pictures(9))
    films = footage_of([str(tmp_path / "films"), f"{tmp_path}/films/"], Protocol(), Simulated.of("clean"))
    assert films.sets == {"films": ["a", "b"]}  # (one place, however it is written)
    with pytest.raises(UsageError, match="no such file"):
        footage_of([str(tmp_path / "nothing")], Protocol(), Simulated.of("clean"))


def test_films_of_more_frames_a_second_than_microseconds_are_refused_in_a_sentence(tmp_path: Path) -> None:
    """A gap of no time has none in between; as of recordings whose times do not increase."""
    fast = Simulated.of("clean", fps=4_000_000)
    scene = "scene:flicker,size=64x48,scene.duration_s=0.000004"
    with pytest.raises(DataError, match=r"no frame could be scored: .*: 8 gaps: times of the frames do not increase"):
        evaluate([scene], tmp_path / "of", baselines=["linear"], protocol=Protocol(1, 1), simulated=fast)
    assert not (tmp_path / "of" / "rows.csv").exists()
