"""The command line: what it prints, and that every failure is one sentence, an exit code, and nothing left behind."""

from __future__ import annotations

import contextlib
import ctypes
import json
import logging
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from itertools import islice
from pathlib import Path
from typing import Any, get_args

import av
import click
import numpy as np
import pytest
import torch
from click.testing import CliRunner, Result
from numba import njit

from vid2ev import UsageError
from vid2ev.commands import main
from vid2ev.commands.summary import file_facts, of_the_clip, plan_text, result_facts, sensor_text, short
from vid2ev.formats import FORMATS, format_named
from vid2ev.interrupts import heard, never_lost
from vid2ev.making import conversion
from vid2ev.recording.folder import Folder
from vid2ev.recording.manifest import difference
from vid2ev.seen import instants
from vid2ev.seen.instants import Instant
from vid2ev.seen.recipe import Recipe
from vid2ev.sensors.tiles import Tiles
from vid2ev.tracks.outputs import Outputs

CLIP = "synthetic:moving-edge,size=64x48,fps=100,duration_s=0.2"
LONG = "a" * 300
QUICK = ["--upsample", "none", "--threads", "1"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def vid2ev(*arguments: str) -> Result:
    result = CliRunner().invoke(main, arguments)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def left() -> set[str]:
    return {path.name for path in Path().iterdir()}


def refused(exit_code: int, sentence: str, *arguments: str) -> str:
    """The error of a command, which must be one line and leave the folder as it was."""
    before = left()
    result = vid2ev(*arguments)
    assert result.exit_code == exit_code, result.output
    line = result.stderr.strip()
    assert line.startswith("error: ") and "\n" not in line and result.stdout == ""
    assert sentence in line
    assert left() == before
    return line


def write_video(path: Path, frames: int = 30, size: tuple[int, int] = (64, 48)) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"g": "5"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for k in range(frames):
            picture = np.full((size[1], size[0], 3), 40, np.uint8)
            picture[10:30, k : k + 20] = 200
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    return path


# ----------------------------------------------------------------------------------------------------- what works


def test_a_video_becomes_a_recording() -> None:
    write_video(Path("clip.mp4"))
    result = vid2ev("convert", "clip.mp4", *QUICK)
    assert result.exit_code == 0 and result.stderr == ""
    assert {path.name for path in Path("clip_events").iterdir()} == {"events.h5", "preview.mp4", "manifest.json"}
    manifest = json.loads(Path("clip_events/manifest.json").read_text())
    assert f"{manifest['counts']['events']:,}" in result.stdout
    assert manifest["counts"]["frames"] == 30 and manifest["counts"]["events"] > 0
    assert len(result.stdout.splitlines()) < 25


def test_options_reach_the_recording() -> None:
    sensor = Path("mine.toml")
    sensor.write_text("[dvs]\nthreshold_on = 0.3\nmismatch = 0\ncrossing_noise = 0\n")
    options = [
        "--set",
        "threshold_off=0.25",
        "--seed",
        "9",
        "--labels",
        "--no-preview",
        "--fps",
        "50",
        "--threads",
        "2",
    ]
    light = ["--upsample", "linear", "--subframes", "3", "--max-subframes", "8"]
    result = vid2ev("convert", CLIP, "-o", "a/b/out", "--sensor", "mine.toml", "-q", *options, *light)
    assert (result.exit_code, result.output) == (0, "")
    manifest = json.loads(Path("a/b/out/manifest.json").read_text())
    parameters = manifest["sensor"]["parameters"]
    assert (parameters["threshold_on"], parameters["threshold_off"], manifest["seed"]) == (0.3, 0.25, 9)
    assert manifest["upsampling"] == {
        "method": "linear",
        "subframes": 3,
        "max_subframes": 8,
        "cuts": "restart",
    }
    assert manifest["labels"] is True and manifest["run"]["threads"] == 2
    assert manifest["counts"]["frames"] == 11  # 0.2 s at 50 Hz instead of 100
    assert not Path("a/b/out/preview.mp4").exists()


def test_a_dry_run_says_all_and_does_nothing() -> None:
    result = vid2ev(
        "convert", CLIP, "--dry-run", "--sensor", "davis346", "--set", "threshold_on=0.31", "--seed", "random"
    )
    assert result.exit_code == 0 and left() == set()
    for fact in ("moving-edge", "64x48", "davis346", "0.31", "refractory", "at random", "events.h5"):
        assert fact in result.stdout
    refused(2, "threshold_onn", "convert", CLIP, "--dry-run", "--set", "threshold_onn=1")


@pytest.mark.parametrize("frames", ["npz", "png", "mp4"])
def test_a_dry_run_names_all_files(frames: str) -> None:
    asked = [
        "--frames-out",
        frames,
        "--format",
        "csv,hdf5",
        "--probe",
        "3,4",
        "--noise-maps",
        "--cis-out",
        "raw,png,mp4",
    ]
    arguments = ["convert", CLIP, "-o", "out", "--frames", "--truth", "poses,mask", *asked, *QUICK]
    said = next(line for line in vid2ev(*arguments, "--dry-run").stdout.splitlines() if line.startswith("output"))
    assert vid2ev(*arguments, "-q").exit_code == 0
    made = [path for pattern in ("*", "dvs/*", "cis/*") for path in Path("out").glob(pattern)]
    there = {str(path.relative_to("out")) for path in made} - {"dvs", "cis"}
    assert {*said.partition("out: ")[2].split(", ")} == there


@pytest.mark.parametrize("effects", ["all", "none", "mismatch"])
def test_a_dry_run_has_the_sensor_and_the_plan_of_the_manifest(effects: str) -> None:
    arguments = ["convert", CLIP, "-o", "out", "--sensor", "v2e-clean", "--effects", effects, *QUICK]
    foretold = json.loads(vid2ev(*arguments, "--dry-run", "--json").stdout)
    said = vid2ev(*arguments, "--dry-run").stdout
    assert vid2ev(*arguments, "-q").exit_code == 0
    manifest = json.loads(Path("out/manifest.json").read_text())
    assert foretold == {key: manifest[key] for key in foretold}
    assert f"effects   {', '.join(manifest['sensor']['effects']) or 'none'}" in said


@pytest.mark.parametrize(
    ("sentence", "video", "arguments"),
    [
        ("cannot do --cuts keep", CLIP, ["--split", "cuts", "--cuts", "keep"]),
        ("cannot do a scene", "scene:room", ["--split", "cuts"]),
        ("cannot do --probe", CLIP, ["--split", "approximate", "--probe", "1,1"]),
    ],
)
def test_a_dry_run_refuses_what_workers_would(sentence: str, video: str, arguments: list[str]) -> None:
    for more in ([], ["--dry-run"]):
        result = vid2ev("convert", video, "--jobs", "2", *arguments, *QUICK, *more)
        assert result.exit_code == 2 and sentence in result.stderr and left() == set()
    result = vid2ev("convert", CLIP, "camera:0", "--jobs", "2", *QUICK, "--dry-run")
    assert result.exit_code == 2 and "camera:0 passes once" in result.stderr and left() == set()


@pytest.mark.parametrize("is_finished", [True, False])
@pytest.mark.parametrize("begun", [["--seed", "7"], ["--seed", "random"], ["--effects", "auto"], ["--format", "csv"]])
def test_a_dry_run_resumes_and_refuses_what_the_run_does(
    begun: list[str], is_finished: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    arguments = ["convert", CLIP, "-o", "out", *QUICK]
    with monkeypatch.context() as patch:
        if not is_finished:
            patch.setitem(conversion.convert.__kwdefaults__, "piece", 1)
            patch.setattr("vid2ev.tracks.recorder.Recorder.finish", interrupt)
        assert vid2ev(*arguments, *begun, "-q").exit_code == (0 if is_finished else 130)
    seed = json.loads(Path("out/manifest.json" if is_finished else "out.partial/job.json").read_text())["seed"]
    for now in (["--seed", "8"], ["--effects", "none"], ["--labels"], begun):
        foretold = vid2ev(*arguments, *now, "--resume", "--dry-run")
        made = vid2ev(*arguments, *now, "--resume", "-q")
        assert (foretold.exit_code, foretold.stderr) == (made.exit_code, made.stderr)
        assert (made.exit_code == 0) == (now == begun)
    assert f"seed {seed}\n" in foretold.stdout and ("left as it is" in foretold.stdout) == is_finished


def test_a_dry_run_refuses_to_resume_what_passes_once(tmp_path: Path) -> None:
    film = write_video(tmp_path / "clip.mkv").read_bytes()
    for more in ([], ["--dry-run"]):
        result = CliRunner().invoke(main, ["convert", "-", "--resume", *more], input=film)
        assert result.exit_code == 2 and "cannot be taken up again" in result.stderr


def test_a_dry_run_says_that_effects_are_left_to_the_light() -> None:
    assert "those that the light calls for" in vid2ev("convert", CLIP, "--effects", "auto", "--dry-run").stdout


@pytest.mark.parametrize(
    "more",
    [
        [],
        ["--frames", "--cis-out", "png"],
        ["--format", "csv", "--frames-out", "npz"],
        ["--rig", "two.toml"],
    ],
)
def test_a_dry_run_names_the_files_that_are_made(more: list[str]) -> None:
    Path("mine.toml").write_text("[dvs]\nthreshold_on = 0.3\n")
    cameras = ('name = "one"\nkind = "dvs"\nsensor = "mine.toml"\n', 'name = "two"\nkind = "dvs"\nsensor = "paper"\n')
    Path("two.toml").write_text("".join(f"[[camera]]\n{camera}" for camera in cameras))
    arguments = ["convert", CLIP, "-o", "out", "--truth", "poses", *QUICK, *more]
    line = next(line for line in vid2ev(*arguments, "--dry-run").stdout.splitlines() if line.startswith("output"))
    assert vid2ev(*arguments, "-q").exit_code == 0
    folders = [folder for folder in Path("out").iterdir() if (folder / "manifest.json").exists()]
    made = [*Path("out").iterdir(), *(file for folder in folders for file in folder.iterdir())]
    assert set(line.partition("out: ")[2].split(", ")) == {
        file.relative_to("out").as_posix() for file in made if file not in folders
    }


def test_verbose_says_before_what_it_does() -> None:
    result = vid2ev("convert", CLIP, "-o", "out", "-v", *QUICK)
    assert result.stdout.index("effects") < result.stdout.index("took")


def test_overwrite_and_resume_on_a_finished_recording() -> None:
    vid2ev("convert", CLIP, "-o", "out", "-q", *QUICK)
    refused(2, "--overwrite", "convert", CLIP, "-o", "out", *QUICK)
    refused(2, "seed = 0, not 1", "convert", CLIP, "-o", "out", "--resume", "--seed", "1", *QUICK)
    before = Path("out/manifest.json").stat().st_mtime_ns
    assert vid2ev("convert", CLIP, "-o", "out", "--resume", *QUICK).exit_code == 0
    assert Path("out/manifest.json").stat().st_mtime_ns == before
    assert vid2ev("convert", CLIP, "-o", "out", "--overwrite", "--seed", "1", *QUICK).exit_code == 0
    assert json.loads(Path("out/manifest.json").read_text())["seed"] == 1


def test_info_on_everything() -> None:
    write_video(Path("clip.mp4"))
    vid2ev("convert", "clip.mp4", "-q", *QUICK)
    manifest = json.loads(Path("clip_events/manifest.json").read_text())
    count = manifest["counts"]["events"]
    for path in ("clip_events", "clip_events/events.h5"):
        assert f"{count:,}" in vid2ev("info", path).stdout
    assert json.loads(vid2ev("info", "clip_events", "--json").stdout) == manifest
    events = json.loads(vid2ev("info", "clip_events/events.h5", "--json").stdout)
    assert (events["events"], events["size"]) == (count, [64, 48])
    Path("alone").mkdir()
    shutil.copy("clip_events/events.h5", "alone")
    said = json.loads(vid2ev("info", "alone", "--json").stdout)  # (what render takes)
    assert said == events | {"path": "alone"}
    for path, size in (("clip.mp4", "64x48"), ("clip_events/preview.mp4", "x480"), (CLIP, "64x48")):
        assert size in vid2ev("info", path).stdout
    assert json.loads(vid2ev("info", "clip.mp4", "--json").stdout)["size"] == [64, 48]


def test_scenes_may_have_more_settings_than_fit_into_the_name_of_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = ",".join(["scene:room,size=64x48", *(f"camera.fov_deg={angle}" for angle in range(50, 70))])
    assert "64x48, " in vid2ev("info", scene).stdout
    pytest.importorskip("nicegui")
    served: list[object] = []
    monkeypatch.setattr("vid2ev.gui.page.serve", lambda *given: served.append(given[0]))
    vid2ev("gui", scene, "--no-browser", "--port", "0")
    assert served


def test_info_does_not_print_the_lines_of_a_header() -> None:
    """Of AEDAT 2 they may be 186 kB."""
    settings = b"# a setting\r\n" * 9000 + b"# AEChip: Davis346blue\r\n#End Of ASCII Header\r\n"
    Path("old.aedat").write_bytes(b"#!AER-DAT2.0\r\n" + settings + bytes([0, 0, 0, 0, 0, 0, 0, 5]))
    said = vid2ev("info", "old.aedat").stdout
    assert "346x260" in said and "stored    aedat2, 1" in said and "setting" not in said
    assert len(json.loads(vid2ev("info", "old.aedat", "--json").stdout)["stored"]["header"]) == 9003


def test_warnings_of_a_rig_say_which_cameras_they_are_about() -> None:
    """Those of all are of no single one."""
    counts = {"frames": 2, "subframes": 0, "events": 0, "on": 0}
    said = {"left": ["a", "b", "c"], "right": ["c", "b"], "up": ["b"]}
    results = {name: {"counts": counts, "duration_us": 1, "warnings": texts} for name, texts in said.items()}
    facts = result_facts({"results": results, "cameras": {name: {"size": [1, 1]} for name in said}})
    assert [text for name, text in facts if name == "warning"] == ["left: a", "b", "left, right: c"]


def test_a_frame_camera_without_blur_is_not_said_to_expose() -> None:
    """Whatever its exposure would be; manifests of before there was such a camera do not speak of blur."""
    for blur, said in ({"blur": False}, "an instant"), ({"blur": True}, "800 us"), ({}, "800 us"):
        parameters = {"frame_rate_hz": 25.0, "exposure_us": 800.0, "line_us": 10.0, **blur}
        text = sensor_text({"kind": "cis", "name": "mine", "size": [8, 6], "parameters": parameters})
        assert text == f"mine, 8x6, 25 frames/s of {said}, lines 10 us apart"


def test_one_of_anything_is_not_said_as_of_several() -> None:
    light = np.array([[[0.1, 0]], [[0.13, np.nan]]], np.float32)
    np.save("light.npy", light)
    options = ["--fps", "100", "--sensor", "ideal", "--set", "threshold_on=0.2", *QUICK]
    said = vid2ev("convert", "light.npy", *options).output
    assert re.search(r"^events +1,", said) and "1 value of light" in said and "1 sensor thread" in said, said
    assert not re.search(r"\b1 (?![mu]?s\b)[a-z]+s\b", said), said


def test_a_truncated_video_is_converted_with_a_warning() -> None:
    whole = write_video(Path("clip.mkv"), 60).read_bytes()
    Path("cut.mkv").write_bytes(whole[: len(whole) * 2 // 3])
    result = vid2ev("convert", "cut.mkv", *QUICK)
    assert result.exit_code == 0, result.output
    assert "warning" in result.stdout
    manifest = json.loads(Path("cut_events/manifest.json").read_text())
    assert manifest["warnings"] and 1 < manifest["counts"]["frames"] < 60


def test_help_and_version() -> None:
    assert {"convert", "info", "sensors"} <= set(vid2ev("--help").stdout.split())
    for command in ("convert", "info"):
        assert vid2ev(command, "--help").exit_code == 0
    assert vid2ev("--version").stdout.startswith("vid2ev ")
    done = subprocess.run([sys.executable, "-m", "vid2ev", "info", "--help"], capture_output=True, text=True)
    assert done.returncode == 0 and "Usage: " in done.stdout


# ----------------------------------------------------------------------------------------------------- what does not


def test_a_command_that_is_not() -> None:
    result = vid2ev("convrt", CLIP)
    assert result.exit_code == 2 and "did you mean convert?" in result.stderr
    assert "the commands are" in vid2ev("qqq").stderr


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--subframes", "0"],
        ["--tolerance", "nan"],
        ["--truth-rate", "nan"],
        ["--truth-rate", "0"],
        ["--subframes", "many"],
        ["--threads", "0"],
        ["--max-subframes", "0"],
        ["--fps", "0"],
        ["--fps", "fast"],
        ["--seed=-1"],
        ["--seed", "dice"],
        ["--sensr", "ideal"],
    ],
    ids=" ".join,
)
def test_options_that_cannot_be_meant(arguments: list[str]) -> None:
    result = vid2ev("convert", *([CLIP] if arguments else []), *arguments)
    assert result.exit_code == 2 and "Error: " in result.stderr and left() == set()


@pytest.mark.parametrize("source", [CLIP, "scene:spinning-shapes"])
def test_an_upsampling_that_nobody_has(source: str) -> None:
    result = vid2ev("convert", source, "--upsample", "magic")
    assert result.exit_code == 2 and "expected one of none, linear, flow" in result.stderr and left() == set()


@pytest.mark.parametrize(
    ("sentence", "arguments"),
    [
        ("davis346", ["--sensor", "davis364"]),
        ("no.toml", ["--sensor", "no.toml"]),
        ("threshold_on", ["--set", "threshold_onn=1"]),
        ("threshold_on", ["--set", "threshold_on=-1"]),
        ("threshold_on", ["--set", "threshold_on=nan"]),
        ("key=value", ["--set", "threshold_on"]),
        ("frame_rate_hz", ["--set", "frame_rate_hz=fast"]),
        ("18446744073709551616", ["--seed", str(2**64)]),
        ("holds files", ["-o", "photos"]),
        ("is a file", ["-o", "file"]),
        ("within", ["-o", "."]),
        ("from 1 to 65536", ["--subframes", "100000"]),
        ("from 1 to 65536", ["--max-subframes", "100000"]),
        ("leave it out", ["--subframes", "8", "--upsample", "none"]),
        ("at least 1e-09", ["--set", "frame_rate_hz=1e-30"]),
        ("from 1e-06", ["--fps", "1e-300"]),
        ("loop is a link", ["-o", "loop"]),
        ("add hdf5, npz or csv", ["--labels", "--format", "evt3,dat"]),
    ],
)
def test_values_that_cannot_be(sentence: str, arguments: list[str]) -> None:
    Path("photos").mkdir()
    Path("photos/one.png").touch()
    Path("loop").symlink_to("loop")
    Path("file").touch()
    refused(2, sentence, "convert", CLIP, *arguments, *QUICK)
    refused(2, sentence, "convert", CLIP, *arguments, *QUICK, "--dry-run")


@pytest.mark.parametrize("content", [b"t x y p", np.random.default_rng(0).bytes(5000)], ids=["text", "noise"])
@pytest.mark.parametrize("name", [name for name in FORMATS if name not in ("npz", "rpg")])
def test_what_is_named_as_event_files_are_and_is_none_is_said_to_be_damaged(name: str, content: bytes) -> None:
    """But for endings that frames, and lists of videos, have as well."""
    path = Path(f"made{format_named(name).suffix}")
    path.write_bytes(content)
    refused(1, f"{path} is named as event files are", "info", str(path))


@pytest.mark.parametrize(
    ("name", "left_out"),
    [
        ("convert", set()),
        ("cost", {"labels", "truth", "truth_rate_hz"}),
        ("plan", {"labels", "truth", "truth_rate_hz", "seed"}),
    ],
)
def test_what_decides_light_and_sensors_can_be_said_to_all_that_look_at_them(name: str, left_out: set[str]) -> None:
    """An option of recipes is one of these commands, but for what changes nothing there."""
    command = main.get_command(click.Context(main), name)
    assert command is not None
    recipes, there = {"sensor", "overrides", *Recipe.options()}, {option.name for option in command.params}
    assert recipes - there == left_out
    assert name != "convert" or {*Outputs.options()} <= there


def test_the_choices_of_options_are_those_that_there_are() -> None:
    """Commands list them themselves, so that `--help` loads nothing; few have no list of their own elsewhere."""
    from interp.data.dataset_spec import DatasetSpec, Layout
    from interp.evaluate.protocol import Rounding, Times
    from interp.interpolate.destination import Kind
    from interp.methods.running import PRECISIONS
    from interp.networks.spec import BASES
    from vid2ev.physics.bayer import PATTERNS
    from vid2ev.rig.calibration import FORMATS, UNITS_M
    from vid2ev.scenes.picture_writing import WRITERS
    from vid2ev.seen.recipe import CUTS
    from vid2ev.sensors.devices import DEVICES
    from vid2ev.views.on_disk import KINDS

    known: dict[str, Iterable[str]] = {
        "convert cuts": CUTS, "cost cuts": CUTS, "plan cuts": CUTS, "convert frames": KINDS, "scene frames": WRITERS,
        "bayer": PATTERNS, "device": DEVICES, "unit": UNITS_M, "calibration name": ("rig", *FORMATS),
        "layout": get_args(Layout), "preset": get_args(DatasetSpec.model_fields["preset"].annotation),
        "times": get_args(Times), "rounding": get_args(Rounding), "format": get_args(Kind), "precision": PRECISIONS,
        "size": BASES,
    }  # fmt: skip
    context, alone = click.Context(main), set()
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        assert command is not None
        for option in command.params:
            if isinstance(option.type, click.Choice):
                there = known.get(f"{name} {option.name}", known.get(str(option.name)))
                alone |= {f"{name} {option.name}"} if there is None else set()
                assert there is None or {*option.type.choices} == {*there}, f"{name} {option.name}"
    assert alone == {"compare align", "interpolate cuts", "scene renderer", "train clips_on"}


def test_sources_that_are_none() -> None:
    Path("empty.mp4").touch()
    Path("text.mp4").write_text("not a video\n" * 1000)
    Path("noise.avi").write_bytes(np.random.default_rng(0).bytes(50_000))
    Path("bare").mkdir()
    Path("notes").mkdir()
    Path("notes/readme.txt").touch()
    np.save("cube.npy", np.zeros((3, 0, 4), np.float32))
    refused(2, "missing.mp4", "convert", "missing.mp4")
    refused(2, "no such", "convert", "synthetic.mp4/clip")
    for name in ("empty.mp4", "text.mp4", "noise.avi", "bare", "notes", "cube.npy"):
        refused(1, name, "convert", name)
        refused(1, name, "info", name)
    refused(2, "expected one of", "convert", "synthetic:nothing")
    refused(2, "transfer", "convert", str(write_video(Path("clip.mp4"), 3)), "--transfer", "gama:2")
    refused(2, "no such file", "info", "missing.h5")
    Path("noise.raw").write_bytes(Path("noise.avi").read_bytes()[:5000])
    refused(1, "noise.raw", "convert", "noise.raw")
    refused(2, "add --frames-out", "convert", "synthetic:ramp", "--frames-by", "count:100")
    Path("odd").mkdir()
    Path("odd/manifest.json").write_text("[1, 2]")
    refused(1, "manifest", "info", "odd")


@pytest.mark.parametrize("name", ["clip.h5", "clip.raw", "clip.txt", "clip.png"])
def test_content_says_what_a_file_is_and_not_its_name(name: str) -> None:
    """To all commands alike."""
    clip = write_video(Path("clip.mp4"), 3)
    expected = vid2ev("info", str(clip)).stdout
    clip.rename(name)
    assert vid2ev("info", name).stdout == expected.replace("clip.mp4", name)
    assert vid2ev("convert", name, "-o", "out", "-q", *QUICK).exit_code == 0


@pytest.mark.parametrize(
    ("words", "before"),
    [(["convert", ""], "convert"), (["convert", CLIP, "-o", ""], "-o"), (["render", "--output=", "x"], "--output="),
     (["info", "--json", ""], "--json"), ([""], "vid2ev")],
)  # fmt: skip
def test_nothing_is_not_taken_for_the_folder_one_is_in_or_the_default(words: list[str], before: str) -> None:
    refused(2, f"nothing after '{before}': expected a value", *words)


@pytest.mark.parametrize("words", ["convert x -o -", "render x --output=-", "render x -o-", "reformat x -"])
def test_nothing_is_made_that_is_called_as_standard_output(words: str) -> None:
    refused(2, "nothing goes to standard output; give a name", *words.split())
    assert not Path("-").exists()


def test_what_is_to_be_reformatted_is_not_said_to_be_made() -> None:
    refused(2, "-: no such file; give an event file", "reformat", "-", "x.h5")


def test_a_list_of_videos_is_one_to_all_commands() -> None:
    Path("list.txt").write_text("clip.mp4\n")
    refused(2, "a list of videos; give one of them", "info", "list.txt")
    Path("list.txt").write_text("clip.mp4\n", encoding="utf-16")
    refused(2, "a list of videos; give one of them", "info", "list.txt")
    refused(1, "it is not text; expected a list of videos", "convert", "list.txt")


def test_a_place_that_cannot_be_written() -> None:
    Path("file").touch()
    refused(1, "cannot be written", "convert", CLIP, "-o", "file/out", *QUICK)


@pytest.mark.parametrize(
    "arguments",
    [["convert", LONG], ["convert", CLIP, "-o", LONG], ["render", LONG], ["compare", LONG, LONG],
     ["plan", LONG], ["scene", LONG], ["reformat", LONG, "a.h5"], ["convert", CLIP, "--rig", LONG]],
)  # fmt: skip
def test_names_that_no_file_can_have(arguments: list[str]) -> None:
    refused(1, "File name too long; give ", *arguments)


def test_info_of_a_name_that_no_file_can_have() -> None:
    refused(2, "no such file or folder; give a video", "info", LONG)


def test_an_interrupted_conversion_says_how_to_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    vid2ev("convert", CLIP, "-o", "whole", "-q", *QUICK)
    of_recipe = instants._instants

    def interrupted(*asked: Any) -> Iterator[Instant]:
        for k, item in enumerate(of_recipe(*asked)):
            if k == 8:
                raise KeyboardInterrupt
            yield item

    with monkeypatch.context() as patch:
        patch.setattr(instants, "_instants", interrupted)
        result = vid2ev("convert", CLIP, "-o", "out", *QUICK)
        assert (result.exit_code, result.stderr.count("\n")) == (130, 1)
        assert "nothing is left" in result.stderr and left() == {"whole"}
        patch.setitem(conversion.convert.__kwdefaults__, "piece", 1)
        result = vid2ev("convert", CLIP, "-o", "out", *QUICK)
        assert result.exit_code == 130 and "--resume" in result.stderr
    refused(2, "--resume", "convert", CLIP, "-o", "out", *QUICK)
    result = vid2ev("convert", CLIP, "-o", "out", "--resume", *QUICK)
    assert result.exit_code == 0 and left() == {"whole", "out"}
    assert Path("out/events.h5").read_bytes() == Path("whole/events.h5").read_bytes()


@pytest.mark.parametrize("again", [[], ["--overwrite"]])
def test_of_a_recording_that_is_in_its_place_it_is_not_said_that_nothing_is_left(
    again: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["convert", CLIP, "-o", "out", *QUICK]
    if again:
        vid2ev(*arguments, "-q", "--seed", "1")
    publish = Folder.publish

    def interrupted(folder: Folder) -> None:
        publish(folder)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Folder, "publish", interrupted)
        result = vid2ev(*arguments, *again)
    assert result.exit_code == 130 and "--resume goes on" in result.stderr and left() == {"out"}
    made = Path("out/events.h5").stat()
    assert vid2ev(*arguments, "--resume").exit_code == 0 and Path("out/events.h5").stat() == made


@pytest.mark.parametrize("piece", [1, conversion.PIECE])
def test_who_asks_twice_to_end_hears_what_is_left(
    piece: int, monkeypatch: pytest.MonkeyPatch, asks_again: Callable[[], None]
) -> None:
    """The second time while it is cleared up."""
    of_recipe = instants._instants

    def interrupted(*asked: Any) -> Iterator[Instant]:
        yield from islice(of_recipe(*asked), 5)
        raise KeyboardInterrupt

    monkeypatch.setitem(conversion.convert.__kwdefaults__, "piece", piece)
    monkeypatch.setattr(instants, "_instants", interrupted)
    asks_again()
    result = vid2ev("convert", CLIP, "-o", "out", *QUICK)
    kept = piece == 1
    assert (result.exit_code, result.stderr.count("\n")) == (130, 1)
    assert ("--resume" in result.stderr, "nothing is left" in result.stderr) == (kept, not kept)
    assert left() == ({"out.partial"} if kept else set())


def test_where_there_is_no_home_what_draws_plots_does_not_complain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logging.getLogger("matplotlib"), "level", logging.WARNING)
    assert vid2ev("sensors").exit_code == 0
    assert not logging.getLogger("matplotlib.font_manager").isEnabledFor(logging.WARNING)


def test_a_path_of_very_many_folders_is_refused() -> None:
    deep = "/".join("d" * 1000)
    for words in (("convert", CLIP, "-o", deep), ("reformat", "events.h5", deep), ("scene", "room", f"-o{deep}")):
        refused(2, "999 folders deep, expected at most 400; go there first, with cd", *words)


def test_mistakes_of_the_program_keep_their_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vid2ev.seen.recipe.open_source", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        vid2ev("convert", CLIP)


def no_room() -> None:
    np.empty(1 << 60, np.uint8)


def no_room_for_a_tensor() -> None:
    torch.empty(1 << 60, dtype=torch.uint8)


def no_room_on_a_gpu() -> None:
    raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB.\nGPU 0 has ...")


@pytest.mark.parametrize("said", [
    "Caught RuntimeError in DataLoader worker process 0.\nOriginal Traceback:\nRuntimeError: unable to allocate shared"
    " memory(shm) for file </torch_2557_2702163848_0>: No space left on device (28)",
    "DataLoader worker (pid 7) is killed by signal: Bus error. It is possible that dataloader's workers are out of"
    " shared memory. Please try to raise your shared memory limit.",
])  # fmt: skip
def test_shared_memory_that_is_full_is_one_sentence(monkeypatch: pytest.MonkeyPatch, said: str) -> None:
    def fills(*_: Any, **__: Any) -> None:
        raise RuntimeError(said)

    monkeypatch.setattr("vid2ev.seen.recipe.open_source", fills)
    refused(1, "shared memory (/dev/shm) is full; give it more room, or take --workers 0", "convert", CLIP)


@pytest.mark.parametrize(("fills", "said"), [
    (no_room, "the memory"), (no_room_for_a_tensor, "the memory"), (no_room_on_a_gpu, "the GPU's memory"),
])  # fmt: skip
def test_a_full_memory_is_one_sentence(monkeypatch: pytest.MonkeyPatch, fills: Callable[[], None], said: str) -> None:
    monkeypatch.setattr("vid2ev.seen.recipe.open_source", lambda *_, **__: fills())
    result = vid2ev("convert", CLIP)
    assert result.exit_code == 1 and result.stderr.startswith(f"error: {said} is full; take smaller")
    assert result.stderr.count("\n") == 1


def test_where_no_thread_can_begin_it_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise RuntimeError("can't start new thread")  # (as Python does, of a limit of memory or of processes)

    monkeypatch.setattr("_thread.start_new_thread", none)
    monkeypatch.setattr("threading._start_new_thread", none)
    result = vid2ev("convert", CLIP, "--threads", "2")
    assert result.exit_code == 1 and result.stderr.startswith("error: no thread can begin here")
    assert result.stderr.count("\n") == 1


def test_every_error_raised_on_purpose_has_its_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command()
    def failing() -> None:
        raise UsageError("value 3: expected 4; give 4")

    monkeypatch.setattr(type(main), "get_command", lambda *_: failing)
    monkeypatch.setattr(type(main), "list_commands", lambda *_: ["failing"])
    result = vid2ev("failing")
    assert (result.exit_code, result.stderr) == (2, "error: value 3: expected 4; give 4\n")


# ----------------------------------------------------------------------------------------------------- the real thing

posix = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals, limits and terminals")


SCENE = ["scene", "room", "--fps", "1000", "-o", "room"]


def started(*arguments: str, before: str = "", **options: Any) -> subprocess.Popen[str]:
    program = f"import sys; from vid2ev.commands import main\n{before}\nmain(sys.argv[1:])"
    return subprocess.Popen([sys.executable, "-c", program, *arguments], text=True, **options)


@posix
@pytest.mark.parametrize("limit", [1000, 30_000, 120_000])
def test_a_full_disk_is_one_sentence_and_the_old_recording_stays(limit: int) -> None:
    clip = CLIP.replace("0.2", "2")
    options = [clip, "-o", "out", "-q", *QUICK]
    vid2ev("convert", *options, "--seed", "1")
    before = {path.name: path.read_bytes() for path in Path("out").iterdir()}
    full = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, resource.RLIM_INFINITY))"
    child = started("convert", *options, "--overwrite", before=full, stderr=subprocess.PIPE)
    _, error = child.communicate()
    assert child.returncode == 1, error
    assert error.startswith("error: out cannot be written") and error.count("\n") == 1
    assert {path.name: path.read_bytes() for path in Path("out").iterdir()} == before and left() == {"out"}


