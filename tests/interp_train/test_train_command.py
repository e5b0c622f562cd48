"""`vid2ev train`, with samples that are quick to make."""

from __future__ import annotations

import json
import re
from multiprocessing import active_children
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from small_run import Made, clips

from interp.commands.train import train
from interp.data.sensor_ranges import SensorRanges
from interp.networks import names
from interp.train import runs
from interp.train.batches import Feed
from interp.train.job import Job
from interp.train.machines import Machines
from vid2ev.commands import Commands, main
from vid2ev.errors import DataError, UsageError
from vid2ev.recording.exposures import write_codes
from vid2ev.sensors.devices import Device

FEW = ["--steps", "3", "--set", "batch=2", "--set", "processes=1", "--set", "validations=1", "--workers", "0", "--cpu"]


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(runs, "feed_of", lambda job, *_: Feed(Made(), clips(1), job.recipe.batch, 0))
    monkeypatch.chdir(tmp_path)


def run(*arguments: str) -> Result:
    group = Commands("vid2ev")
    group.get_command = lambda *_: train  # type: ignore[method-assign]
    group.list_commands = lambda *_: ["train"]  # type: ignore[method-assign]
    return CliRunner().invoke(group, ["train", *arguments])


def test_a_run_in_two_sessions_ends_with_a_table() -> None:
    first = run(*FEW, "-o", "run", "--session", "0.001s")
    assert first.exit_code == 0, first.output
    assert first.output == "run: step 1 of 3; the same command with --resume goes on\n"
    again = run("-o", "run", "--resume", "--workers", "0", "--cpu")
    assert again.exit_code == 0, again.output
    assert again.output.startswith(
        "run: step 3 of 3\nweights.safetensors: those of step 0, the best by validation\n\n"
        "scenes             PSNR     SSIM   moving   static\n"
    )
    assert "\nbridge " in again.output and "\nnetwork " in again.output
    assert not Path("run/lock").exists()
    same = run(*FEW, "-o", "run", "--resume", "--json")
    assert json.loads(same.output)["scores"]["scenes"].keys() >= {"network", "bridge"}


def test_a_run_that_goes_on_with_other_libraries_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(*FEW, "-o", "run", "--session", "0.001s").exit_code == 0
    begun = json.loads(Path("run/run.json").read_text())
    Path("run/run.json").write_text(json.dumps(begun | {"versions": begun["versions"] | {"torch": "1.0"}}))
    on = ("-o", "run", "--resume", "--workers", "0", "--cpu")
    other = run(*on, "--session", "0.001s")
    assert other.exit_code == 0 and 'note: trained until now with torch = "1.0", not "2.' in other.output
    said = json.loads(Path("run/run.json").read_text())
    assert said["versions"]["torch"] == "1.0" and [each["versions"] for each in said["went_on_with"]] == [
        begun["versions"]
    ]
    assert "note:" not in run(*on).output and json.loads(Path("run/run.json").read_text()) == said


def test_weights_that_were_removed_meanwhile_are_missed() -> None:
    assert run(*FEW, "-o", "run", "--session", "0.001s").exit_code == 0
    Path("run/weights.safetensors").rename("kept")
    on = ("-o", "run", "--resume", "--workers", "0", "--cpu")
    missed = run(*on)
    assert missed.exit_code == 1 and "weights.safetensors is gone; put it back" in missed.output
    assert not Path("run/finished.json").exists()
    Path("kept").rename("run/weights.safetensors")
    assert run(*on).exit_code == 0 and Path("run/finished.json").exists()


@pytest.mark.parametrize(("workers", "jobs"), [("0", 1), ("1", 3)])
def test_without_workers_no_processes_make_the_first_clips(
    monkeypatch: pytest.MonkeyPatch, workers: str, jobs: int
) -> None:
    asked: list[int] = []

    def feed_of(job: Any, cache: Path, step: int, workers: int, jobs: int, *_: Any) -> Feed:
        asked.append(jobs)
        return Feed(Made(), clips(1), job.recipe.batch, 0)

    monkeypatch.setattr(runs, "feed_of", feed_of)
    monkeypatch.setattr(runs, "usable_cores", lambda: 3)
    assert run(*FEW, "-o", "run", "--workers", workers).exit_code == 0 and asked == [jobs]


