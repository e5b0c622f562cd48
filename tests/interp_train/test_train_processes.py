"""Two processes that share the batches learn what one does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch
from small_run import in_a_process, kept, session

from interp.data.pool import Pool
from interp.data.settings import ClipSettings
from interp.train.machines import Machines
from interp.train.run_folder import RunFolder
from vid2ev.errors import UsageError

pytestmark = pytest.mark.long


def test_two_processes_learn_what_one_does(tmp_path: Path) -> None:
    session(tmp_path / "one", steps=3, groups=2)
    shared = in_a_process(tmp_path / "two", devices=2, steps=3, groups=2)
    assert shared.returncode == 0, shared.stderr
    pictured = [{path.name for path in (tmp_path / run / "pictures").iterdir()} for run in ("one", "two")]
    assert pictured[0] == pictured[1] and len(pictured[0]) == 2 * len({name[:12] for name in pictured[0]})
    one, two = kept(tmp_path / "one"), kept(tmp_path / "two")
    assert one.keys() == two.keys()
    moved = 0
    for name in one:
        if name.startswith("current."):
            # A mean over 4 samples, or of two means over 2, differs in the last bits.  AdamW divides by the gradient's
            # own size: where that is near 0 the sign of a step may change, and steps are at most 1.5e-3 long.
            apart = (one[name] - two[name]).abs()
            assert float(apart.max()) < 2 * 1.5e-3 * 3
            assert float(apart.mean()) < 2e-6, name
            moved += 1
    assert moved


def test_batches_that_cannot_be_shared_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"batches of 3 cannot be shared out evenly among 2 processes"):
        from types import SimpleNamespace

        from interp.train.batches import Feed

        feed = Feed([], [], 3, 0)  # type: ignore[arg-type]
        feed.trainer = SimpleNamespace(world_size=2)  # type: ignore[assignment]
        feed.train_dataloader()


@pytest.mark.parametrize(
    ("asked", "nodes", "cpu", "gpus", "found"),
    [
        ("auto", 1, False, 0, (2, "cpu")),
        ("auto", 2, False, 8, (8, "cuda")),
        ("auto", 1, True, 8, (2, "cpu")),
        (3, 1, False, 8, (3, "cuda")),
        (2, 1, False, 0, (2, "cpu")),
    ],
)
def test_what_it_runs_on_is_known_from_the_start(
    monkeypatch: pytest.MonkeyPatch, asked: Any, nodes: int, cpu: bool, gpus: int, found: tuple[int, str]
) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: gpus)
    machines, processes = Machines.of(asked, nodes, cpu, 2), found[0] * nodes
    assert (machines.devices, machines.accelerator) == found
    machines.check_batch(processes), machines.check_clips(processes)
    with pytest.raises(UsageError, match="cannot be shared out evenly"):
        machines.check_batch(processes + 1)
    with pytest.raises(UsageError, match="clips to validate with"):
        machines.check_clips(processes - 1)


def test_more_gpus_than_there_are_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    assert Machines.of(1, 1, False, 2).accelerator == "cuda" and Machines.of(2, 1, True, 2).accelerator == "cpu"
    with pytest.raises(UsageError, match="--devices 2: expected up to 1, the GPUs of this machine"):
        Machines.of(2, 1, False, 2)


def test_a_machine_that_does_not_lead_may_be_there_first(tmp_path: Path) -> None:
    """And make clips already, while the one that leads begins the run."""
    other = RunFolder(tmp_path / "run", {}, resume=False, first=False)
    being_written = Pool(other.clips, ClipSettings(), 5).folder / "000003.npy.new"
    being_written.touch()
    first = RunFolder(tmp_path / "run", {}, resume=False)
    assert being_written.exists()
    first.close()


def test_a_folder_of_clips_that_is_another_s_is_not_taken(tmp_path: Path) -> None:
    (tmp_path / "clips").mkdir()
    (tmp_path / "clips" / "holiday.mp4").touch()
    with pytest.raises(UsageError, match="holds files that are no run"):
        RunFolder(tmp_path, {}, resume=False)
