"""Many videos: what fails does not stop the rest, and everything is told at the end."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from vid2ev import Events, read_events
from vid2ev.cluster.workers import Workers
from vid2ev.commands import INTERRUPTED, batch, main
from vid2ev.formats import FORMATS, format_named
from vid2ev.formats.event_file import Recording
from vid2ev.formats.frame_index import write_frame_index
from vid2ev.making import conversion
from vid2ev.sources import many

QUICK = ["--upsample", "none", "--threads", "1", "--fps", "100", "--no-preview"]


@pytest.fixture(autouse=True)
def clips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """clips/: two arrays, a broken video, a folder of pictures, notes; more/: an array of the same name."""
    monkeypatch.chdir(tmp_path)
    Path("clips/pictures").mkdir(parents=True)
    Path("more").mkdir()
    rng = np.random.default_rng(0)
    for name in ("clips/a10.npy", "clips/a9.npy", "more/a9.npy"):
        np.save(name, rng.uniform(0.1, 1, (4, 6, 8)).astype(np.float32))
    Path("clips/broken.mp4").write_bytes(rng.bytes(5000))
    Path("clips/notes.txt").write_text("no clip")
    import cv2

    for k in range(3):
        cv2.imwrite(f"clips/pictures/{k}.png", rng.integers(0, 255, (6, 8)).astype(np.uint8))
    return Path("clips")


def vid2ev(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["convert", *arguments, *QUICK])


def test_a_folder_stands_for_what_is_in_it() -> None:
    assert many.sources_in("clips") == [f"clips/{name}" for name in ("a9.npy", "a10.npy", "broken.mp4", "pictures")]
    assert many.sources_in("clips/pictures") == ["clips/pictures"]
    assert many.sources_in("clips/a9.npy") == ["clips/a9.npy"]
    Path("bare").mkdir()
    assert many.sources_in("bare") == ["bare"]  # (which is refused in words)


@pytest.mark.parametrize("name", ["a.mxf", "a.vob", "a.dv", "a.nut", "a.ivf", "a.h264", "a.apng", "a.MJPG", "a.mjpeg"])
def test_a_folder_of_films_of_any_kind_is_no_folder_of_pictures(name: str) -> None:
    Path("films").mkdir()
    Path("films", name).touch()
    assert many.sources_in("films") == [f"films/{name}"]


def test_what_systems_put_beside_videos_is_none_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thumbnails, what macOS keeps of each file on disks of others, and what has gone astray, which nobody may read."""
    before = many.sources_in("clips")
    Path("clips/._broken.mp4").write_bytes(bytes(99))
    for name in (".thumbnails", "lost+found"):
        shutil.copytree("clips/pictures", f"clips/{name}")
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "lost+found" and access(path, mode))
    assert many.sources_in("clips") == before


@pytest.mark.parametrize("said", ["{}", '{"name": "a page", "icons": []}', "[", "\0"])
def test_a_manifest_of_something_else_makes_no_recording(said: str) -> None:
    """Neither of a folder of pictures, nor of one that has a folder `raw`."""
    shutil.copytree("clips/pictures", "clips/raw")
    for folder in ("clips", "clips/pictures"):
        Path(folder, "manifest.json").write_text(said)
    assert {"clips/pictures", "clips/raw"} < {*many.sources_in("clips")}
    assert vid2ev("clips/pictures", "clips/raw", "-o", "out").exit_code == 0


def test_a_name_longer_than_that_of_any_file_may_be_a_scene() -> None:
    Path("images.toml").write_text("[scene]\nduration_s = 0.01\n[camera]\nsize = [8, 6]\n")
    scene = f"scene:images.toml,{','.join(['background=0.5'] * 30)}"
    assert many.sources_in(scene) == [scene] and len(scene) > 255
    assert vid2ev(scene, "-o", "out").exit_code == 0


def test_a_picture_beside_videos_is_none_of_them() -> None:
    shutil.copy("clips/pictures/0.png", "clips/cover.png")
    assert "clips/broken.mp4" in many.sources_in("clips") and "clips/cover.png" not in many.sources_in("clips")
    shutil.copy("clips/pictures/0.png", "clips/still.png")
    assert many.sources_in("clips") == ["clips"]  # (more pictures than videos: frames, with a preview of them)


def test_recordings_beside_their_videos_are_none_of_them() -> None:
    """Pictures in them are of probed pixels."""
    for options in ((), ("--resume",), ("--overwrite",)):
        result = vid2ev("clips", "-o", "clips", "--probe", "1,2", *options)
        assert "3 of 4 done, 1 failed" in result.output
    assert {path.name for path in Path("clips/a9_events").iterdir()} >= {"manifest.json", "probe.png"}
    assert many.sources_in("clips/a9_events") == ["clips/a9_events"]  # (which is refused in words)


