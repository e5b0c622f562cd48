"""`vid2ev dataset`: recordings as `convert` makes them, whole or not at all, with a card that tells the truth."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from pydantic import ValidationError

from interp.commands.dataset import dataset
from interp.data.card import card_text
from interp.data.dataset import make_scene, write_dataset
from interp.data.dataset_spec import DatasetSpec, _rig, scenes_of
from interp.data.layouts import open_sequence, windows
from interp.data.layouts.ergb import LAYOUTS
from interp.data.layouts.own import Own
from interp.data.recorded import clip_of, left_out, recorded
from interp.data.settings import ClipSettings
from vid2ev import DataError, UsageError, open_source
from vid2ev.cluster.workers import Workers
from vid2ev.errors import DiskError
from vid2ev.recording.disk import writing
from vid2ev.recording.exposures import write_codes
from vid2ev.recording.held import Held

pytestmark = pytest.mark.long

QUICK = {"count": 2, "size": (32, 24), "frames": 2}


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of 1.2 s at 30 frames a second: as slow as 4 times, it was 0.3 s at 120."""
    path = tmp_path_factory.mktemp("film") / "film.npz"
    frames = [frame.light for frame in open_source("synthetic:moving-edge,size=32x24,fps=30,duration_s=1.2").frames()]
    np.savez(path, frames=np.stack(frames).astype(np.float32), fps=30)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("data") / "set"
    write_dataset(directory, DatasetSpec(**QUICK))
    return directory


def run(*arguments: object) -> Result:
    return CliRunner().invoke(dataset, [str(each) for each in arguments])


def test_a_data_set_has_recordings_and_a_card(made: Path) -> None:
    facts = json.loads((made / "dataset.json").read_text())
    assert sorted(path.name for path in made.iterdir()) == [
        "README.md", "close-object-00000", "dataset.json", "flicker-00001",
    ]  # fmt: skip
    assert (facts["scenes"], facts["samples"], facts["cis_fps"], facts["interpolated_fps"]) == (
        2,
        2 * 1 * 8,
        30.0,
        240.0,
    )
    card = (made / "README.md").read_text()
    assert "| Scenes | 2 |" in card and "| Samples | 16 (2 CIS frames a scene) |" in card
    assert 0 < facts["disparity_mm"] <= 15


def test_key_frames_have_their_middles_where_there_is_truth(made: Path) -> None:
    for path in (made / "close-object-00000", made / "flicker-00001"):
        sequence = open_sequence(path)
        assert isinstance(sequence, Own)
        assert np.diff(sequence.key_frames).tolist() == [8]
        assert list(windows(sequence, 8).first)[:1] == [0]
        clip = clip_of(sequence, sequence.key_frames[0], 8)
        assert clip.contrast == sequence.contrast and clip.off_on.any()
        # The key frame is the truth at its instant but for noise, blur and what it clips.
        apart = np.abs(clip.keys.astype(int) - clip.truth[[0, -1]])
        assert np.median(apart) <= 6


def test_clips_to_train_with_begin_and_end_with_pictures_of_the_slow_camera(made: Path) -> None:
    """Whose noise and blur networks are to know; where none are so far apart, that is said."""
    settings = ClipSettings(
        size=(16, 16), multiples=(8,), recordings=1, scenes=0, photographs=0, recording_folders=(str(made),)
    )
    clips = [recorded(settings, 0, number, 8) for number in range(8)]
    assert all((clip.keys != clip.truth[[0, -1]]).any() for clip in clips) and not left_out(settings, 8)
    for clip in clips:
        taken = open_sequence(made / clip.about["name"]).key_frames  # type: ignore[attr-defined]
        assert {clip.about["first"], clip.about["first"] + 8} <= {*taken}
    assert recorded(settings, 0, 0, 4).truth.shape[0] == 5
    said = left_out(settings, 4)
    assert len(said) == 2 and all("one in 8: key frames of x4 are of the fast one" in each for each in said)


