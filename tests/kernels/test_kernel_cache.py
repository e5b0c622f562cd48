"""A kernel that is kept compiled is of the files as they are."""

from __future__ import annotations

import importlib.util
from collections import Counter
from pathlib import Path

import pytest

from vid2ev import kernel_compiler

PACKAGE = Path(kernel_compiler.__file__).parent
KERNEL = """
from vid2ev.kernel_compiler import compiled

@compiled
def twice(x):
    return 2 * x
"""


def loaded(path: Path) -> tuple[int, int]:
    """How often a kernel of a file was found compiled, and how often not, when it is called."""
    spec = importlib.util.spec_from_file_location("kernel_of_a_test", path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.twice(21) == 42
    stats = module.twice.stats
    return sum(Counter(stats.cache_hits).values()), sum(Counter(stats.cache_misses).values())


def test_a_kernel_is_compiled_again_where_any_of_its_files_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    assert loaded(tmp_path / "kernel.py") == (0, 1)
    assert loaded(tmp_path / "kernel.py") == (1, 0)
    stamp = kernel_compiler.source_stamp(tmp_path)
    changed = (*stamp[:-1], (stamp[-1][0], stamp[-1][1] + 1, stamp[-1][2]))
    monkeypatch.setattr(kernel_compiler, "source_stamp", lambda room: changed)
    assert loaded(tmp_path / "kernel.py") == (0, 1)


def test_all_files_that_kernels_are_made_of_count() -> None:
    made_of = [path for path in PACKAGE.rglob("*.py") if "kernel_compiler import" in path.read_text()]
    assert len(made_of) > 40
    for path in made_of:
        if path.parent != PACKAGE / "kernels" / "cuda":  # (which has nothing that is kept)
            assert path.name in {name for name, _, _ in kernel_compiler.source_stamp(path.parent)}