def test_a_run_that_is_finished_says_so_without_its_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    made = run(*FEW, "-o", "run", "--json")
    before = {path: path.stat().st_mtime_ns for path in Path("run").rglob("*") if path.is_file()}
    monkeypatch.setattr(runs, "feed_of", lambda *_: pytest.fail("clips are made"))
    (Path("run/clips") / "left").mkdir(parents=True)  # (by a run that was killed just as it was done)
    again = run("-o", "run", "--resume", "--json")
    assert again.exit_code == 0 and again.output == made.output
    assert run("-o", "run", "--resume").output.startswith("run: step 3 of 3\nweights.safetensors: ")
    assert {path: path.stat().st_mtime_ns for path in Path("run").rglob("*") if path.is_file()} == before
    Path("run/finished.json").write_text('{"step": 3, "scores": []}')
    damaged = run("-o", "run", "--resume")
    assert damaged.exit_code == 1 and "finished.json does not say what it should" in damaged.output


@pytest.mark.parametrize(
    "said",
    [
        ["--steps", "3"], ["--seed", "7"], ["--network", "rrin-events-guided"], ["--size", "tiny"],
        ["--set", "batch=2", "--set", "processes=1"],
    ],
)  # fmt: skip
def test_what_is_not_said_of_a_run_is_as_it_was_begun(said: list[str]) -> None:
    assert run(*FEW, "--seed", "7", "-o", "run", "--session", "0.001s").exit_code == 0
    for wrong, why in (("--steps", "recipe.steps = 3, not 4"), ("--seed", "recipe.seed = 7, not 4")):
        refused = run("-o", "run", "--resume", wrong, "4")
        assert refused.exit_code == 2 and f"was begun with {why}" in refused.output
    refused = run("-o", "run", "--resume", "--set", "clips.bins=16")
    assert refused.exit_code == 2 and "was begun with clips.bins = 32, not 16" in refused.output
    again = run("-o", "run", "--resume", *said, "--workers", "0", "--cpu")
    assert again.exit_code == 0 and again.output.startswith("run: step 3 of 3"), again.output


def test_a_dry_run_says_what_would_be_done_and_does_nothing(tmp_path: Path) -> None:
    told = run("--dry-run", "--time", "2h", "--network", "e2vid")
    assert told.exit_code == 0, told.output
    assert "120 min of 8 samples of 96x96" in told.output and "e2vid_tiny" in told.output
    assert "1 step of 1 sample of" in run("--dry-run", "--steps", "1", "--set", "batch=1", "--devices", "1").output
    job = json.loads(run("--dry-run", "--json", "--seed", "3").output)
    assert job["recipe"]["seed"] == 3
    assert not list(tmp_path.iterdir())


def test_a_dry_run_refuses_the_folder_that_training_would_refuse() -> None:
    assert run(*FEW, "--seed", "7", "-o", "run", "--session", "0.001s").exit_code == 0
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("of somebody")
    Path("file").write_text("")
    before = sorted(Path(".").rglob("*"))
    for asked in (["-o", "run"], ["-o", "mine"], ["-o", "file"], ["-o", "run", "--resume", "--seed", "8"]):
        dry, real = (run(*FEW[:2], *asked, *more) for more in (["--dry-run"], []))
        assert dry.exit_code == real.exit_code == 2 and dry.output == real.output, dry.output
    goes_on = run("-o", "run", "--resume", "--dry-run")
    assert goes_on.exit_code == 0 and "3 steps of" in goes_on.output, goes_on.output
    assert sorted(Path(".").rglob("*")) == before


def test_clips_are_made_on_the_cpu_where_there_is_no_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vid2ev.sensors.devices.missing_for_cuda", lambda: "torch sees no GPU")
    done = run(*FEW, "-o", "run", "--clips-on", "cuda")
    assert done.exit_code == 0, done.output
    assert done.output.startswith("note: clips are made on the CPU: torch sees no GPU\nrun: step 3 of 3\n")
    dry = run("--dry-run", "--clips-on", "cuda")
    assert dry.exit_code == 0 and dry.output.startswith("note: clips are made on the CPU: torch sees no GPU\nnetwork ")
    quiet = run(*FEW, "-o", "other", "--clips-on", "cuda", "--quiet")
    assert quiet.exit_code == 0 and quiet.output == ""