@pytest.mark.parametrize("step", [3, 8])
def test_clips_are_only_advised_that_there_can_be(step: int, made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Own, "key_frames", property(lambda _: [1, 1 + step]))
    settings = ClipSettings(size=(16, 16 + step), recordings=1, recording_folders=(str(made),))
    for said in left_out(settings, 4):
        advised = re.findall(r"clips\.multiples=\[(\d+)\]", said)
        assert f"one in {step}: " in said and advised == [str(step)] * (step == 8)
        assert all(ClipSettings(multiples=(int(multiple),)) for multiple in advised)


def test_the_papers_set_is_that_of_table_i() -> None:
    spec = DatasetSpec(preset="paper")
    scenes, _ = scenes_of(spec.model_copy(update={"count": 16}))
    assert len({scene.name for scene in scenes}) == 16
    assert (spec.frames - 1) * spec.multiple == 192 and spec.cis_fps * spec.multiple == 960
    for scene in scenes:
        cameras = {camera.name: camera for camera in scene.options["rig"].cameras}
        assert np.hypot(*cameras["dvs"].translation_mm[:2]) <= 15
        assert not cameras["cis"].translation_mm[0] and not cameras["instants"].translation_mm[0]
        assert set(cameras["dvs"].set) <= {"mismatch", "follower_tau_us"}  # (by the last bit of 0.015, of 100)
        assert cameras["instants"].set["frame_rate_hz"] == 960 and cameras["instants"].set["noise_lsb"] == 0


