"""A kernel that is kept compiled is of the files as they are."""

from __future__ import annotations

import ast
import importlib.util
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core import caching

from vid2ev.compiling import cache
from vid2ev.compiling.cache import COLOURS, KERNELS

PACKAGE = Path(cache.__file__).parents[1]
KERNEL = """
from vid2ev.compiling.compiler import compiled

@compiled
def twice(x):
    return 2 * x
"""


def kernel_of(path: Path) -> Any:
    """The kernel of a file, not yet called."""
    spec = importlib.util.spec_from_file_location("kernel_of_a_test", path)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.twice


def loaded(path: Path) -> tuple[int, int]:
    """How often a kernel of a file was found compiled, and how often not, when it is called."""
    kernel = kernel_of(path)
    assert kernel(21) == 42
    stats = kernel.stats
    return sum(Counter(stats.cache_hits).values()), sum(Counter(stats.cache_misses).values())


def test_a_kernel_is_compiled_again_where_any_of_its_files_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    assert loaded(tmp_path / "kernel.py") == (0, 1)
    assert loaded(tmp_path / "kernel.py") == (1, 0)
    stamp = cache._versions(tmp_path)
    changed = (*stamp[:-1], (stamp[-1][0], stamp[-1][1] + 1, stamp[-1][2]))
    monkeypatch.setattr(cache, "_versions", lambda *rooms: changed)
    assert loaded(tmp_path / "kernel.py") == (0, 1)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("left", [0.0, 0.5, None])
def test_a_kernel_is_compiled_again_where_what_was_kept_of_it_is_damaged(
    suffix: str, left: float | None, tmp_path: Path
) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    assert loaded(tmp_path / "kernel.py") == (0, 1)
    (kept,) = Path(kernel_of(tmp_path / "kernel.py").stats.cache_path).glob(f"*.{suffix}")
    size = kept.stat().st_size
    kept.write_bytes(bytes(size) if left is None else kept.read_bytes()[: int(left * size)])
    assert loaded(tmp_path / "kernel.py") == (0, 1)
    assert loaded(tmp_path / "kernel.py") == (1, 0)


def test_where_no_folder_can_be_written_what_is_compiled_is_kept_while_the_program_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As for a user without a home, in an image that is only read."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (temporary := tmp_path / "temporary").mkdir()
    ensure = caching._CacheLocator.ensure_cache_path

    def only_temporary(locator: Any) -> None:
        if not Path(locator.get_cache_path()).is_relative_to(temporary):
            raise PermissionError(13, "Permission denied")
        ensure(locator)

    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", only_temporary)
    monkeypatch.setattr(numba.config, "CACHE_DIR", numba.config.CACHE_DIR)
    monkeypatch.setattr(cache.ForThisRun, "_folder", None)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/of/nobody")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    for _ in range(2):  # (not even temporary files)
        assert loaded(tmp_path / "kernel.py") == (0, 1)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    assert loaded(tmp_path / "kernel.py") == (0, 1)
    assert loaded(tmp_path / "kernel.py") == (1, 0)
    (folder,) = temporary.iterdir()
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)  # (where processes that this one begins find it)
    assert cache.ForThisRun._folder is not None
    cache.ForThisRun._folder.cleanup()
    assert not any(temporary.iterdir())


def test_of_a_home_that_nobody_knows_no_folder_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    for home, found in ("~/.cache/numba", False), (str(tmp_path / "home" / "numba"), True):
        monkeypatch.setattr(caching.AppDirs, "user_cache_dir", home)
        monkeypatch.chdir(tmp_path)
        assert (cache.InHome.from_function(loaded, str(tmp_path / "kernel.py")) is not None) == found
    assert sorted(path.name for path in tmp_path.iterdir()) == ["home", "kernel.py"]
    assert cache.InHome in caching.CacheImpl._locator_classes
    assert caching.UserWideCacheLocator not in caching.CacheImpl._locator_classes


@pytest.mark.parametrize(
    "decorator",
    ["compiling.compiler import compiled", "compiling.cache import cached", "scenes.rays.compiler import walk"],
)
def test_a_number_of_a_file_beside_it_is_that_of_now(
    tmp_path: Path, decorator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    name = decorator.split()[-1]
    (tmp_path / "kernel.py").write_text(
        f"from vid2ev.{decorator}\nfrom factor_of_a_test import FACTOR\n\n@{name}\ndef twice(x):\n"
        "    return FACTOR * x\n"
    )
    for factor in (2, 42, 21):
        (tmp_path / "factor_of_a_test.py").write_text(f"FACTOR = {factor}\n")
        os.utime(tmp_path / "factor_of_a_test.py", (factor, factor))
        cache._versions.cache_clear()
        sys.modules.pop("factor_of_a_test", None)
        importlib.invalidate_caches()
        spec = importlib.util.spec_from_file_location("kernel_of_a_test", tmp_path / "kernel.py")
        assert spec and spec.loader
        spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
        assert module.twice(2) == 2 * factor
    sys.modules.pop("factor_of_a_test")


def numbers_from(tree: ast.Module) -> Iterator[Path]:
    """The files of ours that numbers are imported from."""
    for node in ast.walk(tree):
        module = (node.module or "") if isinstance(node, ast.ImportFrom) else ""
        if module.startswith(("vid2ev.", "interp.")) and any(each.name.isupper() for each in node.names):  # type: ignore[attr-defined]
            yield PACKAGE.parent / f"{module.replace('.', '/')}.py"


def test_numbers_of_other_rooms_that_are_compiled_in_are_of_rooms_that_count() -> None:
    """All that is cached takes its numbers from its own room, or from one by which it is compiled again."""
    looked_at = 0
    for path in (*PACKAGE.rglob("*.py"), *(PACKAGE.parent / "interp").rglob("*.py")):
        text = path.read_text()
        kernel = "from vid2ev.compiling.compiler import" in text
        if not kernel and "from vid2ev.compiling.cache import cached" not in text:
            continue
        count = {path.parent, *(PACKAGE / room for room in (KERNELS if kernel else COLOURS))}
        for file in numbers_from(ast.parse(text)):
            looked_at += 1
            assert file.parent.name == "compiling" or file.parent in count, f"{path} takes numbers from {file}"
    assert looked_at > 30


def test_nothing_is_cached_that_does_not_know_its_files() -> None:
    found = [path.name for path in PACKAGE.parent.glob("[vi]*/**/*.py") if "cache=True" in path.read_text()]
    assert sorted(found) == ["cache.py", "compiler.py"]


def test_all_files_that_kernels_are_made_of_count() -> None:
    made_of = [path for path in PACKAGE.rglob("*.py") if "compiling.compiler import" in path.read_text()]
    assert len(made_of) > 40
    for path in made_of:
        rooms = path.parent, *(PACKAGE / each for each in KERNELS)
        assert f"{path.parent.name}/{path.name}" in {name for name, _, _ in cache._versions(*rooms)}


@pytest.mark.parametrize("found", [None, b"", b"of others", b"\xff\x00 of a disk that fails"])
def test_kernels_of_other_sources_are_deleted_whatever_is_found_in_place_of_their_stamp(
    found: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache, "_PACKAGE", tmp_path)
    kept = tmp_path / "physics" / "__pycache__"
    kept.mkdir(parents=True)
    if found is not None:
        (kept / "kernels.stamp").write_bytes(found)
    for left in (False, True):
        (kept / "law.nbc").touch()
        cache.drop_stale_kernels()
        assert (kept / "law.nbc").exists() is left
