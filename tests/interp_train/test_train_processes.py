"""Two processes that share the batches learn what one does."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from small_run import in_a_process, kept, session

from vid2ev.errors import UsageError

pytestmark = pytest.mark.long


def test_two_processes_learn_what_one_does(tmp_path: Path) -> None:
    session(tmp_path / "one", steps=3)
    shared = in_a_process(tmp_path / "two", devices=2, steps=3)
    assert shared.returncode == 0, shared.stderr
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
    assert torch.get_num_threads() == 1
