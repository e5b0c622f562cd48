"""What programs keep to go on from: checkpoints, journals, caches; and the recordings that they wrote."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Seeds = Callable[[Path], list[Path]]
CLIP = "synthetic:moving-edge,size=16x12,fps=100,duration_s=0.08"
OPTIONS: dict[str, Any] = {
    "overrides": ["shot_rate_hz=20", "frame_rate_hz=900"], "threads": 1, "piece": 3 << 18, "formats": ["evt3", "csv"],
    "labels": True, "probe": ["5,5"],
}  # fmt: skip
RIG = """
[[camera]]
name = "left"
kind = "dvs"
[[camera]]
name = "slow"
kind = "cis"
set = { frame_rate_hz = 30, exposure_us = 2000 }
[[camera]]
name = "fast"
kind = "cis"
set = { frame_rate_hz = 90, exposure_us = 1000, line_us = 20 }
"""


class Stopped(Exception):
    """As a kill."""


def _stop_at(last: int) -> Callable[..., None]:
    count = [0]

    def report(*_: object) -> None:
        count[0] += 1
        if count[0] == last:
            raise Stopped

    return report


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "lock")


def _begun_recording(folder: Path) -> list[Path]:
    from vid2ev import convert
    from vid2ev.tracks import dvs

    dvs.plot = lambda *_: None  # (half a second for a picture of what was read)
    (folder / "rig.toml").write_text(RIG)
    for name, options in (("one", OPTIONS), ("rig", _rig_options(folder))):
        try:
            convert(CLIP, folder / name, report=_stop_at(6), **options)
        except Stopped:
            shutil.copytree(folder / f"{name}.partial", folder / "kept" / f"{name}.partial")
    paths = [folder / "kept" / "one.partial" / "checkpoint.npz", folder / "kept" / "rig.partial" / "checkpoint.npz"]
    return [*paths, folder / "kept" / "one.partial" / "job.json"]


def _rig_options(folder: Path) -> dict[str, Any]:
    return {"rig": folder / "rig.toml", "threads": 1, "piece": 3 << 18, "formats": ["evt3"], "pictures": "raw"}


def _resume_recording(path: Path) -> None:
    from vid2ev import convert

    folder, name = path.parents[2], path.parent.name.partition(".")[0]
    shutil.rmtree(folder / f"{name}.partial", ignore_errors=True)
    shutil.rmtree(folder / name, ignore_errors=True)
    shutil.copytree(path.parent, folder / f"{name}.partial")
    convert(CLIP, folder / name, resume=True, **(OPTIONS if name == "one" else _rig_options(folder)))


def _begun_dataset(folder: Path) -> list[Path]:
    import json
    from functools import cache

    from interp.data import dataset
    from vid2ev.recording.manifest import versions

    job = {"versions": versions(), "spec": _dataset_spec().model_dump(mode="json")}
    facts = {"made": 1, "disparity_mm": 3.5, "of_scenes": {"a": {"frames": 3}}, "left_out": {}}
    for name, said in (("begun.partial/job", job), ("done/dataset", job | facts)):
        (folder / name).parent.mkdir()
        (folder / f"{name}.json").write_text(json.dumps(said, indent=2))
    dataset.scenes_of = cache(dataset.scenes_of)  # (the same each time)
    dataset._all = lambda *_: iter([dataset.Made("a", {}, "not made here")])
    return [folder / "begun.partial" / "job.json", folder / "done" / "dataset.json"]


def _dataset_spec() -> Any:
    from interp.data.dataset_spec import DatasetSpec

    return DatasetSpec(count=1, size=(16, 12), frames=3)


def _resume_dataset(path: Path) -> None:
    from interp.data.dataset import write_dataset
    from vid2ev.errors import DataError

    try:
        write_dataset(path.parent.with_suffix(""), _dataset_spec(), resume=True)
    except DataError as error:
        if "not made here" not in str(error):
            raise


def _begun_frames(folder: Path) -> list[Path]:
    from functools import cache

    from interp.interpolate import after
    from interp.interpolate.whole import interpolate
    from interp.networks import make
    from interp.weights import save
    from vid2ev.recording.exposures import write_codes

    after.load = cache(after.load)  # (the weights are the same each time)
    (folder / "in").mkdir()
    draw = np.random.default_rng(0).integers(0, 256, (12, 40, 3), np.uint8)
    for k in range(6):
        write_codes(folder / "in" / f"{k:06d}.png", draw[:, k : k + 16])
    (folder / "in" / "timestamps.txt").write_text("# us\n" + "".join(f"{33_333 * k}\n" for k in range(6)))
    save(folder / "hdr.safetensors", "hdr", make("hdr", second="frames"))
    try:
        interpolate(folder / "in", folder / "out", report=_stop_at(7), **_frame_options(folder))
    except Stopped:
        shutil.copytree(folder / "out.partial", folder / "kept")
    return [path for path in _files(folder / "kept") if path.suffix != ".png"]


def _frame_options(folder: Path) -> dict[str, Any]:
    return {"multiple": 2, "method": "linear", "hdr": folder / "hdr.safetensors"}


def _resume_frames(path: Path) -> None:
    from interp.interpolate.whole import interpolate

    folder = path.parents[1]
    for name in ("out", "out.partial"):
        shutil.rmtree(folder / name, ignore_errors=True)
    shutil.copytree(path.parent, folder / "out.partial")
    interpolate(folder / "in", folder / "out", resume=True, **_frame_options(folder))


def _begun_evaluation(folder: Path) -> list[Path]:
    from dataclasses import fields

    from interp.evaluate.kept import Kept
    from interp.evaluate.row import Row

    values: dict[str, Any] = {"str": "a", "int": 3, "float": 0.5}
    row = Row(**{each.name: values.get(str(each.type).split(" ")[0], 0.5) for each in fields(Row)})
    with Kept(folder / "eval", {"limit": 3}, {"linear": {"a": 1}}, resume=False) as kept:
        for group in range(3):
            kept.add("film", "linear", group, [row, row])
        kept.finish("film", {"groups": 3, "missing": {"linear": 0}, "unfit": {"linear": {}}})
    return _files(folder / "eval")


def _resume_evaluation(path: Path) -> None:
    from interp.evaluate.kept import Kept

    folder = next(parent for parent in path.parents if parent.name == "eval")
    with Kept(folder, {"limit": 3}, {"linear": {"a": 1}}, resume=True) as kept:
        for rows in kept.rows("film", "linear").values():
            assert all(isinstance(row.sequence, str) for row in rows)
        about = kept.about("film")
        assert about is None or "linear" not in about["missing"] or int(about["groups"]) >= 0


def _begun_training(folder: Path) -> list[Path]:
    import json

    import torch

    from interp.train.job import Job

    made = folder / "run"
    made.mkdir()
    learner = _learner()
    optimizer = torch.optim.AdamW(learner.parameters())
    sum(weight.sum() for weight in learner.parameters()).backward()
    optimizer.step()
    state = {
        "global_step": 5, "epoch": 0, "state_dict": learner.state_dict(), "optimizer_states": [optimizer.state_dict()],
        "skipped": [0, 0], "validation_s": 0.1,
    }  # fmt: skip
    torch.save(state, made / "checkpoint.ckpt")
    job = Job.of("firenet", settings=["steps=3"]).model_dump(mode="json")
    (made / "run.json").write_text(json.dumps({"job": job, "versions": {}, "machine": {}}))
    (made / "steps.json").write_text(json.dumps({"steps": 30, "level": 2}))
    score = {"psnr": 20.0, "ssim": 0.5}
    (made / "baselines.json").write_text(json.dumps({"linear": {"scenes": score}}))
    return _files(made)


def _learner() -> Any:
    import torch

    return torch.nn.Sequential(torch.nn.Linear(3, 2), torch.nn.Conv2d(1, 2, 3))


def _resume_training(path: Path) -> None:
    from interp.train.checkpoints import read_checkpoint
    from interp.train.run_folder import RunFolder, begun_job

    folder = path.parent
    begun_job(folder)
    run = RunFolder(folder, begun_job(folder), resume=True)
    try:
        run.fixed()
        run.baselines()
    finally:
        run.close()
    read_checkpoint(run.checkpoint)


def _clips(folder: Path) -> list[Path]:
    from interp.data.clip import Clip, write_clip

    draw = np.random.default_rng(0)
    truth, keys = (draw.integers(0, 256, (count, 8, 8, 3), np.uint8) for count in (5, 2))
    off_on = draw.integers(0, 4, (2, 8, 8, 8)).astype(np.float16)
    clip = Clip(truth, keys, off_on, (0.2, 0.2), 33_333, {"scene": "x"})
    write_clip(folder / "clip.npy", clip)
    return [folder / "clip.npy"]


def _read_clip(path: Path) -> None:
    from interp.data.clip import read_clip

    clip = read_clip(path)
    sum(float(part.sum(dtype=float)) for part in (clip.truth, clip.keys, clip.off_on))
    assert clip.multiple >= 1 and clip.coarser >= 1 and clip.about is not None


def _recordings(folder: Path) -> list[Path]:
    from interp.data.layouts.own import Own
    from interp.data.layouts.writing import write_sequence
    from vid2ev import convert

    (folder / "rig.toml").write_text(RIG)
    clip = "synthetic:moving-edge,size=16x12,fps=100,duration_s=0.2"
    options = {"rig": folder / "rig.toml", "threads": 1, "formats": ["npz"], "pictures": "png"}
    convert(clip, folder / "own", preview=False, **options)
    write_sequence(Own(folder / "own"), folder / "hs", "hsergb")
    kinds = {".json", ".txt", ".toml", ".npz"}
    found = [path for name in ("own", "hs") for path in _files(folder / name) if path.suffix in kinds]
    return [path for path in found if path.suffix != ".npz" or path.stem in ("events", "000001")]


def _read_recording(path: Path) -> None:
    from interp.data.layouts import open_sequence, windows
    from interp.evaluate.cameras import CamerasOf

    folder = next(parent for parent in path.parents if parent.name in ("own", "hs"))
    sequence = open_sequence(folder)
    windows(sequence, 2)
    last = min(1, len(sequence.times_us) - 1)
    sequence.frame(last)
    sequence.key(last)
    start_us, stop_us = sequence.covered_us
    sequence.events(start_us, stop_us).within(sequence.event_size)
    if folder.name == "own":
        CamerasOf(sequence).at(start_us, (0, 0))  # type: ignore[arg-type]


READERS: dict[str, tuple[Seeds, Callable[[Path], object]]] = {
    "saved-recording": (_begun_recording, _resume_recording),
    "saved-dataset": (_begun_dataset, _resume_dataset),
    "saved-frames": (_begun_frames, _resume_frames),
    "saved-evaluation": (_begun_evaluation, _resume_evaluation),
    "saved-training": (_begun_training, _resume_training),
    "clips": (_clips, _read_clip),
    "recordings": (_recordings, _read_recording),
}