def test_no_name_does_not_stand_for_the_folder_one_is_in() -> None:
    np.save("here.npy", np.ones((2, 6, 8), np.float32))
    result = vid2ev("", "-o", "out/")
    assert result.exit_code == 2 and "nothing after 'convert': expected a value" in result.stderr
    assert not Path("out").exists()


def test_one_failure_does_not_stop_the_rest() -> None:
    result = vid2ev("clips", "-o", "out")
    assert result.exit_code == 1
    assert {path.name for path in Path("out").iterdir()} == {"a9_events", "a10_events", "pictures_events"}
    table = result.stdout.splitlines()[-5:]
    assert table[-1] == "3 of 4 done, 1 failed"
    assert [line.split()[:2] for line in table[:4]] == [
        ["done", "clips/a9.npy"],
        ["done", "clips/a10.npy"],
        ["failed", "clips/broken.mp4"],
        ["done", "clips/pictures"],
    ]
    assert result.stderr.count("error: ") == 1


def test_names_that_occur_twice_get_a_number() -> None:
    assert vid2ev("clips/a9.npy", "more/a9.npy", "-q", "-o", "out").exit_code == 0
    one, other = (Events.concatenate(read_events(f"out/{name}")) for name in ("a9_events", "a9_events_2"))
    assert len(one) and len(other) and one.t.tolist() != other.t.tolist()


def test_of_files_a_name_goes_on_after_a_comma() -> None:
    named = batch.directories(
        ["2024,05/clip.mp4", "my,clip.mp4", "scene:room,seed=3", "synthetic:ramp,fps=9", "-"], Path()
    )
    assert [path.name for path in named.values()] == [
        "clip_events", "my,clip_events", "room_events", "ramp_events", "stdin_events",
    ]  # fmt: skip


def test_resume_leaves_what_is_done_and_makes_the_rest() -> None:
    assert vid2ev("clips/a9.npy", "clips/broken.mp4", "-o", "out").exit_code == 1
    made = Path("out/a9_events/manifest.json").stat().st_mtime_ns
    result = vid2ev("clips/a9.npy", "clips/a10.npy", "-o", "out", "--resume")
    assert result.exit_code == 0 and Path("out/a9_events/manifest.json").stat().st_mtime_ns == made
    assert Path("out/a10_events/events.h5").exists()
    again = vid2ev("clips/a9.npy", "clips/a10.npy", "-o", "out")
    assert again.exit_code == 2 and again.stderr.count("--overwrite") == 2


def test_json_for_programs() -> None:
    result = vid2ev("clips", "-o", "out", "--json")
    found = json.loads(result.stdout)
    assert [entry["state"] for entry in found] == ["done", "done", "failed", "done"] and result.exit_code == 1
    assert "broken.mp4" in found[2]["error"] and found[0]["events"] > 0
    one = json.loads(vid2ev("clips/a9.npy", "-o", "single", "--json").stdout)
    assert one["counts"]["events"] == found[0]["events"]
    plan = json.loads(vid2ev("clips/a9.npy", "-o", "none", "--json", "--dry-run").stdout)
    assert plan["outputs"]["formats"] == ["hdf5"] and not Path("none").exists()