def test_the_processes_that_train_are_the_runs(tmp_path: Path) -> None:
    """Which decide the last bits: a run goes on with those that it was begun with."""
    job = json.loads(run("--dry-run", "--json", "--cpu", "--devices", "4").output)
    assert job["recipe"]["processes"] == 4
    assert run("-o", "run", *FEW, "--devices", "1").exit_code == 0
    assert json.loads(Path("run/run.json").read_text())["job"]["recipe"]["processes"] == 1
    refused = run("-o", "run", "--resume", "--cpu", "--devices", "2")
    assert refused.exit_code == 2 and "was begun with recipe.processes = 1, not 2" in refused.output, refused.output


def test_the_help_names_every_network_that_can_be_trained() -> None:
    shown = next(option.help for option in train.params if option.name == "network")
    assert {name.replace("_", "-") for name in names()} == set(re.findall(r"[\w-]+", shown.partition("[")[0]))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--network", "rrun"], "error: network 'rrun' (did you mean rrin?)"),
        (["--time", "0"], "error: --time 0: expected a time above 0; give it as 90s, 55m or 2h"),
        (["--session", "soon"], "error: --session soon: expected a time above 0"),
        (["--set", "rate"], "error: Setting 'rate' is not of the form key=value"),
        (["--resume"], "error: rrin_events_guided_tiny holds no run to go on with"),
        (["--devices", "0"], "0 is less than 1"),
        (["--size", "huge"], "'huge' is not one of"),
        (["--seed", "9223372036854775808"], "9223372036854775808 is not in the range"),
        (["--dry-run", "--start", "features=firenet-paper"], "the loss of this network looks at no features"),
        (["--dry-run", "--start", "foo=firenet-paper"], "RrinEventsGuided has no part 'foo'; it has"),
        (["--dry-run", "--cpu", "--set", "batch=3"], "batches of 3 cannot be shared out evenly among 2 processes"),
        (["--dry-run", "--set", "network.size=small"], "setting network.size = 'small': it is none of a network's"),
        (["--dry-run", "--set", "network.name=x"], "rrin_events_guided has no option 'name'"),
        (["--dry-run", "--set", "seed=1e20"], "setting seed = 1e+20 is impossible: it must be a whole number"),
        (["--dry-run", "--set", "betas=[2,3]"], "setting betas.0 = 2 is impossible: it must be less than 1"),
        (["--dry-run", "--set", "clips.size=[1,1]"], "setting clips.size.0 = 1 is impossible"),
        (["--dry-run", "--set", "clips.size=[100000,128]"], "setting clips.size.0 = 100000 is impossible"),
        (["--dry-run", "--set", "batch=1000000000"], "setting batch = 1000000000 is impossible: it must be less"),
        (["--dry-run", "--set", "samples.size=1000"], "samples of 1000 pixels from clips of 128x128: expected smaller"),
        (["--dry-run", "--set", "samples.targets=8"], "8 targets of clips with 7 frames in between: expected no more"),
        (["--dry-run", "--set", "window.most=9"], "settings of window: begin 256 and most 9: expected no more in the"),
        (
            ["--dry-run", "--network", "firenet", "--set", "clips.multiples=[8,16]"],
            "sequences of clips with multiples (8, 16): expected one",
        ),
        (["--dry-run", "--set", 'clips.scene_names=["rom"]'], "scene 'rom'"),
        (["--dry-run", "--set", 'clips.textures=["cofee"]'], "texture 'cofee' (did you mean coffee?): no picture"),
        (["--dry-run", "--set", 'clips.environments=["sky.hdr"]'], "environment 'sky.hdr': no picture"),
        (["--dry-run", "--network", "hdr", "--data", "."], "beyond white is wanted: expected videos, pictures"),
        (["--dry-run", "--set", 'clips.light="linear"'], "clips.light = 'linear' for rrin_events_guided"),
        (
            ["--dry-run", "--network", "hdr", "--set", 'clips.light="srgb"'],
            "clips.light = 'srgb' for hdr, which learns",
        ),
        (["--dry-run", "--set", "clips.textures=[]"], "setting clips.textures = [] is impossible"),
        (["--dry-run", "--set", "clips.coarser=[0]"], "setting clips.coarser.0 = 0 is impossible"),
        (["--dry-run", "--set", "clips.gap_ms=[0,8]"], "clips.gap_ms = [0, 8] is impossible: range 0 to 8: expected"),
        (["--dry-run", "--set", "clips.motion=[]"], "motion (): expected shares above 0"),
        (["--dry-run", "--set", "clips.scene_names=[]"], "setting clips.scene_names = [] is impossible"),
        (["--dry-run", "--set", "samples.lost=[0.5,0.1]"], "range 0.5 to 0.1: expected two finite numbers"),
        (["--dry-run", "--set", "samples.quality=[90,10]"], "quality (90, 10): expected the lower one first"),
        (["--data", "nowhere"], "Path 'nowhere' does not exist"),
    ],
)
def test_wrong_options_are_one_sentence_and_exit_code_2(arguments: list[str], sentence: str, tmp_path: Path) -> None:
    shown = run(*arguments)
    assert shown.exit_code == 2
    assert sentence in shown.output and "Traceback" not in shown.output
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("clips.bins=0", "clips.bins = 0 is impossible: it must be greater than or equal to 1"),
        ("clips.bins=-32", "clips.bins = -32 is impossible: it must be greater than or equal to 1"),
        ("clips.gap_ms=[1e9,1e9]", "range 1e+09 to 1e+09: expected both ends from 0.001 to 100000"),
        ("clips.baseline_mm=[-5,-1]", "range -5 to -1: expected both ends 0, or from 1e-12 to 10000"),
        ("clips.motion=[[1,1,1e300]]", "each with a range of pixels that rises to 1000"),
        ("clips.motion=[[1e300,1,2]]", "clips.motion.0.0 = 1e+300 is impossible: it must be less than or equal to"),
        ("clips.sensors={kinds=[0,0,0]}", "kinds (0.0, 0.0, 0.0): expected a share above 0"),
        ("clips.sensors={kinds=[-1,1,1]}", "clips.sensors.kinds.0 = -1 is impossible: it must be greater than or"),
        ("clips.sensors={threshold=[0,0]}", "clips.sensors.threshold = [0, 0] is impossible: range 0 to 0: expected"),
        ("clips.sensors={threshold=[-1,0.1]}", "range -1 to 0.1: expected both ends from 0.001 to 10"),
        ("clips.sensors={off_to_on=[-1,-1]}", "range -1 to -1: expected both ends from 0.01 to 10"),
        ("clips.sensors={mismatch=[-2,-1]}", "range -2 to -1: expected both ends 0, or from 1e-12 to 10"),
        ("clips.sensors={refractory_us=[0,100]}", "range 0 to 100: expected both ends from 1e-09 to 1e+09"),
        ("clips.sensors={refractory_us=[-5,100]}", "range -5 to 100: expected both ends from 1e-09 to 1e+09"),
        ("clips.sensors={refractory_us=[100,5]}", "range 100 to 5: expected two finite numbers, the lower one first"),
        ("clips.sensors={tau_us=[0,0]}", "range 0 to 0: expected both ends from 0.001 to 1e+09"),
        ("clips.sensors={hot_probability=[1,2]}", "range 1 to 2: expected both ends from 1e-09 to 1"),
        ("clips.sensors={noise_lsb=[-3,-2]}", "range -3 to -2: expected both ends 0, or from 1e-12 to 100000"),
        ("clips.sensors={exposure=[0,5]}", "range 0 to 5: expected both ends 0, or from 1e-12 to 1"),
        (
            "clips.sensors={min_illuminance=[70000,80000],clipping=1.0}",
            "min_illuminance (70000.0, 80000.0): expected less than top_illuminance (45000.0, 65535.0)",
        ),
        ("clips.sensors={clipping=nan}", "clips.sensors.clipping = nan is impossible: it must be a finite number"),
    ],
)
def test_settings_that_no_clip_can_have_are_refused_before_training(setting: str, sentence: str) -> None:
    shown = run("--dry-run", "--set", setting)
    assert shown.exit_code == 2 and sentence in shown.output, shown.output
    assert shown.output.startswith("error: ") and shown.output.count("\n") == 1


