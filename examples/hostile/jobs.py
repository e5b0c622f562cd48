"""Small jobs of every command that makes something that lasts, as functions of a folder: `made(folder, resume)`.

Each takes a second or two, and has a state to go on from at several points.  `contents` is what must be the same.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parents[2] / "tests"
CLIP = "synthetic:moving-edge,size=48x32,fps=100,duration_s=0.16"
OPTIONS: dict[str, Any] = {
    "overrides": ["shot_rate_hz=20", "hot_probability=0.01", "frame_rate_hz=900"], "upsample": "linear", "subframes": 2,
    "labels": True, "piece": 3 << 18, "threads": 1, "probe": ["20,16"], "formats": ["hdf5", "evt3"],
}  # fmt: skip
FEW: dict[str, Any] = {"count": 2, "frames": 2, "cis_fps": 10.0}


@dataclass(frozen=True)
class Job:
    """What is killed.

    prepare   makes what the job needs in a folder, once
    make      makes the output in the place given, or goes on with it; the first argument is the prepared folder
    growing   the files in there that grow without being renamed: their last block may be torn
    old       makes another output in that place, which is to be replaced; None where nothing is ever replaced
    """

    prepare: Callable[[Path], None]
    make: Callable[[Path, Path, bool], object]
    growing: tuple[str, ...]
    old: Callable[[Path, Path], object] | None = None


def contents(path: Path) -> dict[str, bytes]:
    """All files of an output but the lock, without what says when and where they were made."""
    return {
        file.relative_to(path).as_posix(): _lasting(file)
        for file in sorted(path.rglob("*"))
        if file.is_file() and file.name != "lock"
    }


def _lasting(file: Path) -> bytes:
    if file.name in ("manifest.json", "frames.json", "run.json"):
        said = json.loads(file.read_text())
        return json.dumps({key: value for key, value in said.items() if key not in ("run", "machine")}).encode()
    return file.read_bytes()


def _convert(_: Path, out: Path, resume: bool) -> None:
    from vid2ev import convert

    convert(CLIP, out, resume=resume, overwrite=out.exists(), **OPTIONS)


def _old_recording(_: Path, out: Path) -> None:
    from vid2ev import convert

    convert(CLIP, out, seed=9, **OPTIONS)


def _prepare_dataset(folder: Path) -> None:
    from footage_made import pictures, write_film

    write_film(folder / "film" / "film.npz", pictures(30), fps=25)


def _dataset(folder: Path, out: Path, resume: bool) -> None:
    from interp.data.dataset import write_dataset
    from interp.data.dataset_spec import DatasetSpec

    write_dataset(out, DatasetSpec(videos=(str(folder / "film" / "film.npz"),), **FEW), resume=resume)


def _train(_: Path, out: Path, resume: bool) -> None:
    import small_run

    small_run.session(out, (out / "run.json").exists(), network={"depths": (2, 2, 2, 2)}, steps=6)


def _prepare_eval(folder: Path) -> None:
    from footage_made import pictures, write_hsergb

    for seed, name in enumerate("ab"):
        write_hsergb(folder / "data" / name, pictures(12, seed))


def _eval(folder: Path, out: Path, resume: bool) -> None:
    from interp.evaluate.protocol import Protocol
    from interp.evaluate.run import evaluate

    evaluate([str(folder / "data")], out, baselines=("linear", "bridge"), protocol=Protocol(3, 3), resume=resume)


def _prepare_interpolate(folder: Path) -> None:
    from small_takes import moving, recording

    from interp.networks import make
    from interp.weights import save

    recording(folder / "in", moving(8))
    save(folder / "firenet.safetensors", "firenet", make("firenet"))


def _interpolate(folder: Path, out: Path, resume: bool) -> None:
    from interp.interpolate.whole import interpolate

    there = out.exists()
    interpolate(folder / "in", out, multiple=3, network=folder / "firenet.safetensors", resume=resume, overwrite=there)


def _old_frames(folder: Path, out: Path) -> None:
    from interp.interpolate.whole import interpolate

    interpolate(folder / "in", out, multiple=2, method="linear")


def _nothing(_: Path) -> None:
    pass


JOBS: dict[str, Job] = {
    "convert": Job(_nothing, _convert, ("t", "x", "y", "p", "label", "probe.csv", "frame_us"), _old_recording),
    "dataset": Job(_prepare_dataset, _dataset, ("t", "x", "y", "p", "frame_us", "timestamps.txt")),
    "train": Job(_nothing, _train, ("training.csv",)),
    "eval": Job(_prepare_eval, _eval, ("linear.jsonl", "bridge.jsonl")),
    "interpolate": Job(_prepare_interpolate, _interpolate, ("done.jsonl",), _old_frames),
}


def ready() -> None:
    """Make it possible to import what the jobs share with the tests; one thread."""
    import cv2
    import torch

    sys.path[:0] = [str(TESTS / name) for name in ("interp_train", "interp_evaluate", "interp_interpolate")]
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