def test_memory_of_a_process_is_limited_for_one_video_too(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = []

    def shared(directories: dict[str, Path], task: object, check: object, workers: Workers, quiet: bool) -> list[dict]:
        limits.append(workers.memory)
        return [{"video": video, "directory": str(place), "state": "done"} for video, place in directories.items()]

    monkeypatch.setattr(batch, "convert_shared", shared)
    for videos in (["clips/a9.npy"], ["clips/a9.npy", "clips/a10.npy"]):
        assert vid2ev(*videos, "-o", "out", "--jobs", "2", "--memory", "2GiB").exit_code == 0
    assert limits == ["2GiB"] * 2 and not Path("out").exists()


def test_a_mistake_of_the_program_stops_one_video_only(monkeypatch: pytest.MonkeyPatch) -> None:
    convert = conversion.convert

    def failing(video: str, *arguments: object, **options: object) -> object:
        return 1 / 0 if "a10" in video else convert(video, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(conversion, "convert", failing)
    result = vid2ev("clips/a10.npy", "clips/a9.npy", "-o", "out")
    assert result.exit_code == 1 and "ZeroDivisionError" in result.stdout and "1 of 2 done" in result.stdout
    assert Path("out/a9_events").exists()


@pytest.mark.parametrize("jobs", [[], ["--jobs", "2"]])
def test_what_no_disk_takes_stops_one_video_only_and_is_a_sentence(jobs: list[str]) -> None:
    long = "a" * 300
    Path("list.txt").write_text(f"{long}\n{long}.mp4\nclips/a9.npy\n")
    for k, videos in enumerate((["list.txt"], [long, f"{long}.mp4", "clips/a9.npy"])):
        result = vid2ev(*videos, "-o", f"out{k}", *jobs)
        assert result.exit_code == 1 and "1 of 3 done, 2 failed" in result.stdout
        told = [line for line in result.stdout.splitlines() if line.startswith("failed ")]
        assert len(told) == 2 and all("File name too long; give" in line for line in told)
        assert "Traceback" not in result.output


@pytest.mark.parametrize("jobs", [[], ["--jobs", "2"]])
def test_a_folder_that_cannot_be_listed_does_not_stop_the_others(
    jobs: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = Path.iterdir

    def refused(folder: Path) -> Iterator[Path]:
        if folder.name == "pictures":
            raise PermissionError(13, "Permission denied", str(folder))
        return listed(folder)

    Path("list.txt").write_text("clips/pictures\nclips/a9.npy\n")
    monkeypatch.setattr(Path, "iterdir", refused)
    for k, videos in enumerate((["list.txt"], ["clips/pictures", "clips/a9.npy"])):
        result = vid2ev(*videos, "-o", f"out{k}", "--dry-run", *jobs)
        assert result.exit_code == 1 and "1 of 2 planned, 1 failed" in result.stdout
        assert result.stderr == "error: clips/pictures: Permission denied; give the name of a file that can be opened\n"
    alone = vid2ev("clips/pictures", "-o", "alone")
    assert alone.exit_code == 1 and alone.stderr == result.stderr


@pytest.mark.parametrize("error", [MemoryError(), PermissionError(13, "Permission denied", "clips/a10.npy")])
def test_what_is_told_of_one_video_is_told_of_one_of_many(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    convert = conversion.convert

    def failing(video: str, *arguments: object, **options: object) -> object:
        if "a10" in video:
            raise error
        return convert(video, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(conversion, "convert", failing)
    alone = vid2ev("clips/a10.npy", "-o", "alone").stderr
    assert alone.startswith("error: ") and alone.count("\n") == 1
    result = vid2ev("clips/a10.npy", "clips/a9.npy", "-o", "out")
    assert result.exit_code == 1 and result.stderr == alone and "1 of 2 done" in result.stdout
    assert alone.removeprefix("error: ") in result.stdout


@pytest.mark.parametrize("split", [[], ["--jobs", "2", "--split", "tiles"]])
@pytest.mark.parametrize("place", [1, 2])
def test_who_interrupts_one_of_many_is_told_that_those_before_are_kept(
    place: int, split: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    videos = ["clips/broken.mp4", "clips/a9.npy", "clips/a10.npy"]
    convert = conversion.convert

    def interrupted(video: str, *arguments: object, **options: object) -> object:
        if video == videos[place]:
            raise KeyboardInterrupt
        return convert(video, *arguments, **{"resume": False} | options)  # type: ignore[arg-type]

    monkeypatch.setattr(conversion, "convert", interrupted)
    monkeypatch.setattr(
        "vid2ev.making.split.convert_split",
        lambda video, directory, *_, look, **options: interrupted(video, directory, **options),
    )
    result = vid2ev(*videos, "-o", "out", "-q", *split)
    made = Path("out/a9_events/manifest.json").exists()
    assert result.exit_code == INTERRUPTED and made == (place > 1)
    assert ("--resume" in result.stderr, "nothing is left" in result.stderr) == (made, not made)


def test_several_outputs_of_one_conversion_agree() -> None:
    formats = [name for name in FORMATS if format_named(name).write]
    options = ["--format", ",".join(formats[:4]), "--format", ",".join(formats[4:])]
    assert vid2ev("clips/a9.npy", "-o", "out", "--frames-out", "npz", *options).exit_code == 0
    expected = Events.concatenate(read_events("out/events.h5"))
    files = sorted(path for path in Path("out").iterdir() if path.name.startswith("events"))
    assert len(files) == len(formats)
    for path in files:
        found = Events.concatenate(read_events(path))
        for name in "txyp":
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=str(path))
    with np.load("out/frames.npz") as frames:
        assert frames["frames"].sum() == len(expected) == frames["events"].sum()


def test_other_formats_have_an_index_of_frames_beside_them() -> None:
    assert vid2ev("clips/a9.npy", "-o", "out", "--format", "csv").exit_code == 0
    index = np.loadtxt("out/frame_index.csv", delimiter=",", skiprows=1, dtype=np.int64)
    t = Events.concatenate(read_events("out")).t
    assert index[:, 0].tolist() == [0, 10_000, 20_000, 30_000]
    assert index[:, 1].tolist() == [np.count_nonzero(t <= at) for at in index[:, 0]]
    events = Events(t, *(np.zeros(len(t), kind) for kind in (np.uint16, np.uint16, np.uint8)))
    blocks = [events.stretch(first, min(first + 3, len(t))) for first in range(0, len(t), 3)]
    recording = Recording((8, 6), 0, 30_000, len(t), lambda: iter(blocks), frame_us=index[:, 0].copy())
    write_frame_index(Path("again.csv"), recording)
    assert len(blocks) > 3 and Path("again.csv").read_bytes() == Path("out/frame_index.csv").read_bytes()
    assert vid2ev("clips/a9.npy", "-o", "both", "--format", "hdf5,csv").exit_code == 0
    assert not Path("both/frame_index.csv").exists()  # (which is in events.h5)
    assert vid2ev("clips/a9.npy", "-o", "v2e", "--format", "v2e-hdf5,hdf5").exit_code == 0
    assert Path("v2e/frame_index.csv").read_bytes() == Path("out/frame_index.csv").read_bytes()  # (events.h5 is v2e's)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--format", "mp3"], "expected one of"),
        (["--format", "es"], "cannot be written"),
        (["--frames-by", "source"], "expected frames to write; add --frames-out"),
        (["--frames-out", "npz", "--frames-by", "week:1"], "expected duration:10ms"),
        (["--frames-out", "npz", "--frames-as", "cubist"], "expected counts"),
        (["--probe", "8,0"], "expected a pixel of a sensor of 8x6"),
        (["--bayer", "rggb", "--cuts", "perhaps"], "perhaps"),
    ],
    ids=str,
)
def test_outputs_that_cannot_be(options: list[str], sentence: str) -> None:
    result = vid2ev("clips/a9.npy", "-o", "out", *options)
    assert result.exit_code == 2 and sentence in result.stderr and not Path("out").exists()


def test_a_size_that_a_format_cannot_hold_is_refused_before_converting() -> None:
    np.save("wide.npy", np.ones((2, 1, 3000), np.float32))
    result = vid2ev("wide.npy", "-o", "out", "--format", "hdf5,evt3")
    assert result.exit_code == 2 and "format evt3 cannot hold 3000x1 pixels" in result.stderr
    np.save("long.npy", np.ones((3, 1, 1), np.float32))
    Path("long_timestamps.txt").write_text("# unit: s\n0\n100\n5000\n")
    arguments = ["convert", "long.npy", "-o", "out", "--format", "v2e-hdf5"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2 and "cannot hold 5000 s" in result.stderr and not Path("out").exists()


def test_one_frame_is_no_trouble() -> None:
    np.save("one.npy", np.ones((1, 4, 4), np.float32))
    result = vid2ev("one.npy", "clips/a9.npy", "-o", "out")
    assert result.exit_code == 0 and "one frame only" in result.stdout and "2 of 2 done" in result.stdout
    assert CliRunner().invoke(main, ["info", "out/one_events"]).exit_code == 0


def test_a_slash_makes_a_folder_of_folders() -> None:
    assert vid2ev("clips/a9.npy", "-o", "many/").exit_code == 0
    assert vid2ev("clips/a9.npy", "clips/a10.npy", "-o", "many/", "--resume").exit_code == 0
    assert {path.name for path in Path("many").iterdir()} == {"a9_events", "a10_events"}


def test_recordings_are_not_taken_for_videos() -> None:
    assert vid2ev("clips/a9.npy", "-o", "out", "--format", "hdf5,csv,evt3").exit_code == 0
    for path in ("out", "out/events.h5", "out/events.csv", "out/events.raw"):
        result = vid2ev(path, "-o", "again")
        assert result.exit_code == 2 and "vid2ev render" in result.stderr and not Path("again").exists()


def test_a_dry_run_of_many_says_what_is_planned() -> None:
    result = vid2ev("clips", "-o", "out", "--dry-run")
    assert "3 of 4 planned, 1 failed" in result.stdout and not Path("out").exists()


def test_standard_input_is_not_a_folder_of_that_name(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("-").mkdir()
    assert many.sources_in("-") == ["-"]