def test_films_are_cut_into_scenes_of_the_right_speed(film: Path, tmp_path: Path) -> None:
    result = run(tmp_path / "set", "--from", film, "--slowdown", 4, "--count", 1, "--jobs", 1, "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.output)
    name, scene = next(iter(facts["of_scenes"].items()))
    assert facts["disparity_mm"] == 0 and scene["samples"] == 48 and scene["key_frames"] == 7
    sequence = open_sequence(tmp_path / "set" / name)
    assert np.diff(sequence.times_us).mean() == pytest.approx(1e6 / 240, abs=1)
    card = (tmp_path / "set" / "README.md").read_text()
    assert "They are real films." in card and "| Sensors | drawn anew for every video |" in card


@pytest.mark.parametrize("layout", ["own", "hsergb"])
def test_parts_of_a_film_have_as_many_frames_as_are_asked_for(film: Path, tmp_path: Path, layout: str) -> None:
    """Whose frames are as far apart as the camera's: some parts have light for one more."""
    facts = write_dataset(tmp_path / "set", DatasetSpec(videos=(str(film),), frames=3, layout=layout))
    assert facts["scenes"] > 3
    assert {scene["key_frames"] for scene in facts["of_scenes"].values()} == {3}
    if layout == "own":
        sequence = open_sequence(next((tmp_path / "set").glob("film-*")))
        last = sequence.key_frames[-1]  # type: ignore[attr-defined]
        assert len(sequence.times_us) <= last + 8


def test_a_film_whose_clock_does_not_begin_at_0_is_cut_from_its_beginning(film: Path, tmp_path: Path) -> None:
    late = tmp_path / "film.npz"
    frames = np.load(film)["frames"]
    np.savez(late, frames=frames, timestamps=np.round(7e6 + 1e6 * np.arange(len(frames)) / 30).astype(np.int64))
    facts = [
        write_dataset(tmp_path / path.parent.name, DatasetSpec(videos=(str(path),), slowdown=4))
        for path in (film, late)
    ]
    assert facts[0]["scenes"] == facts[1]["scenes"] == 1 and not facts[1]["left_out"]
    assert facts[0]["samples"] == facts[1]["samples"]


def test_a_film_that_is_too_short_is_refused(film: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a longer video, or a smaller --slowdown than 10, or leave this one out"):
        write_dataset(tmp_path / "set", DatasetSpec(videos=(str(film),), slowdown=10))
    with pytest.raises(UsageError, match="give a longer video, or leave this one out"):
        write_dataset(tmp_path / "set", DatasetSpec(videos=(str(film),), frames=1000))
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_used_of_several_films_is_left_out(film: Path, tmp_path: Path) -> None:
    short, broken = tmp_path / "short.npz", tmp_path / "broken.mp4"
    np.savez(short, frames=np.load(film)["frames"][:3], fps=30)
    broken.write_bytes(b"no film")
    scenes, unusable = scenes_of(DatasetSpec(videos=(str(short), str(film), str(broken)), frames=2))
    assert {Path(scene.video).name for scene in scenes} == {film.name}
    assert list(unusable) == [str(short), str(broken)] and unusable[str(short)].startswith("0.0667 s, expected at le")
    assert not any(name in why for name, why in unusable.items())  # (which is said beside it)
    with pytest.raises(UsageError, match=r"short\.npz: 0\.0667 s, expected at least"):
        scenes_of(DatasetSpec(videos=(str(short), str(broken)), frames=2))


@pytest.mark.parametrize(
    ("count", "slowdown", "said"),
    [
        (None, 2, "2 of 3 videos, 2 times slower than the world"),
        (1, 2, "1 of 3 videos, 2 times slower than the world"),
        (1, 1, "1 of 3 videos, as fast as the world"),
    ],
)
def test_the_card_counts_the_videos_that_there_are_scenes_of(
    film: Path, count: int | None, slowdown: int, said: str
) -> None:
    videos = (str(film), str(film.with_name("none.mp4")), str(film))
    spec = DatasetSpec(videos=videos, slowdown=slowdown, frames=4, count=count)
    scenes, unusable = scenes_of(spec)
    facts = {
        "spec": spec.model_dump(mode="json"), "versions": {"vid2ev": "1"}, "scenes": len(scenes), "samples": 0,
        "cis_fps": 30.0, "interpolated_fps": 240.0, "events": 0, "disparity_mm": 0.0, "left_out": unusable,
        "of_scenes": {scene.name: {"key_frames": 4 + (count is None and k == 0)} for k, scene in enumerate(scenes)},
    }  # fmt: skip
    card = card_text(facts)
    assert f"| Source | {said} |" in card and f"({'4 to 5' if count is None else 4} CIS frames a scene)" in card


@pytest.mark.parametrize(
    ("videos", "said"),
    [
        (("film.npz", "film.mp4"), "They are real films."),
        (("scene:flicker", "film.mp4"), "Some of the videos are real films."),
        (("scene:flicker", "synthetic:moving-edge"), ""),
    ],
)
def test_the_card_calls_films_what_was_filmed(videos: tuple[str, ...], said: str) -> None:
    facts = {
        "spec": DatasetSpec(videos=videos).model_dump(mode="json"), "versions": {"vid2ev": "1"}, "scenes": 1,
        "samples": 0, "cis_fps": 30.0, "interpolated_fps": 240.0, "events": 0, "disparity_mm": 0.0, "left_out": {},
        "of_scenes": {"a-0": {"key_frames": 2}},
    }  # fmt: skip
    card = card_text(facts)
    assert (f"* {said} " in card and "Films have been exposed" in card) if said else "ilms" not in card


def test_recordings_of_scenes_are_called_after_these() -> None:
    """As those of `convert` are, by names that all systems have for folders."""
    said = ("scene:flicker,size=32x24,scene.duration_s=1.0", "synthetic:moving-edge,size=32x24,fps=100,duration_s=1.0")
    scenes, _ = scenes_of(DatasetSpec(videos=said, frames=2))
    assert {scene.name.rpartition("-")[0] for scene in scenes} == {"flicker-000", "moving-edge-001"}


def test_a_full_disk_is_no_fault_of_a_scene(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene that cannot be made is left out; one that cannot be written is made when there is room again."""
    from interp.data import dataset as module

    spec, real, made = DatasetSpec(videos=(str(film),), frames=2, count=2), module.convert, list[object]()

    def full(*arguments: object, **options: object) -> None:
        made.append(arguments)
        if len(made) == 2:
            (tmp_path / "set.partial" / "begun.partial").mkdir()
            with writing(tmp_path / "begun", "choose another folder with -o"):  # (which no data set has)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(*arguments, **options)

    monkeypatch.setattr(module, "convert", full)
    with pytest.raises(DiskError, match=r"No space left on device; make room or access there, then --resume$"):
        write_dataset(tmp_path / "set", spec)
    assert not (tmp_path / "set").exists()
    facts = write_dataset(tmp_path / "set", spec, resume=True)
    assert facts["scenes"] == 2 and not facts["left_out"] and len(made) == 3
    assert {path.name for path in (tmp_path / "set").iterdir()} == {*facts["of_scenes"], "README.md", "dataset.json"}


@pytest.mark.parametrize("layout", ["hsergb", "bsergb"])
def test_other_layouts_hold_the_same(tmp_path: Path, layout: str) -> None:
    spec = DatasetSpec(layout=layout, count=1, size=(32, 24), frames=3)
    write_dataset(tmp_path / "set", spec)
    (scene, *_), _ = scenes_of(spec)
    assert not any(scene.options["rig"].cameras[0].translation_mm)
    make_scene(scene, tmp_path, "own", 8)
    ours, theirs = open_sequence(tmp_path / scene.name), open_sequence(tmp_path / "set" / scene.name)
    np.testing.assert_array_equal(ours.times_us, theirs.times_us)
    np.testing.assert_array_equal(ours.frame(9), theirs.frame(9))
    between = int(ours.times_us[3]), int(ours.times_us[13])
    for name in "txyp":
        np.testing.assert_array_equal(getattr(ours.events(*between), name), getattr(theirs.events(*between), name))
    path = next((tmp_path / "set" / scene.name / LAYOUTS[layout].events).glob("*5.npz"))
    scale = 1 if layout == "hsergb" else 32  # (what loaders of each make pixels of)
    with np.load(path) as part:
        assert 0 <= part["x"].max() // scale < 32 and 0 <= part["y"].max() // scale < 24
        assert part["x"].max() // scale > 8


def test_workers_change_no_byte(made: Path, tmp_path: Path) -> None:
    again = write_dataset(tmp_path / "set", DatasetSpec(**QUICK), workers=Workers(jobs=2))
    assert again == json.loads((made / "dataset.json").read_text())
    for path in made.rglob("*"):
        if path.is_file() and path.name != "manifest.json":  # (which says when it was made)
            assert path.read_bytes() == (tmp_path / "set" / path.relative_to(made)).read_bytes(), path


KILLED = """
import os, signal, sys
from fractions import Fraction
from pathlib import Path
from interp.data.dataset import write_dataset
from interp.data.dataset_spec import DatasetSpec

write_dataset(Path(sys.argv[1]), DatasetSpec.model_validate_json(sys.argv[2]),
              report=lambda *_: os.kill(os.getpid(), signal.SIGKILL))
"""


def test_what_was_killed_goes_on_to_the_same_bytes(made: Path, tmp_path: Path) -> None:
    directory, spec = tmp_path / "set", DatasetSpec(**QUICK)
    done = subprocess.run([sys.executable, "-c", KILLED, str(directory), spec.model_dump_json()], capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert not directory.exists() and (tmp_path / "set.partial" / "close-object-00000").is_dir()
    with pytest.raises(UsageError, match="--resume continues it"):
        write_dataset(directory, spec)
    with pytest.raises(UsageError, match="needs the options it was begun with"):
        write_dataset(directory, spec.model_copy(update={"seed": 1}), resume=True)
    again = write_dataset(directory, spec, resume=True)
    assert again == json.loads((made / "dataset.json").read_text())
    assert [path.name for path in tmp_path.iterdir()] == ["set"]
    for path in made.rglob("*"):
        if path.is_file() and path.name != "manifest.json":  # (which says when it was made)
            assert path.read_bytes() == (directory / path.relative_to(made)).read_bytes(), path
    assert write_dataset(directory, spec, resume=True) == again  # (a finished one is left as it is)


def test_a_set_may_lie_in_the_folder_of_the_pictures_that_it_is_made_of(tmp_path: Path) -> None:
    for k, frame in enumerate(open_source("synthetic:moving-edge,size=32x24,fps=30,duration_s=1.2").frames()):
        write_codes(tmp_path / f"{k:03d}.png", (255 * frame.light).astype(np.uint8))
    (tmp_path / "timestamps.txt").write_text("".join(f"{k * 33_333}\n" for k in range(37)))
    spec = DatasetSpec(videos=(str(tmp_path),), frames=2, slowdown=4, count=1)
    made = write_dataset(tmp_path / "set", spec)
    assert write_dataset(tmp_path / "set", spec, resume=True) == made


def test_pictures_without_times_have_those_of_the_rate_that_is_said(tmp_path: Path) -> None:
    for k, frame in enumerate(open_source("synthetic:moving-edge,size=32x24,fps=30,duration_s=1.2").frames()):
        path = tmp_path / "pictures" / f"{k:03d}.png"
        path.parent.mkdir(exist_ok=True)
        write_codes(path, (255 * frame.light).astype(np.uint8))
    asked = ["--from", path.parent, "--count", 1, "--jobs", 1, "--slowdown", 4]
    refused = run(tmp_path / "set", *asked)
    assert "images without times; give --fps, or put a timestamps.txt" in str(refused.exception)
    result = run(tmp_path / "set", *asked, "--fps", "30000/1001", "--json")
    assert result.exit_code == 0, result.output
    (name,) = json.loads(result.output)["of_scenes"]
    manifest = json.loads((tmp_path / "set" / name / "manifest.json").read_text())
    assert float(Fraction(manifest["source"]["fps"])) == pytest.approx(30000 / 1001)
    again = run(tmp_path / "set", *asked, "--fps", 25, "--resume")
    assert "is another data set (spec.fps = " in str(again.exception)


def test_who_is_asked_to_end_while_it_begins_lets_others_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl", reason="no file locks on this system")
    flock = fcntl.flock

    def asked(handle: int, flags: int) -> None:
        flock(handle, flags)
        signal.raise_signal(signal.SIGINT)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(fcntl, "flock", asked)
        write_dataset(tmp_path / "set", DatasetSpec(**QUICK))
    assert not list(tmp_path.iterdir())
    with Held(tmp_path / "set.partial"):
        pass


def test_who_asks_it_to_end_is_told_whether_it_can_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from interp.data import dataset as module

    def asks(*_: object, **__: object) -> object:
        return signal.raise_signal(signal.SIGINT)

    for name, said in (("make_scene", "kept, the same command with --resume"), ("scenes_of", "nothing is left behind")):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, asks)
            result = run(tmp_path / name, "--count", 2, "--size", "32x24", "--jobs", 1)
        assert result.exit_code == 130 and said in result.stderr and result.stderr.count("\n") == 1
        assert (tmp_path / f"{name}.partial").exists() == (name == "make_scene")


def test_what_is_there_is_left_alone(made: Path) -> None:
    with pytest.raises(UsageError, match="exists; choose another folder"):
        write_dataset(made, DatasetSpec(**QUICK))
    with pytest.raises(UsageError, match="is another data set"):
        write_dataset(made, DatasetSpec(**(QUICK | {"seed": 5})), resume=True)


@pytest.mark.parametrize("name", [".", "..", "/", "link"])
def test_where_no_folder_can_be_put_is_said_before_any_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "within").mkdir()
    (tmp_path / "within" / "link").symlink_to("nowhere")
    monkeypatch.chdir(tmp_path / "within")
    result = run(name, "--count", 1)
    assert isinstance(result.exception, UsageError)
    assert str(result.exception).startswith(f"{name} {'is a link' if name == 'link' else 'exists'}")
    assert [path.name for path in tmp_path.rglob("*")] == ["within", "link"]


def test_scenes_that_cannot_be_made_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from interp.data import dataset as module

    real = module.convert

    def fails(video: str, *arguments: object, **options: object) -> object:
        if "flicker" in video:
            raise DataError("no lamp")
        return real(video, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "convert", fails)
    facts = write_dataset(tmp_path / "set", DatasetSpec(**QUICK))
    assert facts["left_out"] == {"flicker-00001": "no lamp"} and facts["scenes"] == 1
    assert "* flicker-00001: no lamp" in (tmp_path / "set" / "README.md").read_text()
    monkeypatch.setattr(module, "convert", lambda *_, **__: (_ for _ in ()).throw(DataError("nothing at all")))
    with pytest.raises(DataError, match=r"no scene could be made.*nothing at all"):
        write_dataset(tmp_path / "none", DatasetSpec(**QUICK))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--slowdown", "4"],
        ["--fps", "4"],
        ["--size", "large"],
        ["--size", "8x8"],
        ["--from", "nowhere.mp4"],
        ["--count", "0"],
    ],
)
def test_what_cannot_be_meant_is_one_sentence_and_exit_code_2(tmp_path: Path, arguments: list[str]) -> None:
    result = run(tmp_path / "set", *arguments)
    said = result.exception if isinstance(result.exception, UsageError) else result
    assert said is not None and said.exit_code == 2, result.output
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--size", "1000000x480"], "--size 1000000: it must be less than or equal to 65535"),
        (["--fps", "1e10", "--from"], "--fps 10000000000.0: it must be less than or equal to 1000000000"),
        (["--slowdown", "5000", "--from"], "--slowdown 5000.0: it must be less than or equal to 1000"),
        (["--slowdown", "1e-9", "--from"], "--slowdown 1e-09: it must be greater than or equal to 0.000001"),
    ],
)
def test_numbers_that_no_scene_can_have_are_refused_before_any_is_made(
    tmp_path: Path, film: Path, arguments: list[str], said: str
) -> None:
    result = run(tmp_path / "set", *arguments, *[film] * (arguments[-1] == "--from"))
    assert isinstance(result.exception, UsageError) and str(result.exception) == said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("fps", [0.01, 30_000.0])
def test_rates_that_a_data_set_may_have_give_cameras(fps: float) -> None:
    spec = DatasetSpec(cis_fps=fps, frames=2, videos=("none.mp4",), preset="paper")
    for number in range(4):
        assert _rig(spec, number)[0].cameras[2].set["frame_rate_hz"] == pytest.approx(32 * fps)
    for wrong in (fps / 10, fps * 10):
        if not 0.01 <= wrong <= 30_000:
            with pytest.raises(ValidationError, match="cis_fps"):
                DatasetSpec(cis_fps=wrong)


@pytest.mark.parametrize("size", ["64x48", "640x480"])
def test_a_size_is_of_rendered_scenes_only(tmp_path: Path, film: Path, size: str) -> None:
    result = run(tmp_path / "set", "--from", film, "--size", size)
    assert isinstance(result.exception, UsageError)
    assert str(result.exception) == f"size {size} of videos, which are seen as they are; leave it out"
    assert not (tmp_path / "set").exists()


def test_a_single_picture_is_no_video(tmp_path: Path) -> None:
    write_codes(tmp_path / "brick.png", np.zeros((24, 32, 3), np.uint8))
    with pytest.raises(UsageError, match=r"brick\.png: a single picture; give a video, or a folder that holds a seq"):
        scenes_of(DatasetSpec(videos=(str(tmp_path / "brick.png"),)))