@posix
@pytest.mark.parametrize("asks", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_asks_a_conversion_to_end_is_told_and_finds_nothing(asks: signal.Signals) -> None:
    endless, heard = CLIP.replace("0.2", "1000"), ""
    if asks != signal.SIGINT:
        heard = f"import signal; signal.signal({int(asks)}, signal.SIG_DFL)"  # (who runs the tests may hear nothing)
    child = started("convert", endless, "-o", "out", *QUICK, before=heard, stderr=subprocess.PIPE)
    while not Path("out.partial/t").exists() and child.poll() is None:
        time.sleep(0.05)
    child.send_signal(asks)
    _, error = child.communicate()
    assert (child.returncode, error.count("\n"), error[:11]) == (130, 1, "interrupted"), error
    assert left() == set()


@posix
@pytest.mark.parametrize("asks", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("arguments", [["render", "events.csv", "-o", "film.mp4", "--by", "duration:1ms"], SCENE])
def test_who_asks_it_to_end_finds_nothing_half_made(arguments: list[str], asks: signal.Signals) -> None:
    Path("events.csv").write_text("t,x,y,p\n" + "".join(f"{1000 * k},{k % 64},{k % 48},1\n" for k in range(10**5)))
    heard = f"import signal; signal.signal({int(asks)}, signal.SIG_DFL)"  # (who runs the tests may hear nothing)
    child = started(*arguments, before=heard, stderr=subprocess.PIPE)
    while left() == {"events.csv"} and child.poll() is None:
        time.sleep(0.05)
    child.send_signal(asks)
    _, error = child.communicate()
    assert (child.returncode, error) == (130, "interrupted\n")
    assert left() == {"events.csv"}


@posix
def test_control_c_counts_even_where_python_loses_the_exception() -> None:
    class Callback:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    with heard() as check:
        check()
        callback = Callback()
        del callback
        with pytest.raises(KeyboardInterrupt):
            check()


@posix
@pytest.mark.parametrize("within", ["checked", "heard", "sensor"])
def test_control_c_counts_during_compiled_code(within: str) -> None:
    """That returns an array: Numba makes it by a function of Python's, and does not look whether that raised."""
    place = np.zeros(8)
    busy(place, 1)  # (compiled)
    asked = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    asked.start()
    with pytest.raises(KeyboardInterrupt):
        if within == "sensor":
            for _ in range(10_000):
                Tiles(1, 1).each(lambda _: busy(place, 5_000_000))
        else:
            with heard() as check:
                for _ in range(10_000):
                    busy(place, 5_000_000)
                    if within == "checked":
                        check()
    asked.join()


@posix
@pytest.mark.parametrize("within", [heard, never_lost])
@pytest.mark.parametrize("then", ["complains", "goes on"])
def test_a_control_c_that_is_lost_counts(within: Callable[[], AbstractContextManager[object]], then: str) -> None:
    """As in a callback of who compiles, which then may complain that it was not served."""

    @ctypes.CFUNCTYPE(None)
    def serve() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        served.append(True)

    served: list[bool] = []
    with pytest.raises(KeyboardInterrupt), within():
        serve()
        if then == "complains":
            raise RuntimeError("no compiled object yet")
        while True:
            time.sleep(0.01)
    assert not served
    with pytest.raises(RuntimeError), within():
        raise RuntimeError("of something else")


def test_what_is_left_in_its_midst_may_complain_to_nobody(capfd: pytest.CaptureFixture[str]) -> None:
    class Half:
        def __init__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
            self.whole = True

        def __del__(self) -> None:
            assert self.whole

    with contextlib.suppress(KeyboardInterrupt), heard():
        Half()
    assert capfd.readouterr().err == ""


@njit(nogil=True)
def busy(out, rounds):  # type: ignore[no-untyped-def]
    """What it was given, after a while of arithmetic."""
    for k in range(rounds):
        out[k % len(out)] = out[k % len(out)] * 0.5 + k
    return out


@posix
def test_a_terminal_shows_progress() -> None:
    import pty
    import termios

    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 110))
    shows = {name: value for name, value in os.environ.items() if name != "TQDM_DISABLE"}
    child = started("convert", CLIP, "-o", "out", *QUICK, stdout=subprocess.PIPE, stderr=theirs, env=shows)
    os.close(theirs)
    shown = b""
    while child.poll() is None or shown == b"":
        try:
            shown += os.read(ours, 1 << 16)
        except OSError:  # (the other end is closed)
            break
    child.communicate()
    os.close(ours)
    assert child.returncode == 0
    for fact in (b"frames", b"left", b"events/s", b"x the length of the clip"):
        assert fact in shown


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.0, "0"), (0.634, "0.63"), (9.94, "9.9"), (9.96, "10"), (12.3, "12"), (1776.0, "1,776")]
)
def test_times_are_multiples_of_the_clip_without_powers_of_ten(seconds: float, text: str) -> None:
    assert of_the_clip(2 * seconds, 2.0) == f"{text} x the length of the clip"


