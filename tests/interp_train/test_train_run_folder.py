"""What a run's folder says of steps is what was planned, or one sentence."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from interp import weights
from interp.networks import make
from interp.train.run_folder import RunFolder
from interp.train.schedule import Steps
from interp.train.scores import Scores
from vid2ev.errors import DataError


@pytest.fixture
def folder(tmp_path: Path) -> Any:
    opened = RunFolder(tmp_path / "run", {}, resume=False)
    yield opened
    opened.close()


def test_plans_are_kept(folder: RunFolder) -> None:
    assert folder.steps() is None
    for steps in (Steps(((7, 7),), 1), Steps(((30, 400), (90, 310), (200, 640)), 40)):
        folder.plan(steps)
        assert folder.steps() == steps


@pytest.mark.parametrize(
    "said",
    [
        {},
        {"steps": 300, "level": 20},
        {"plans": [], "validate_every": 30},
        {"plans": [[20, 300]], "validate_every": 0},
        {"plans": [[20, 300.5]], "validate_every": 30},
        {"plans": [[20, 300, 1]], "validate_every": 30},
        {"plans": [[20, 10]], "validate_every": 30},
        {"plans": [[-1, 10]], "validate_every": 30},
        {"plans": [[0, 0]], "validate_every": 30},
        {"plans": [[20, 300], [20, 400]], "validate_every": 30},
        {"plans": [[20, 1 << 40]], "validate_every": 30},
        {"plans": 3, "validate_every": 30},
    ],
)
def test_what_is_no_plan_is_one_sentence(folder: RunFolder, said: Any) -> None:
    (folder.path / "steps.json").write_text(json.dumps(said))
    with pytest.raises(DataError, match=r"steps\.json ") as error:
        folder.steps()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "said",
    [
        {"linear": {"scenes": {"psnr": 30.0}}},
        {"linear": {"scenes": {"psnr": 30.0, "ssim": 1, "moving": None, "static": 30.0, "epe": 1}}},
        {"linear": {"scenes": {"psnr": "x", "ssim": 1, "moving": None, "static": 30.0}}},
        {"linear": {"videos": {"psnr": 30.0, "ssim": 1, "moving": None, "static": 30.0}}},
        {"linear": {"scenes": 3}},
        {"linear": {}},
        {"linear": None},
        [],
        None,
    ],
)
def test_what_is_no_scores_of_these_clips_is_one_sentence(folder: RunFolder, said: Any) -> None:
    """Also what is cut short: whatever it is, it can be measured again."""
    (folder.path / "baselines.json").write_text(json.dumps(said) if said is not None else '{"linear": {"sc')
    with pytest.raises(DataError, match=r"baselines\.json .*; remove it, and --resume makes it again$") as error:
        folder.baselines(["scenes", "scenes"])
    assert "\n" not in str(error.value)


def test_how_a_run_came_out_can_be_found_again(folder: RunFolder) -> None:
    folder.finish({"step": 7})
    (folder.path / "finished.json").write_text('{"ste')
    with pytest.raises(DataError, match=r"finished\.json cannot be read; remove it, and --resume makes it again$"):
        folder.finished()


@pytest.mark.parametrize("whole", [True, False])
def test_weights_that_were_damaged_are_no_result(folder: RunFolder, whole: bool) -> None:
    weights.save(folder.weights, "firenet", make("firenet"))
    if whole:
        return folder.check_weights()
    for length in (folder.weights.stat().st_size // 2, 0):
        os.truncate(folder.weights, length)
        with pytest.raises(DataError, match=r"weights\.safetensors is damaged; .* and --resume"):
            folder.check_weights()


@pytest.mark.parametrize("moving", [30.0, math.nan])
def test_scores_are_kept(folder: RunFolder, moving: float) -> None:
    assert folder.baselines(["scenes"]) == {}
    kept = {"linear": {"scenes": Scores(30.0, 0.5, moving, 31.0), "videos": Scores(1.0, 0.0, 2.0, moving)}}
    folder.write_baselines({name: {group: asdict(one) for group, one in of.items()} for name, of in kept.items()})
    assert repr(folder.baselines(["scenes", "videos"])) == repr(kept)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("steps.json", lambda folder: folder.plan(Steps(((7, 7),), 1))),
        ("baselines.json", lambda folder: folder.write_baselines({"linear": {"scenes": {"psnr": 30.0}}})),
        ("finished.json", lambda folder: folder.finish({"step": 7})),
    ],
)
def test_what_the_disk_does_not_take_is_one_sentence(
    name: str, kept: Callable[[RunFolder], None], folder: RunFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(DataError, match=rf"{name} cannot be written: No space left on device; make room"):
        kept(folder)
    assert not (folder.path / name).exists()