@pytest.mark.parametrize(
    "settings",
    [
        ("clips.sensors={exposed=0.3, threshold=[0.2,0.3]}",),
        ("clips.sensors.exposed=0.3", "clips.sensors.threshold=[0.2,0.3]"),
        ("clips.sensors={exposed=0.3}", "clips.sensors.threshold=[0.2,0.3]"),
    ],
)
def test_ranges_of_sensors_are_set_one_by_one_or_together(settings: tuple[str, ...]) -> None:
    found = Job.of(settings=settings).clips.sensors
    assert found == SensorRanges(exposed=0.3, threshold=(0.2, 0.3))


@pytest.mark.parametrize("setting", ["clips.sensors.exposd=0.3", "clips.sensors={exposd=0.3}"])
def test_a_range_that_no_sensor_has_is_answered_with_those_that_it_has(setting: str) -> None:
    shown = run("--dry-run", "--set", setting)
    assert shown.exit_code == 2
    assert "'clips.sensors.exposd' is unknown (did you mean exposed?); expected one of kinds, thres" in shown.output


def test_shares_of_what_is_still_are_1_together_at_most() -> None:
    shown = run("--dry-run", "--set", "samples.still=0.9", "--set", "samples.all_still=0.9")
    assert shown.exit_code == 2 and "still 0.9 and all_still 0.9: expected 1 together at most" in shown.output
    assert run("--dry-run", "--set", "samples.still=0.9", "--set", "samples.all_still=0.1").exit_code == 0