@pytest.mark.parametrize("digits", [1.0, 1.5, 9.99, 9.994, 9.996, 9.9999])
def test_numbers_have_three_digits_and_a_unit_without_powers_of_ten(digits: float) -> None:
    for exponent in range(-2, 14):
        number = digits * 10**exponent
        said, _, unit = short(number).partition(" ")
        value = float(said) * {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9, "T": 1e12}[unit]
        assert "e" not in said and value == pytest.approx(number, rel=0.005) and (value < 1000 or float(said) < 1000)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("asked", ["sensors", "--version", "--help"])
def test_a_full_standard_output_is_one_sentence(asked: str, unbuffered: str) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "vid2ev", asked],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=100,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )  # fmt: skip
    said = "error: standard output cannot be written: No space left on device; make room, or print to another place\n"
    assert (done.returncode, done.stderr) == (1, said)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere not all bytes are names")
def test_letters_that_standard_output_lacks_are_printed_as_numbers(tmp_path: Path) -> None:
    """And the bytes of a name that is no text as these."""
    (tmp_path / "\u2603\u00fc\udcff.toml").write_text("[dvs]\nthreshold_on = 0.2\n")
    for encoding, printed in ("latin-1", b"\\u2603\xfc\xff.toml"), ("utf-8", "\u2603\u00fc".encode() + b"\xff.toml"):
        done = subprocess.run(
            [sys.executable, "-m", "vid2ev", "sensors", "\u2603\u00fc\udcff.toml"],
            capture_output=True, timeout=100, cwd=tmp_path, env=os.environ | {"PYTHONIOENCODING": encoding},
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, b"")
        assert done.stdout.startswith(printed + b" [dvs]\n")


