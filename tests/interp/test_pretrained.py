"""Weights that come with the package: each is what its name says, has its card, and is found by its name."""

from __future__ import annotations

from pathlib import Path

import pytest

from interp import pretrained
from interp.weights import load
from vid2ev.errors import UsageError

COME = sorted(pretrained.HERE.glob("*.safetensors"))


@pytest.mark.parametrize("path", COME, ids=lambda path: path.stem)
def test_weights_are_what_their_name_says(path: Path) -> None:
    name, _, size = path.stem.rpartition("-")
    network = load(path)
    assert network.spec.size == size  # type: ignore[union-attr]
    assert path.with_suffix(".md").read_text().startswith(f"# {name}, {size}\n")


def test_all_together_are_within_forty_megabytes() -> None:
    assert COME and sum(path.stat().st_size for path in COME) <= 40_000_000


def test_weights_are_a_file_or_a_run_or_come_by_their_name(tmp_path: Path) -> None:
    file = tmp_path / pretrained.OF_RUN
    file.touch()
    assert pretrained.path_of(file) == pretrained.path_of(str(file)) == pretrained.path_of(tmp_path) == file
    assert [pretrained.path_of(path.stem) for path in COME] == COME
    assert [pretrained.path_of(path.stem.replace("_", "-")) for path in COME] == COME
    with pytest.raises(UsageError, match=f"no such file.*did you mean {COME[0].stem}.*{COME[-1].stem}"):
        pretrained.path_of(COME[0].stem[:-1])
    with pytest.raises(UsageError, match="no such file"):
        pretrained.path_of(tmp_path / "other" / pretrained.OF_RUN)
