"""Training killed at any moment goes on to the very same bits."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import small_run
import torch
from safetensors.torch import load_file
from small_run import STEPS_OF_RUN, in_a_process, kept, session

from interp.train.curves import read_curve

TOO_FAST, BEST = {"rate": 2e-4, "warm_up": 0, "clip": 100.0, "validations": STEPS_OF_RUN}, 3

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run, in one go."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    assert session(folder).finished
    return folder


def same(folder: Path, other: Path) -> bool:
    one, two = kept(folder), kept(other)
    return one.keys() == two.keys() and all(torch.equal(one[name], two[name]) for name in one)


def test_a_run_killed_at_a_step_goes_on_to_the_same_bits(undisturbed: Path, tmp_path: Path) -> None:
    step = random.Random(5).randrange(3, STEPS_OF_RUN)
    killed = in_a_process(tmp_path / "run", killed_at_step=step)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    shutil.move(tmp_path / "run", tmp_path / "carried")  # to another place
    assert session(tmp_path / "carried", resume=True).finished
    assert same(tmp_path / "carried", undisturbed)
    weights = [load_file(folder / "weights.safetensors") for folder in (undisturbed, tmp_path / "carried")]
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[0])
    curves = [
        [(row["step"], row["loss"], row["gradient"]) for row in read_curve(folder / "training.csv")]
        for folder in (undisturbed, tmp_path / "carried")
    ]
    assert curves[0] == curves[1]


def test_pieces_of_a_step_each_are_the_run_in_one_go(undisturbed: Path, tmp_path: Path) -> None:
    pieces = 0
    while not (done := session(tmp_path / "run", resume=pieces > 0, session_s=1e-9)).finished:
        pieces += 1
        assert done.step == pieces and not done.scores
    assert pieces == STEPS_OF_RUN - 1
    assert same(tmp_path / "run", undisturbed)
    assert session(tmp_path / "run", resume=True).scores == done.scores  # what is finished stays so


def test_samples_may_be_made_by_others(undisturbed: Path, tmp_path: Path) -> None:
    session(tmp_path / "run", workers=2, session_s=1e-9)
    session(tmp_path / "run", workers=1, resume=True)
    assert same(tmp_path / "run", undisturbed)


@pytest.fixture(scope="module")
def best_early(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that validates after each step and is best at one in the middle."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("best_early") / "run"
    assert session(folder, **TOO_FAST).best == BEST
    return folder


@pytest.mark.parametrize("step", [BEST - 1, BEST])
@pytest.mark.parametrize("killed", [False, True])
def test_what_was_best_stays_so_where_a_session_ends_with_a_validation(
    best_early: Path, tmp_path: Path, step: int, killed: bool
) -> None:
    """Stopped after its step, which it is the validation of, or killed in the midst of it."""
    folder = tmp_path / "run"
    if killed:
        died = in_a_process(folder, killed_at_validation=step, **TOO_FAST)
        assert died.returncode == -signal.SIGKILL, died.stderr
    else:
        stop = iter([*[False] * (step - 1), True]).__next__
        assert session(folder, stop=stop, **TOO_FAST).step == step
    assert session(folder, resume=True, **TOO_FAST).best == BEST
    assert same(folder, best_early)
    for name in ("weights.safetensors", "validation.csv"):
        assert (folder / name).read_bytes() == (best_early / name).read_bytes(), name


@pytest.mark.slow
def test_a_run_killed_at_whatever_lasts_goes_on_to_the_same_bits(undisturbed: Path, tmp_path: Path) -> None:
    writes = int(in_a_process(tmp_path / "counted").stdout.split()[1])
    for write in sorted(random.Random(6).sample(range(2, writes), 12)):
        folder = tmp_path / f"run-{write}"
        killed = in_a_process(folder, killed_at_write=write)
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        begun = (folder / "run.json").exists()  # (killed before that, there is nothing to go on with)
        assert session(folder, resume=begun).finished
        assert same(folder, undisturbed), write


@pytest.mark.parametrize("devices", [1, 2])
def test_a_run_whose_processes_are_all_asked_to_end_does_so_after_a_step(tmp_path: Path, devices: int) -> None:
    """As by a cluster; wherever each of them, and of those that make samples, is just then."""
    folder = tmp_path / "run"
    for _ in range(3):
        begun = (folder / "checkpoint.ckpt").exists()
        before = kept_step(folder) if begun else 0
        command = [sys.executable, small_run.__file__, str(folder), f"resume={int(begun)}", "asked=1", "steps=100000"]
        run = subprocess.Popen(
            [*command, f"devices={devices}", "workers=1"], start_new_session=True, stderr=subprocess.PIPE
        )
        try:
            while run.poll() is None and not ((folder / "checkpoint.ckpt").exists() and kept_step(folder) > before + 2):
                time.sleep(0.05)
            os.killpg(run.pid, signal.SIGTERM)
            _, said = run.communicate(timeout=120)
        finally:
            run.kill()
        assert run.returncode == 0 and kept_step(folder) > before + 2, said


def kept_step(folder: Path) -> int:
    return torch.load(folder / "checkpoint.ckpt", weights_only=True)["global_step"]