def test_a_dry_run_refuses_a_budget_that_cannot_be_measured(tmp_path: Path) -> None:
    arguments = ["convert", "synthetic:moving-edge", "--stop", "0.05", "--budget", "lsb=1", "-o", str(tmp_path / "a")]
    result = CliRunner().invoke(main, [*arguments, "--dry-run"])
    assert result.exit_code == 2 and "lsb cannot be measured here" in result.output
    assert CliRunner().invoke(main, [*arguments, "--dry-run", "--frames"]).exit_code == 0


def test_a_difference_is_the_value_that_differs() -> None:
    rig = {"cameras": [{"name": "left", "line_us": [1, 100]}, {"name": "right", "line_us": [1, 2]}]}
    other = {"cameras": [rig["cameras"][0], {"name": "right", "line_us": [1, 3]}]}
    assert difference(rig, other) == "cameras[right].line_us[1] = 2, not 3"
    assert difference([{"name": "a"}], [{"name": "b"}], "all") == 'all[0].name = "a", not "b"'
    assert difference([1], [1, 2], "all") == "all = [1], not [1, 2]"
    assert len(difference([1] * 999, [1], "all")) < 130


def test_files_are_told_in_order_and_those_in_folders_are_all_counted(tmp_path: Path) -> None:
    for name in ("truth/depth/0.npy", "truth/depth/1.npy", "truth/poses.txt", "b/raw/0.png", "a/x", "z.txt", "c.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("12")
    assert file_facts(tmp_path) == [
        ("files", f"{tmp_path}: c.txt 2 B, z.txt 2 B, a/ 1 file, b/ 1 file, truth/ 3 files")
    ]


def test_a_plan_without_a_bound_is_not_said_to_change_nothing() -> None:
    rows = [{"effect": "shot", "fate": "dropped"}, {"effect": "leak", "fate": "kept"}]
    assert plan_text({"rows": rows, "distance": None}) == "shot dropped; what that changes has no bound"
    assert plan_text({"rows": rows, "max_lsb": None}) == "shot dropped; what that changes has no bound"
    assert plan_text({"rows": rows, "distance": 0.014}) == "shot dropped; changes the distance by at most 0.014"
    assert plan_text({"rows": rows, "max_lsb": 2.0}) == "shot dropped; changes levels by at most 2 LSB"
