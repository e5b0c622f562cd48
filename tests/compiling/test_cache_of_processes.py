"""Compiled code on disk is the code that was asked for, whoever else compiles at the same time."""

from __future__ import annotations

from numba.core.caching import IndexDataCacheFile

import vid2ev.compiling.compiler  # noqa: F401  (marks the names of this process)
from vid2ev.compiling import cache as kernel_cache


def test_two_processes_that_compile_at_once_never_get_each_others_code(tmp_path, monkeypatch):
    mine = IndexDataCacheFile(str(tmp_path), "walk", "stamp")
    mine.save("one variant", "its code")
    my_index = mine._load_index()
    theirs = IndexDataCacheFile(str(tmp_path), "walk", "stamp")
    monkeypatch.setattr(theirs, "_load_index", dict)  # it looked before anything was there
    monkeypatch.setattr(kernel_cache, "_MARK", "theirs")
    theirs.save("another variant", "other code")
    for index in (mine._load_index(), my_index):  # whichever of them wrote the index last
        mine._save_index(index)
        assert mine.load("one variant") in ("its code", None)
        assert mine.load("another variant") in ("other code", None)
    assert mine.load("one variant") == "its code"


def test_a_kernel_that_cannot_be_kept_runs_all_the_same(tmp_path, monkeypatch):
    cache = IndexDataCacheFile(str(tmp_path), "walk", "stamp")

    def full(*_):
        raise OSError(27, "File too large")

    monkeypatch.setattr(cache, "_save_data", full)
    cache.save("a variant", "its code")
    assert cache.load("a variant") is None
