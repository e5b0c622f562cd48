"""What is asked for becomes one record, that a run keeps; what cannot be meant is refused in a sentence."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
import torch
from pydantic import ValidationError

from interp.data.inputs import known_by
from interp.data.pool import Pool
from interp.networks import make, names
from interp.networks.event_fed import EventFed
from interp.train.job import EVENT_FED, Job
from interp.train.made_of import validation_of
from interp.train.recipe import Recipe
from vid2ev.errors import UsageError


@pytest.mark.parametrize("network", names())
def test_a_job_comes_back_from_its_json(network: str) -> None:
    job = Job.of(
        network, "small", ["rate=.002", "clips.scenes=1", "samples.size=64", "window.begin=8", "validation.clips=2"]
    )
    assert Job(**json.loads(json.dumps(job.model_dump(mode="json")))) == job
    assert (job.recipe.rate, job.clips.scenes, job.samples.size, job.window.begin) == (0.002, 1, 64, 8)


def test_networks_of_events_are_trained_as_such() -> None:
    assert [name for name in names() if isinstance(make(name), EventFed)] == [*EVENT_FED]


def test_settings_reach_what_they_are_of() -> None:
    job = Job.of("rrin-events", settings=["network.bins=3", "betas=[0.8, 0.95]", "precision=bf16"])
    assert job.network == "rrin_events" and job.options == {"bins": 3}
    assert job.recipe.betas == (0.8, 0.95) and job.recipe.precision == "bf16"
    videos = Job.of("rrin", videos=["a.mp4", "b.mp4"], recordings=["c"])
    assert videos.clips.shares == (0, 0, 2, 1)
    assert videos.clips.video_files == ("a.mp4", "b.mp4") and videos.clips.recording_folders == ("c",)
    assert Job.of("hdr").clips.light == "linear"
    assert Job.of("firenet").recipe.rate < Job.of("rrin").recipe.rate


@pytest.mark.parametrize(
    ("network", "settings", "sentence"),
    [
        ("rrin_event", [], r"network 'rrin_event' \(did you mean rrin_events\?\): expected one of superslomo"),
        ("rrin", ["rate"], "Setting 'rate' is not of the form key=value; write for example rate=0.001"),
        ("rrin", ["rat=1"], r"setting 'rat' is unknown \(did you mean rate\?\); expected one of seed"),
        ("rrin", ["rate=-1"], r"setting rate = -1 is impossible: it must be greater than 0"),
        ("rrin", ["rate=fast"], r"setting rate = 'fast' is impossible: it must be a valid number"),
        ("rrin", ["rate=nan"], r"setting rate = nan is impossible: it must be a finite number"),
        ("rrin", ["net.bins=1"], r"setting 'net.bins=1': 'net' has no settings \(did you mean network\?\)"),
        ("rrin", ["network.bin=1"], r"rrin has no option 'bin' \(did you mean bins\?\)"),
        ("rrin", ["clips.multiples=[5]"], r"settings of clips: multiples \(5,\): expected some of 4, 8, 16, 32"),
        ("rrin", ["clips.sensors.threshold=1"], r"clips.sensors.threshold = 1 is impossible: it must be a list"),
        ("rrin", ["samples.size=3"], r"setting samples.size = 3 is impossible: it must be greater than or equal to 16"),
        ("rrin", ["window.begin=0"], r"setting window.begin = 0 is impossible"),
        ("rrin", ["window.fresh=inf"], r"setting window.fresh = inf is impossible"),
        ("rrin", ["window.fresh=1e307"], r"window.fresh = 1e\+307 is impossible: it must be less than or equal to"),
        ("rrin", ["network.depths=[5, 4]"], r"depths = \[5, 4\] is impossible: it has too few values"),
        ("rrin", ["clips.motion=[[1, 2]]"], r"clips.motion.0.2 = \[1, 2\] is impossible: it has too few values"),
        ("rrin", ["threads=3000000000"], r"threads = 3000000000 is impossible: it must be less than or equal to 1024"),
        ("rrin", ["batch=true"], r"setting batch=true is impossible: true and false are no numbers"),
        ("rrin", ["clips.motion=[[true, 1, 2]]"], r"true and false are no numbers"),
        ("rrin", ["clips.sensors={exposed=true}"], r"true and false are no numbers"),
        ("rrin", ["network.bins=true"], r"bins = True is impossible"),
        ("rrin_events_guided", ["network.transfer=linear"], r"transfer = 'linear': frames to learn from are sRGB"),
        ("rrin", ["clips.motion=[[nan, 1, 2]]"], r"nan is impossible: it must be a finite number"),
        ("rrin", ["clips.motion=[[2, 1, 2], [-1, 3, 4]]"], r"clips.motion.1.0 = -1 is impossible"),
        ("rrin", ["clips.slowdown=1e-300"], r"clips.slowdown = 1e-300 is impossible: it must be greater than or equal"),
        ("rrin", ["clips.step_px=inf"], r"inf is impossible: it must be a finite number"),
        ("rrin", ["samples.lost=[0.5, 2]"], r"range 0.5 to 2: expected both ends 0, or from 1e-12 to 1"),
        ("rrin", ["samples.threshold_error=[0, 1]"], r"range 0 to 1: expected both ends from 0.01 to 100"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_a_sentence(network: str, settings: list[str], sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence) as error:
        Job.of(network, settings=settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("bits", ["32", "16"])
def test_a_precision_may_be_written_as_a_number(bits: str) -> None:
    for said in (bits, f'"{bits}"'):
        assert Job.of("rrin", settings=[f"precision={said}"]).recipe.precision == bits
    with pytest.raises(UsageError, match="precision = '8' is impossible: it must be 'auto', '32', 'bf16' or '16'"):
        Job.of("rrin", settings=["precision=8"])


def test_every_number_of_the_recipe_says_what_it_is_and_stays() -> None:
    assert all(field.description for field in Recipe.model_fields.values())
    with pytest.raises(ValidationError):
        Recipe().rate = 1.0  # type: ignore[misc]
    with pytest.raises(ValidationError, match="less than"):
        Recipe(seed=1 << 63)  # (TOML has no greater ones)


def test_a_job_is_known_by_what_is_in_the_files_that_it_names(tmp_path: Path) -> None:
    """Not by where they lie in time: copies with another time of change are the same."""
    (tmp_path / "frames").mkdir()
    files = [tmp_path / "a.npz", tmp_path / "frames" / "1.png", tmp_path / "frames" / "2.png", tmp_path / "seen.npz"]
    for file in files:
        file.write_bytes(bytes(100_000))
    job = Job.of(videos=[str(files[0]), str(tmp_path / "frames")], validation_videos=[str(files[3])])
    known, clips = job.kept(), known_by(job.clips)
    assert set(known["inputs"]) == {str(files[0]), str(tmp_path / "frames"), str(files[3])}
    assert Job(**known).kept() == known
    os.utime(files[0], (0, 0))
    assert (job.kept(), known_by(job.clips)) == (known, clips)
    for file in files:
        file.write_bytes(bytes(99_999) + b"1")
        assert job.kept() != known and (known_by(job.clips) != clips or file == files[3])
        known, clips = job.kept(), known_by(job.clips)
    assert "inputs" not in Job.of().kept()


def test_clips_have_the_name_that_they_have_whatever_their_run_writes_beside_its_data(tmp_path: Path) -> None:
    """Processes that train look at different moments for them, and later sessions do."""
    film, run = tmp_path / "frames", tmp_path / "frames" / "run"
    film.mkdir()
    (film / "1.png").write_bytes(bytes(1000))
    job = Job.of(videos=[str(film)])
    names = []
    for _ in range(2):
        names.append((Pool(run / "clips", job.clips, 0, besides=[run]).folder.name, job.kept([run])))
        (run / "steps.json").write_text("{}")
    assert names[0] == names[1]


def test_a_scene_of_one_s_own_is_known_by_what_is_in_it_and_in_the_meshes_that_it_names(tmp_path: Path) -> None:
    scene, mesh = tmp_path / "mine.toml", tmp_path / "wing.obj"
    mesh.write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n")
    scene.write_text('[[objects]]\nname = "wing"\nkind = "mesh"\nfile = "wing.obj"\ntexture = "cat"\n')
    job = Job.of(settings=[f'clips.scene_names=["room", "{scene}"]'])
    known, clips = job.kept(), known_by(job.clips)
    assert set(known["inputs"]) == {str(scene), str(mesh)}
    for file in (scene, mesh):
        file.write_text(file.read_text() + "# once more\n")
        assert job.kept() != known and known_by(job.clips) != clips
        known, clips = job.kept(), known_by(job.clips)


def test_what_comes_with_vid2ev_is_no_file_whatever_lies_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    before = known_by(Job.of().clips)
    for name in (*Job.of().clips.textures, *Job.of().clips.scene_names):
        Path(name).mkdir()
        Path(name, "holiday.jpg").touch()
    assert "inputs" not in Job.of().kept() and known_by(Job.of().clips) == before


def test_clips_to_validate_with_are_those_of_the_job_whatever_others_have_left(tmp_path: Path) -> None:
    small = ["clips.scenes=0.0", "clips.multiples=[4]", "clips.coarser=[2]"]
    for clips, side in ((1, 32), (2, 32), (2, 48)):
        job = Job.of(settings=[*small, f"clips.size=[{side}, {side}]", f"validation.clips={clips}"])
        for _ in range(2):  # (made, and found again)
            sizes = [batch["truth"].shape[-2:] for _, batch in validation_of(job, tmp_path)]
            assert sizes == [(side, side)] * 2 * clips


def damage(clips: list[Path], whole: Path) -> None:
    clips[0].write_bytes(clips[0].read_bytes()[:200])


def empty(clips: list[Path], whole: Path) -> None:
    clips[1].write_bytes(b"")


def lose(clips: list[Path], whole: Path) -> None:
    clips[1].unlink()


def say_nothing(clips: list[Path], whole: Path) -> None:
    whole.write_bytes(b"")
    clips[0].write_bytes(clips[1].read_bytes())


@pytest.mark.parametrize("crash", [damage, empty, lose, say_nothing])
def test_clips_to_validate_with_are_all_there_after_a_crash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, crash: Any
) -> None:
    small = ["clips.scenes=0.0", "clips.multiples=[4]", "clips.size=[32, 32]", "validation.clips=2"]
    monkeypatch.setattr("interp.train.made_of.MEASURED_WITH", ("clean",))
    synced: list[str] = []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(os.readlink(f"/proc/self/fd/{handle}")))
    before = validation_of(Job.of(settings=small), tmp_path)
    (cache,) = tmp_path.iterdir()
    clips, whole = sorted(cache.glob("*.npy")), cache / "whole"
    assert synced == [*map(str, [*clips, cache, whole])]
    crash(clips, whole)
    again = validation_of(Job.of(settings=small), tmp_path)
    assert len(before) == len(again) == 2
    for (_, one), (_, other) in zip(before, again, strict=True):
        assert torch.equal(one["truth"], other["truth"]) and torch.equal(one["off_on"], other["off_on"])
    assert [path.name for path in sorted(cache.iterdir())] == ["0000.npy", "0001.npy", "whole"]