def test_data_that_cannot_be_used_leave_room_for_another_run(monkeypatch: pytest.MonkeyPatch) -> None:
    from interp.train.made_of import feed_of

    with monkeypatch.context() as patch:
        patch.setattr(runs, "feed_of", feed_of)
        Path("nothing").mkdir()
        shown = run("--data", "nothing", "-o", "run", *FEW)
    assert shown.exit_code == 2 and "nothing: no recordings in it" in shown.output
    assert run("-o", "run", *FEW).exit_code == 0


@pytest.mark.long
def test_training_has_its_clips_made_by_another_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As on a GPU: clips of recordings, which need no device though they are to be made on one."""
    from interp.train.made_of import feed_of

    monkeypatch.setattr(runs, "feed_of", feed_of)
    write_hsergb(tmp_path / "data" / "long", 20)
    settings = [
        "clips.size=[32,24]", "clips.scenes=0", "clips.photographs=0", "clips.recordings=1", "samples.size=16",
        "window.begin=3", "window.most=4", "window.fresh=1.0", "validation.clips=1", "batch=2", "steps=3", "seed=0",
    ]  # fmt: skip
    job = Job.of("rrin-events-light", "tiny", settings, [], [str(tmp_path / "data")], [], {})
    alone = Machines.of("auto", 1, True, 1)
    done = runs.run(job, tmp_path / "run", machines=alone, workers=0, quiet=True, clips_on=Device("simulated"))
    assert done.finished and not active_children()
    assert not (tmp_path / "run" / "clips").exists()


@pytest.mark.long
def test_who_makes_clips_ends_where_those_to_validate_with_cannot_be_made(tmp_path: Path) -> None:
    from interp.train.made_of import feed_of

    write_hsergb(tmp_path / "data" / "long", 20)
    (tmp_path / "film.mp4").write_bytes(b"no film")
    settings = [
        "clips.size=[32,24]", "clips.scenes=0", "clips.photographs=0", "clips.recordings=1", "samples.size=16",
        "window.begin=3", "window.most=4", "window.fresh=1.0", "validation.clips=1", "batch=2",
    ]  # fmt: skip
    job = Job.of("rrin-events-light", "tiny", settings, [], [str(tmp_path / "data")], [str(tmp_path / "film.mp4")], {})
    with pytest.raises(DataError, match=r"film\.mp4"):
        feed_of(job, tmp_path / "clips", 0, 0, 1, device=Device("simulated"))
    assert not active_children()


def test_who_makes_clips_ends_where_they_are_too_few_to_validate_with(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ended: list[str] = []
    ahead: Any = SimpleNamespace(close=lambda: ended.append("clips"))
    monkeypatch.setattr(runs, "feed_of", lambda job, *_: Feed(Made(), clips(1), job.recipe.batch, 0, ahead))
    with pytest.raises(UsageError, match="1 clip to validate with"):
        runs.run(Job.of("rrin", settings=["batch=2"]), tmp_path / "run", machines=Machines(2, accelerator="cpu"))
    assert ended == ["clips"]


def test_recordings_that_give_no_clips_are_named_before_training(tmp_path: Path) -> None:
    for name, count in (("long", 9), ("short", 3)):
        write_hsergb(tmp_path / "data" / name, count)
    small = ("--set", "clips.size=[32,24]", "--set", "samples.size=16")
    shown = run("--data", "data", "--dry-run", *small)
    assert shown.exit_code == 0
    assert f"note: not used: {Path('data', 'short')}: 3 frames, expected 9 or more" in shown.output
    assert "long" not in shown.output
    shown = run("--data", "data", "--dry-run")
    assert shown.exit_code == 2 and "40x24 are smaller than clips, 128x128; give --set clips.size" in shown.output


def test_a_folder_of_videos_or_of_pictures_is_as_these_by_themselves(tmp_path: Path) -> None:
    light = np.random.default_rng(0).uniform(size=(20, 24, 40, 3)).astype(np.float32)
    for name in ("films/a.npz", "films/b.npz"):
        Path(name).parent.mkdir(exist_ok=True)
        np.savez(tmp_path / name, frames=light, fps=30)
    Path("frames").mkdir()
    for k in range(20):
        write_codes(Path("frames", f"{k:03d}.png"), np.rint(255 * light[k]).astype(np.uint8))
    Path("frames", "timestamps.txt").write_text("".join(f"{33_333 * k}\n" for k in range(20)))
    write_hsergb(tmp_path / "recordings" / "seq", 9)
    Path("nothing").mkdir()
    small = ("--dry-run", "--json", "--set", "clips.size=[32,24]", "--set", "samples.size=16")
    films, frames = [str(Path("films", name)) for name in ("a.npz", "b.npz")], "frames"
    for asked, videos in (("films", films), (frames, [frames]), (films[1], [films[1]]), ("recordings", [])):
        found = run(*small, "--data", asked)
        assert found.exit_code == 0, found.output
        of = json.loads(found.output)["clips"]
        assert of["video_files"] == videos and of["videos"] == len(videos)
        assert of["recording_folders"] == ([] if videos else [asked])
        if videos:
            assert json.loads(run(*small, "--validate", asked).output)["validation"]["videos"] == videos
    np.savez(tmp_path / "recordings" / "a.npz", frames=light, fps=30)
    both = run(*small[:1], *small[2:], "--data", "recordings")
    said = f"note: not used: recordings: 1 video beside its recordings; give --data {Path('recordings', 'a.npz')}, too"
    assert both.exit_code == 0 and said in both.output, both.output
    Path("recordings/a.npz").unlink()
    assert "nothing: no recordings in it; expected some of" in run(*small, "--data", "nothing").output
    (tmp_path / "deep" / "a").mkdir(parents=True)
    np.savez(tmp_path / "deep" / "a" / "a.npz", frames=light, fps=30)
    refused = run(*small, "--data", "deep")
    said = f"deep: no recordings in it; give one of the folders of clips in it, such as {Path('deep', 'a')}\n"
    assert refused.exit_code == 2 and said in refused.output
    for asked in ("nothing", "recordings"):
        refused = run(*small, "--validate", asked)
        assert refused.exit_code == 2 and f"--validate {asked}: expected a video, or a folder of v" in refused.output


def test_a_film_that_is_too_small_is_refused_before_training(tmp_path: Path) -> None:
    np.savez(tmp_path / "film.npz", frames=np.zeros((20, 24, 40, 3), np.float32), fps=30)
    shown = run("--data", "film.npz", "--dry-run")
    assert shown.exit_code == 2 and "film.npz: 40x24 pixels; expected at least 128x128" in shown.output


@pytest.mark.parametrize(("command", "option"), [
    (["train", "--dry-run", "--data"], "--set clips.fps=RATE"), (["dataset", "set", "--from"], "--fps"),
])  # fmt: skip
@pytest.mark.parametrize("stack", [False, True])
def test_pictures_without_times_are_told_of_what_there_is_here(
    tmp_path: Path, command: list[str], option: str, stack: bool
) -> None:
    (tmp_path / "clip").mkdir()
    for k in range(3):
        write_codes(tmp_path / "clip" / f"{k}.png", np.zeros((24, 40, 3), np.uint8))
    np.savez(tmp_path / "clip.npz", frames=np.zeros((3, 24, 40), np.float32))
    shown = CliRunner().invoke(main, [*command, str(tmp_path / f"clip{'.npz' * stack}")])
    assert shown.exit_code == 2 and f"without times; give {option}, or put " in shown.output


@pytest.mark.parametrize("option", ["--data", "--validate"])
def test_a_single_picture_is_no_film_to_train_with(option: str, tmp_path: Path) -> None:
    write_codes(tmp_path / "brick.png", np.zeros((200, 200, 3), np.uint8))
    shown = run(option, "brick.png", "--dry-run")
    assert shown.exit_code == 2 and "brick.png: a single picture, expected a video; leave it out" in shown.output
    assert "--motion" not in shown.output and shown.output.count("\n") == 1


def test_a_film_that_is_trained_and_validated_with_is_named(tmp_path: Path) -> None:
    """Whatever its name: by what is in it."""
    for name, light in (("film.npz", 0.2), ("copy.npz", 0.2), ("other.npz", 0.3)):
        np.savez(tmp_path / name, frames=np.full((20, 24, 40, 3), light, np.float32), fps=30)
    small = ("--dry-run", "--set", "clips.size=[32,24]", "--set", "samples.size=16", "--data", "film.npz")
    for name in ("film.npz", "copy.npz"):
        shown = run(*small, "--validate", name)
        assert shown.exit_code == 0 and shown.output.count("note: ") == 1
        assert f"note: {name} is validated with, and trained with as film.npz: its scores are better" in shown.output
    assert "note: " not in run(*small, "--validate", "other.npz").output


def test_a_damaged_curve_is_one_sentence_and_can_be_removed() -> None:
    assert run(*FEW, "-o", "run", "--session", "0.001s").exit_code == 0
    on = ("-o", "run", "--resume", "--workers", "0", "--cpu")
    Path("run/validation.csv").write_bytes(b"step,psnr\n0,\xff\n")
    damaged = run(*on)
    assert damaged.exit_code == 1 and damaged.output.count("\n") == 1
    assert f"error: {Path('run', 'validation.csv')} cannot be read as a curve: " in damaged.output
    Path("run/validation.csv").unlink()
    again = run(*on)
    assert again.exit_code == 0 and again.output.startswith("run: step 3 of 3"), again.output


def test_a_scene_that_is_too_short_is_refused_before_training(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text("[scene]\nduration_s = 0.2\n")
    shown = run("--set", 'clips.scene_names=["short.toml"]', "--dry-run")
    assert shown.exit_code == 2 and "scene short.toml lasts 0.2 s; expected 0.3 s at least" in shown.output


def write_hsergb(folder: Path, count: int) -> None:
    """A sequence in the HS-ERGB layout, of 40x24 pixels, with an event before each picture."""
    pictures, events = folder / "images_corrected", folder / "events_aligned"
    pictures.mkdir(parents=True)
    events.mkdir()
    for k in range(count):
        write_codes(pictures / f"{k:06d}.png", np.full((24, 40, 3), 10 * k, np.uint8))
        np.savez(events / f"{k:06d}.npz", x=np.zeros(1), y=np.zeros(1), t=np.array([4000 * (k + 1)]), p=np.ones(1))
    (pictures / "timestamp.txt").write_text("".join(f"{4000 * (k + 1)}\n" for k in range(count)))


def test_a_record_of_a_run_that_lacks_something_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.json").write_text('{"job": {"size": "tiny"}}')
    shown = run("--resume", "-o", "run")
    assert shown.exit_code == 1 and "run.json does not say what is trained" in shown.output


def test_training_without_its_extra_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from interp.train import machines

    found: Any = machines.find_spec
    monkeypatch.setattr(machines, "find_spec", lambda name: None if name == "lightning" else found(name))
    shown = run(*FEW)
    assert shown.exit_code == 2 and "pip install 'vid2ev[train]'" in shown.output


def test_a_run_may_lie_in_the_folder_that_it_learns_from() -> None:
    write_hsergb(Path("data", "long"), 9)
    small = ("--set", "clips.size=[32,24]", "--set", "samples.size=16")
    begun = run(*FEW, *small, "--data", "data", "-o", "data/run", "--session", "0.001s")
    assert begun.exit_code == 0 and "data/run: step 1 of 3; the same command with --resume" in begun.output
    again = run("-o", "data/run", "--resume", "--workers", "0", "--cpu")
    assert again.exit_code == 0 and "data/run: step 3 of 3\n" in again.output
